"""A recording: events, the frames beside them if there are any, and what is wrong with it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.events import Events, cut
from adv2e.files.regular import shown
from adv2e.sources.frame import Frame, Image, Light, odd_white
from adv2e.sources.stored import recorded_light
from adv2e.ticks import microseconds


@dataclass(frozen=True, repr=False)
class Recording:
    """The content of an event file; its length is the number of events.

    ``recording[0.5:1.0]`` is the part from 0.5 s to 1 s after its first event or frame.

    Attributes
    ----------
    path : str
        What was read.
    layout : str
        ``text``, ``davis240c``, ``monash`` and others: see docs/formats.md.
    width, height : int
        Geometry [pixels]; zero when nothing tells.
    events : array of EVENT_DTYPE
        Sorted by time, those of one time as in the file; all inside the geometry.  Of CAUSED_DTYPE
        where the file has causes.
    frame_times_ns : array of int64 or None
        Times of the frames on the clock of the events [ns]; None without frames.
    metadata : dict
        What the file says of itself, if this program wrote it.
    problems : list of str
        What is doubtful in the file and what was done about it, a line each.
    images : callable
        Returns an iterator over the images of the frames.
    inputs : list of str or Path
        Files that were read, and are read again for the images.

    Examples
    --------
    >>> from adv2e import Recording
    >>> from adv2e.events import make_events
    >>> events = make_events(t=[0, 600_000, 900_000], x=[3, 0, 1], y=[2, 1, 1], p=[1, 0, 1])
    >>> recording = Recording("drive.h5", "array", 4, 3, events)
    >>> recording[0.5:]
    <Recording drive.h5: 2 events, 4x3 pixels, 0.300 s>
    """

    path: str
    layout: str
    width: int
    height: int
    events: Events
    frame_times_ns: NDArray[np.int64] | None = None
    metadata: dict[str, Any] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    images: Callable[[], Iterator[Image | Frame]] = field(default=lambda: iter(()), repr=False)
    inputs: list[str | Path] = field(default_factory=list, repr=False)

    def __len__(self) -> int:
        return len(self.events)

    def __bool__(self) -> bool:
        return True  # also without events

    @property
    def span_us(self) -> tuple[int, int]:
        """Times of the first and the last event or frame [us]; (0, 0) without any."""
        times = [self.events["t"][[0, -1]]] if self.events.size else []
        if self.frame_times_ns is not None and self.frame_times_ns.size:
            times.append(microseconds(self.frame_times_ns[[0, -1]]))
        if not times:
            return 0, 0
        return min(int(pair[0]) for pair in times), max(int(pair[1]) for pair in times)

    @property
    def duration_s(self) -> float:
        """Time from the first event or frame to the last one [s]; 0 without any."""
        first, last = self.span_us
        return (last - first) * 1e-6

    def __getitem__(self, part: slice) -> Recording:
        """Return the part from `start` to before `stop` [s after the first event or frame].

        Raises
        ------
        TypeError
            It is no slice, or one with a step.
        """
        if not isinstance(part, slice) or part.step is not None:
            raise TypeError("a recording takes a slice of seconds, such as recording[0.5:1.0]")
        first, last = self.span_us
        start = first if part.start is None else first + round(part.start * 1e6)
        stop = last + 1 if part.stop is None else first + round(part.stop * 1e6)
        events = cut(self.events, start, stop)
        if self.frame_times_ns is None:
            return replace(self, events=events)
        at_us = microseconds(self.frame_times_ns)
        inside = (start <= at_us) & (at_us < stop)
        times_ns, whole = self.frame_times_ns[inside], self.images
        return replace(
            self,
            events=events,
            frame_times_ns=times_ns,
            images=lambda: compress(whole(), inside.tolist()),
        )

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the events to a file; see :func:`adv2e.write_events`."""
        from adv2e import write_events  # noqa: PLC0415 - which is above this module

        write_events(path, self, overwrite=overwrite)

    def view(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write a page on which to play the events in a browser, as ``adv2e view`` does."""
        from adv2e import view  # noqa: PLC0415 - which is above this module

        view(self, path, overwrite=overwrite)

    def __repr__(self) -> str:
        frames = 0 if self.frame_times_ns is None else len(self.frame_times_ns)
        return (
            f"<Recording {shown(self.path)}: {len(self):,} events"
            + (f", {frames:,} frames" if frames else "")
            + f", {self.width}x{self.height} pixels, {self.duration_s:.3f} s>"
        )

    def _repr_html_(self) -> str:
        """Return the same for notebooks, with pictures of its events and of their rate.

        They are no scripts, which notebooks do not run before they are trusted.
        """
        from base64 import b64encode  # noqa: PLC0415 - all these are for notebooks alone
        from html import escape  # noqa: PLC0415

        from adv2e import render  # noqa: PLC0415 - which is above this module
        from adv2e.light.pictures import png_of  # noqa: PLC0415

        parts = [f"<p>{escape(repr(self))}</p>"]
        for style in ("white", "rate") if self.events.size and self.width and self.height else ():
            picture: Any = render(self, count=1, frames=False, style=style)
            data = b64encode(png_of(picture)).decode()
            words = "events" if style == "white" else "rate of events over time"
            parts.append(f'<img alt="{words}" src="data:image/png;base64,{data}"/>')
        return "<br>".join(parts)

    @property
    def light(self) -> Light:
        """Encoding and white of the frames; see ``recorded_light``."""
        return recorded_light(self.metadata, self.path)

    @property
    def encoding(self) -> str:
        """Encoding of the frames for ``frames.encoding: auto``."""
        return self.light.encoding

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the events as arrays of their own, by name: t, x, y and p.

        Each is contiguous and signed, t int64, x, y and p int16, so that ``torch.from_numpy`` takes
        it, and p - 1 or 2 p - 1 do not wrap.

        Examples
        --------
        >>> from adv2e.events import make_events
        >>> from adv2e.formats.recording import Recording
        >>> events = make_events(t=[5, 9], x=[3, 0], y=[2, 1], p=[1, 0])
        >>> (2 * Recording("r", "array", 4, 3, events).columns()["p"] - 1).tolist()
        [1, -1]
        """
        kinds = {"t": np.int64, "x": np.int16, "y": np.int16, "p": np.int16}
        most = max(self.width, self.height) > np.iinfo(np.int16).max
        kinds |= {"x": np.int32, "y": np.int32} if most else {}
        return {name: self.events[name].astype(kind) for name, kind in kinds.items()}

    def frames(self) -> Iterator[Frame]:
        """Yield the frames one by one, as often as asked.

        Raises
        ------
        DataError
            An image cannot be read.
        """
        times = [] if self.frame_times_ns is None else self.frame_times_ns.tolist()
        stored = self.light.full_scale
        first: float | None = None
        for number, (t_ns, image) in enumerate(zip(times, self.images(), strict=True)):
            frame = image if isinstance(image, Frame) else Frame(image)
            first = frame.white if number == 0 else first
            odd = "" if stored is not None else odd_white(frame, first)
            label = f"{self.path}: frame {number}"
            yield replace(frame, t_ns=t_ns, label=label, white=stored or first, odd_white=odd)

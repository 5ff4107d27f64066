"""A recording: events, the frames beside them if there are any, and what is wrong with it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.events import Events
from adv2e.sources.frame import Frame, Image, Light, Pixels, as_pixels, odd_white
from adv2e.sources.stored import recorded_light


@dataclass(frozen=True)
class Recording:
    """The content of an event file.

    Attributes
    ----------
    path : str
        What was read.
    layout : str
        ``text``, ``davis240c``, ``monash`` and others: see :mod:`adv2e.formats.registry`.
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
    """

    path: str
    layout: str
    width: int
    height: int
    events: Events
    frame_times_ns: NDArray[np.int64] | None = None
    metadata: dict[str, Any] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    images: Callable[[], Iterator[Image | Pixels]] = field(default=lambda: iter(()), repr=False)
    inputs: list[str | Path] = field(default_factory=list, repr=False)

    @property
    def light(self) -> Light:
        """Encoding and white of the frames; see :func:`recorded_light`."""
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
            pixels = as_pixels(image)
            first = pixels.white if number == 0 else first
            odd = "" if stored is not None else odd_white(pixels, first)
            label = f"{self.path}: frame {number}"
            yield Frame(t_ns, pixels.image, label, pixels.alpha, stored or first, odd)

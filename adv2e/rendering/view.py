"""One page on which to look at events in a browser, without network: what ``adv2e view`` does.

The page is never larger than ``MOST_BYTES``.  Of many events it holds some, evenly spread, and says
which share; the rates beside them count all.  A file is read twice, in bounded memory: for its size
and time, then for its events.

Events are stored in columns of bytes, compressed by deflate (RFC 1951), in base64: times since the
event before [us], x and y, the lowest bytes of all events first, then the next ones; and ON or OFF,
a bit each, the first of eight being the highest.
"""

from __future__ import annotations

import html
import json
import re
import zlib
from base64 import b64encode
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e import __version__
from adv2e.causes import without_causes
from adv2e.errors import DataError
from adv2e.events import Events, cut, empty_events
from adv2e.files.regular import shown
from adv2e.files.states import check_distinct
from adv2e.formats.reading import events_in_order, open_events, read_events, shots_of
from adv2e.formats.recording import Recording
from adv2e.geometry import MOST_PIXELS
from adv2e.light.pictures import drawn_frame
from adv2e.options import ViewOptions, takes
from adv2e.process.bars import share_bar
from adv2e.rendering.films import replacing
from adv2e.rendering.rate import Rates
from adv2e.rendering.recording import part_shown
from adv2e.rendering.render import reading_of, recording_of
from adv2e.rendering.timeline import reduced
from adv2e.sources.frame import Shot
from adv2e.ticks import microseconds

if TYPE_CHECKING:
    from typing_extensions import Unpack

MOST_BYTES = 3_000_000
"""Size of the largest page."""
_MOST_DRAWN = 1 << 20
"""Most events that a page draws: a phone has to hold them."""
_MOST_FRAMES, _FRAME_BYTES, _FRAME_WIDTH, _QUALITY = 160, 900_000, 480, 50
"""Of the frames beneath: how many, how large all together, how wide, and WebP's quality."""
_BINS, _CHUNK = 1000, 1 << 18
_DATA = Path(__file__).parent / "data"
_DOUBTS = "<details class=problems><summary>What is doubtful</summary><ul>{}</ul></details>\n"


@takes(ViewOptions)
def view(
    events: str | Path | Recording | NDArray[Any],
    output: str | Path | None = None,
    *,
    doubt: Callable[[str], None] = lambda text: None,
    **options: Unpack[ViewOptions],
) -> str | None:
    """Write a page on which to play events in a browser, and look at them in time and space.

    Parameters
    ----------
    events : str, Path, Recording, or (n,) array of EVENT_DTYPE
        A file, what :func:`adv2e.read_events` returned, or the events themselves.
    output : str or Path, optional
        File to write.  Without one, the page is returned.
    doubt : callable
        Takes lines for people on what is doubtful in a file.
    **options
        See :class:`adv2e.options.ViewOptions`.  An array needs `size`; how to read a file is for
        files alone.

    Returns
    -------
    str or None
        The page, where no file is named.

    Raises
    ------
    DataError
        The events cannot be read, or nothing tells how large the sensor is.
    OutputError
        The output exists, or cannot be written.

    Examples
    --------
    >>> import os, tempfile
    >>> import numpy as np
    >>> from adv2e import simulate, view
    >>> frames = [np.full((24, 32), light, np.float32) for light in (0.1, 0.2, 0.4, 0.8)]
    >>> events = np.concatenate(list(simulate(frames, 100)))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     view(events, os.path.join(folder, "events.html"), size=(32, 24))
    ...     os.listdir(folder)
    ['events.html']
    """
    with ExitStack() as stack:
        unfinished = None
        if output is not None:
            unfinished = stack.enter_context(replacing(Path(output), options["overwrite"]))
        bar = share_bar("looking through the events", "drawing", options["progress"])
        told = stack.enter_context(bar)
        if isinstance(events, (str, Path)):
            recording, parts, shots = _opened(Path(events), reading_of(options), told)
        else:
            recording, shots = recording_of(events, reading_of(options)), []
            every = recording.events
            parts = (every[n : n + _CHUNK] for n in range(0, every.size, _CHUNK))
        if output is not None:
            check_distinct(output, recording.inputs)
        if not (recording.width and recording.height):
            raise DataError(f"{recording.path}: nothing tells how large the sensor is")
        if options["no_frames"]:
            recording = replace(recording, frame_times_ns=None)
        part_us = part_shown(recording, options["start_s"], options["stop_s"])
        page = _page(recording, parts, shots, *part_us)
        if unfinished is not None:
            unfinished.write_text(page, "utf-8")
    for problem in dict.fromkeys(recording.problems):
        doubt(f"{recording.path}: {problem}")
    return page if output is None else None


def _opened(
    path: Path, reading: Any, told: Callable[[int, int | None], None]
) -> tuple[Recording, Iterator[Events], list[Shot]]:
    """Return a file as a recording of its first and last event, all its events, and its frames."""
    file = open_events(path, progress=told, **reading)
    size, _, parts = events_in_order(file)
    facts, shots = file.facts, list(shots_of(file))
    if size[0] * size[1] > MOST_PIXELS:
        read_events(path, **reading)  # which names the event that needs so many
    ends, times_ns = empty_events(2), np.array([shot.t_ns for shot in shots], np.int64)
    ends["t"] = facts.span_us or 0
    recording = Recording(
        str(path), file.layout, *size, ends, times_ns, facts.description, facts.problems
    )
    return replace(recording, inputs=file.inputs), parts, shots


class Thinned:
    """Some events of a stream, evenly spread, of which more than a bound are never held.

    Of one in `every`, event n is kept if the fraction of n times the golden ratio is below 1/every:
    its multiples spread more evenly than those of other numbers, and keep step with no pattern of
    the sensor (Knuth, The Art of Computer Programming 6.4, on Fibonacci hashing).  Events that are
    kept of more are kept of fewer, too, so that neither pieces nor bounds make a difference.
    """

    def __init__(self) -> None:
        self.every, self.count, self._held = 1, 0, 0
        self._parts = [(empty_events(), np.empty(0, np.uint32))]

    def add(self, events: Events) -> None:
        """Take events that follow those before."""
        ranks = np.arange(self.count, self.count + events.size, dtype=np.uint64).astype(np.uint32)
        self.count += events.size
        self._keep(without_causes(events), ranks * np.uint32(0x9E3779B9))  # 2**32 / golden ratio
        if self._held > 2 * _MOST_DRAWN:
            self.thin(2 * self.every)

    def thin(self, every: int) -> Events:
        """Return the events of which one in `every` is left, no more of them than before."""
        parts, self._parts, self._held, self.every = self._parts, [], 0, every
        self._keep(*map(np.concatenate, zip(*parts, strict=True)))
        return self._parts[0][0]

    def _keep(self, events: Events, ranks: NDArray[np.uint32]) -> None:
        kept = ranks <= 0xFFFFFFFF // self.every
        self._parts.append((events[kept], ranks[kept]))
        self._held += self._parts[-1][1].size


def _page(
    recording: Recording, parts: Iterator[Events], shots: list[Shot], begin_us: int, stop_us: int
) -> str:
    """Return the page of the time from `begin_us` to before `stop_us`."""
    origin_us, _ = recording.span_us
    rates, thinned = Rates(begin_us, stop_us, _BINS), Thinned()
    for events in parts:
        some = cut(events, begin_us, stop_us)
        rates.add(some)
        thinned.add(some)
        if events.size and events["t"][-1] >= stop_us:
            break
    frames, of_frames = _frames(recording, shots, begin_us, stop_us)
    off, on = rates.counts
    facts: dict[str, Any] = {"width": recording.width, "height": recording.height}
    facts |= {"begin": begin_us - origin_us, "stop": stop_us - origin_us, "bin": rates.width_us}
    facts |= {"off": off.tolist(), "on": on.tolist()}
    facts["frames"] = [
        [at_us - origin_us, f"data:image/webp;base64,{b64encode(data).decode()}"]
        for at_us, data in frames
    ]
    lasts_s = f"{(stop_us - begin_us) / 1e6:,.6f}".rstrip("0").rstrip(".")
    told = f"{recording.width} × {recording.height} pixels · {lasts_s} s · {thinned.count:,} event"
    told += f"{'s' * (thinned.count != 1)} ({on.sum():,} ON, {off.sum():,} OFF) · "
    told += f"{len(frames):,} of {of_frames:,} frames · " if of_frames else ""
    doubts = "".join(f"<li>{html.escape(shown(one))}</li>" for one in recording.problems)
    fields = {name: (_DATA / f"view.{name}").read_text("utf-8") for name in ("css", "js", "html")}
    fields["title"] = html.escape(shown(Path(recording.path).name or recording.path))
    fields |= {"problems": _DOUBTS.format(doubts) if doubts else "", "version": __version__}

    def filled(every: int) -> str:
        drawn = thinned.thin(every)
        fields["told"] = told + (f"1 of {every:,}" if every > 1 else "all") + " events drawn"
        fields["facts"] = json.dumps({**facts, "drawn": drawn.size, "every": every})
        fields["events"] = b64encode(packed(drawn, begin_us)).decode()
        return re.sub(r"\{\{(\w+)\}\}", lambda found: fields[found[1]], fields["html"])

    every = max(thinned.every, -(-thinned.count // _MOST_DRAWN))
    while (size := len((page := filled(every)).encode())) > MOST_BYTES:
        every = max(every + 1, every * size // MOST_BYTES)
    return page


def packed(events: Events, begin_us: int) -> bytes:
    """Return sorted events in compressed columns of bytes, the first time counted from a begin."""
    columns = [np.diff(events["t"], prepend=begin_us), *(events[name].copy() for name in "xy")]
    planes = [
        column.view(np.uint8).reshape(-1, column.itemsize)[:, byte].tobytes()
        for column, size in zip(columns, (7, 2, 2), strict=True)  # seven bytes are 2000 years
        for byte in range(size)
    ]
    return zlib.compress(b"".join([*planes, np.packbits(events["p"]).tobytes()]), 9)


def _frames(
    recording: Recording, shots: list[Shot], begin_us: int, stop_us: int
) -> tuple[list[tuple[int, bytes]], int]:
    """Return times [us] and WebP pictures of frames, evenly spread, and how many frames there are.

    That before the begin counts, too.
    """
    times_ns = recording.frame_times_ns
    if times_ns is None or not times_ns.size:
        return [], 0
    at_us = microseconds(times_ns)
    first = max(0, int(np.searchsorted(at_us, begin_us, "right")) - 1)
    count = max(0, int(np.searchsorted(at_us, stop_us)) - first)
    kept, some = np.zeros(times_ns.size, np.bool_), min(count, _MOST_FRAMES)
    kept[first + np.arange(some) * count // max(1, some)] = True

    def images() -> Iterator[Any]:
        found = (shot.load() for shot in compress(shots, kept))
        return found if shots else compress(recording.images(), kept)

    chosen = replace(recording, frame_times_ns=times_ns[kept], images=images)
    scale = min(1.0, _FRAME_WIDTH / max(recording.width, recording.height))
    width, height = (max(1, round(side * scale)) for side in (recording.width, recording.height))
    made = []
    for frame in chosen.frames():
        image = reduced(drawn_frame(frame, recording.encoding), (width, height))
        image = image if image.ndim == 2 else image[:, :, ::-1]
        _, data = cv2.imencode(".webp", image, [cv2.IMWRITE_WEBP_QUALITY, _QUALITY])
        made.append((microseconds(int(frame.t_ns)), data.tobytes()))
    while sum(len(data) for _, data in made) > _FRAME_BYTES:
        made = made[::2] if len(made) > 1 else []
    return made, count

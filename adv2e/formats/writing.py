"""Writing of events: files of several formats, and standard output.

>>> from adv2e.events import make_events
>>> from adv2e.formats.writing import open_sink
>>> events = make_events(t=[10, 20], x=[0, 3], y=[0, 2], p=[1, 0])
>>> with open_sink("-", width=4, height=3, metadata={}) as sink:  # doctest: +SKIP
...     sink.write_events(events)
0.000010000 0 0 1
0.000020000 3 2 0
"""

from __future__ import annotations

import json
import struct
import zlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from adv2e import __version__
from adv2e.background import default_threads
from adv2e.causes import CAUSED_DTYPE, has_causes, without_causes
from adv2e.errors import DataError, OutputError, UsageError, warn
from adv2e.events import EVENT_DTYPE, Events, checked_events
from adv2e.files.regular import beside
from adv2e.files.staging import Staging, writing
from adv2e.formats import causes
from adv2e.formats.causes import check_numbers
from adv2e.formats.recording import Recording
from adv2e.formats.registry import Format, to_write

try:
    import deflate
except ImportError:
    PACKAGES: tuple[str, ...] = ()
    """Packages that compress, beside the standard library."""
else:
    PACKAGES = ("deflate",)

_ZLIB = b"\x78\x01"
"""Head of a zlib stream of the lowest level."""

_STORED, _WINDOW, _PROBE = 0xFFFF, 1 << 15, 1 << 10
"""Most bytes of a stored block of deflate; how far it looks back; bytes of a part looked at."""

_ROOM = 4096
"""Blanks behind a description with which a file begins."""

_HEAD = 1 << 20
"""Bytes at the beginning of a file that hold a description, or none does."""

_NO_FRAMES = (
    "the frames of the recording are not written: 'adv2e convert IN -o OUT --from events"
    " --with-frames' keeps them"
)


def open_sink(
    path: str | Path,
    *,
    width: int,
    height: int,
    metadata: dict[str, Any],
    format: str | None = None,
    layout: str | None = None,
    overwrite: bool = False,
    with_frames: bool = False,
    threads: int | None = None,
    staging: Staging | None = None,
    causes: bool = False,
    side: SideFiles | None = None,
) -> Sink:
    """Return a sink for `path`, to be used in a ``with`` block.

    Nothing is written before the block is entered, and nothing is left if it is left by an
    exception; folders missing above `path` are made.

    Parameters
    ----------
    path : str or Path
        Output; "-": text to standard output.
    width, height : int
        Geometry [pixels].
    metadata : dict
        What JSON can hold; stored inside, or in ``<path>.json`` where a format cannot hold it.
    format : str, optional
        See :func:`adv2e.formats.registry.names`; default: by the suffix, a path without one is a
        folder.
    layout : str, optional
        See :func:`adv2e.formats.registry.layouts`, for HDF5.
    overwrite : bool
        Replace, at the end, what exists.
    with_frames : bool
        Store frames, where the format can.
    threads : int, optional
        Threads that compress; default: all cores.  The bytes do not depend on it.
    staging : Staging, optional
        Takes the output together with others; it says whether what exists is replaced.
    causes : bool
        The events know their causes, which are stored: inside where the format has a column for
        them, else beside: see :mod:`adv2e.formats.causes`.
    side : iterator of (name, bytes), optional
        Files that belong to the events, asked for at the end: a DAVIS240C recording holds them,
        beside others they are in the folder ``<path>.side``.

    Raises
    ------
    UsageError
        Unknown `format` or `layout`, or they do not fit together; causes to standard output.
    OutputError
        The output, or causes beside it, exists already, or cannot be made; or the format cannot
        hold such a sensor.
    """
    path = Path(path)
    chosen = to_write(path, format, layout)
    request = Request(
        path=path,
        width=width,
        height=height,
        description={"adv2e": __version__, "width": width, "height": height, **metadata},
        with_frames=with_frames,
        threads=threads or default_threads(),
        causes=causes,
        side=side,
    )
    files = Staging(overwrite) if staging is None else staging
    return Sink(chosen, request, files, is_alone=staging is None)


def write_events(
    path: str | Path,
    events: Events | Recording,
    size: tuple[int, int] | None = None,
    *,
    metadata: dict[str, Any] | None = None,
    overwrite: bool = False,
) -> None:
    """Write events to a file, whose suffix tells the format, or to a folder.

    Parameters
    ----------
    path : str or Path
        Output: its suffix tells the format; without one, a DAVIS240C folder.
    events : Recording, or structured array, (n,)
        With the fields t [us], x, y, p, in any order of time; sorted ones are written as they are.
        The field cause, if there is one, is written too.  The frames of a recording are not:
        ``adv2e convert IN -o OUT --from events --with-frames`` keeps them.
    size : (int, int), optional
        Width and height of the sensor [pixels]; an array needs it.
    metadata : dict, optional
        What JSON can hold; stored inside, or in ``<path>.json`` where a format cannot hold it.
        Default: that of the recording.
    overwrite : bool
        Replace, at the end, what exists.

    Raises
    ------
    DataError
        The array has other fields or no size, or an event lies outside the sensor, or has no cause.
    OutputError
        Unknown suffix; the output exists already, or cannot be made.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from adv2e import read_events, write_events
    >>> from adv2e.events import make_events
    >>> events = make_events(t=[10, 20], x=[0, 3], y=[0, 2], p=[1, 0])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_events(Path(folder, "a.h5"), events, (4, 3))
    ...     recording = read_events(Path(folder, "a.h5"))
    >>> recording.events["t"].tolist(), recording.width, recording.height
    ([10, 20], 4, 3)
    """
    recording = events if isinstance(events, Recording) else None
    if recording is not None:
        events, size = recording.events, size or (recording.width, recording.height)
        if recording.frame_times_ns is not None:
            warn(_NO_FRAMES)
        if metadata is None:
            metadata = {key: value for key, value in recording.metadata.items() if key != "frames"}
    if size is None:
        raise DataError("events: size is missing, (width, height) of the sensor [pixels]")
    width, height = size
    caused = has_causes(np.asarray(events))
    ours = checked_events(events, width, height, CAUSED_DTYPE if caused else EVENT_DTYPE)
    if caused:
        check_numbers(np.asarray(events)["cause"], "events: cause")
    with open_sink(
        path,
        width=width,
        height=height,
        metadata=dict(metadata or {}),
        overwrite=overwrite,
        causes=caused,
    ) as sink:
        sink.write_events(ours)


SideFiles = Iterator[tuple[str, bytes]]
"""Names, with the folder in which they are, and bytes of files that belong to events."""


@dataclass(frozen=True, kw_only=True)
class Request:
    """Output that was asked of :func:`adv2e.formats.writing.open_sink`: path, size, options."""

    path: Path
    width: int
    height: int
    description: dict[str, Any]
    with_frames: bool
    threads: int
    causes: bool = False
    side: SideFiles | None = None


class Writer(ABC):
    """Writes a format, files under their temporary names.

    Parameters
    ----------
    request : Request
    stack : ExitStack
        Takes what is to be closed, however writing ends.
    *temporary : Path
        What :meth:`stage` returned.
    """

    @staticmethod
    def stage(path: Path, staging: Staging) -> list[Path]:
        """Return the temporary names of the files that make the output `path`."""
        return [staging.file(path)]

    @abstractmethod
    def __init__(self, request: Request, stack: ExitStack, *temporary: Path) -> None: ...

    @abstractmethod
    def write_events(self, events: Events) -> None:
        """Append events."""

    def write_frame(self, t_ns: int, image: NDArray[Any]) -> None:
        """Append a frame."""
        raise NotImplementedError  # a format that takes frames says how

    def finish(self) -> None:  # noqa: B027
        """Write the remaining events and frames."""


class Pieces:
    """Gathers items to pieces of `count`, so that a file does not depend on how they come."""

    def __init__(self, count: int, dtype: DTypeLike) -> None:
        self._buffer, self._held = np.empty(count, dtype), 0

    def add(self, items: NDArray[Any]) -> Iterator[NDArray[Any]]:
        """Take items, and yield the pieces that are full."""
        items = np.ascontiguousarray(items, self._buffer.dtype)
        while items.size:
            part, items = np.split(items, [self._buffer.size - self._held])
            # as bytes: records would be copied field by field
            target = self._buffer[self._held : self._held + part.size]
            target.view(np.uint8)[:] = part.view(np.uint8)
            self._held += part.size
            if self._held == self._buffer.size:
                yield self.take()

    def take(self) -> NDArray[Any]:
        """Return the items that are held; nobody writes to them any more."""
        held = self._buffer[: self._held]
        self._buffer, self._held = np.empty_like(self._buffer), 0
        return held


class Sink:
    """Takes the events and frames of one recording, inside a ``with`` block.

    Leaving the block normally finishes the output; an exception leaves no trace of it.

    Parameters
    ----------
    format : Format
        What is written.
    request : Request
    staging : Staging
        Takes the files.
    is_alone : bool
        They come into place, or go, at the end of the sink; else with others of the `staging`.

    Attributes
    ----------
    wants_frames : bool
        Whether frames are stored; if not, they are ignored.
    """

    def __init__(
        self, format: Format, request: Request, staging: Staging, *, is_alone: bool
    ) -> None:
        self.wants_frames = request.with_frames and "w" in format.frames
        self._name = "standard output" if str(request.path) == "-" else str(request.path)
        self._format = format
        self._check_size(request.width, request.height)
        writer = format.load(format.writer)
        temporary = writer.stage(request.path, staging)
        self._description = request.description
        self._described: Path | None = None
        if temporary and not format.holds_settings:
            self._described = staging.file(beside(request.path, ".json"))
        self._holds_causes = request.causes and format.causes != ""
        self._causes = self._place_of_causes(request, staging, temporary)
        self._side = self._place_of_side(request, staging, temporary)
        side = None if self._side else request.side
        told = replace(request, causes=self._holds_causes, side=side)
        self._side_files = request.side or iter(())
        self._open = self._opened(partial(writer, told), staging, temporary, is_alone)

    def _place_of_causes(
        self, request: Request, staging: Staging, temporary: list[Path]
    ) -> Path | None:
        """Return the path of the causes beside the output; None: they are not written there."""
        beside = causes.beside(request.path)
        if request.causes and not self._holds_causes:
            if not temporary:
                raise UsageError("--causes: standard output has no place for them; give -o FILE")
            return staging.file(beside)
        if temporary and beside.exists():
            raise OutputError(
                f"{beside}: exists, and would be taken for the causes of these events: remove it,"
                " or write them too (--causes)"
            )
        return None

    def _place_of_side(
        self, request: Request, staging: Staging, temporary: list[Path]
    ) -> Path | None:
        """Return the folder of side data beside the output; None: they are not written there."""
        place = beside(request.path, SIDE)
        if request.side is not None and not self._format.is_davis240c:
            return staging.folder(place, foreign_of(SIDE_LIST)) if temporary else None
        if temporary and place.exists():
            raise OutputError(
                f"{place}: exists, and would be taken for the side data of these events: remove it"
            )
        return None

    def _check_size(self, width: int, height: int) -> None:
        """Refuse a sensor that the format cannot name the pixels of."""
        most = self._format.most
        if width > most[0] or height > most[1]:
            raise OutputError(
                f"{self._name}: a sensor of {width}x{height} pixels does not fit"
                f" {self._format.what}, which holds {most[0]}x{most[1]} at most; choose another"
                " format, such as .h5"
            )

    def _check_time(self, t_us: int, what: str) -> None:
        """Refuse a time [us] that would be wrapped or cut."""
        first, last = self._format.first_us, self._format.last_us
        if not first <= t_us <= last:
            raise OutputError(
                f"{self._name}: {what} at {t_us / 1e6:.6f} s does not fit"
                f" {self._format.what}, which holds times from {first / 1e6:.6f} to"
                f" {last / 1e6:.6f} s; --t0 zero may help, or another format, such as .h5"
            )

    @contextmanager
    def _opened(
        self, writer: Callable[..., Writer], staging: Staging, temporary: list[Path], is_alone: bool
    ) -> Iterator[Writer]:
        with staging if is_alone else nullcontext(), _closing() as stack:
            with writing(self._name):
                staging.prepare()
                if self._causes is not None:
                    self._lines = stack.enter_context(self._causes.open("wb"))
                made = writer(stack, *temporary)
            begun = to_line(self._description).encode()
            yield made
            with writing(self._name):
                made.finish()
                if self._side is not None:
                    names = write_side(self._side, self._side_files)
                    (self._side / SIDE_LIST).write_text(to_json({"side": names}), "utf-8")
                if self._described is not None:
                    text = to_json(self._description)
                    self._described.write_text(text, encoding="utf-8", newline="\n")
                stack.close()
                for path in temporary[:1]:
                    self._describe_again(path, begun)

    def _describe_again(self, path: Path, begun: bytes) -> None:
        """Write the description at the begin of a file anew, with what is known only now."""
        now = to_line(self._description).rstrip().encode()
        if path.is_file() and len(now) <= len(begun):
            with path.open("r+b") as file:
                at = file.read(len(begun) + _HEAD).find(begun)
                if at >= 0:
                    file.seek(at)
                    file.write(now.ljust(len(begun)))

    def write_events(self, events: Events) -> None:
        """Append events; over all calls they are sorted by time.

        The array is not changed afterwards: threads may still read it.

        Raises
        ------
        OutputError
            They cannot be written, as when the disk is full, or do not fit the format.
        BrokenPipeError
            They go to standard output, and nobody reads them any more.
        """
        if events.size:
            for t in (int(events["t"][0]), int(events["t"][-1])):
                self._check_time(t, "an event")
        with writing(self._name):
            if self._causes is not None:
                self._lines.write(causes.lines_of(events["cause"]))
            self._writer.write_events(events if self._holds_causes else without_causes(events))

    def write_frame(self, t_ns: int, image: NDArray[Any]) -> None:
        """Append a frame taken at `t_ns` [ns]; over all calls sorted by time.

        `image` is uint8 or uint16, (rows, columns) or (rows, columns, 3) in RGB.  It may come
        long before the events around it.
        """
        if self.wants_frames:
            for t in (t_ns // 1000, (t_ns + 500) // 1000):  # formats round, or keep the rest
                self._check_time(t, "a frame")
            with writing(self._name):
                self._writer.write_frame(t_ns, image)

    def describe(self, **more: Any) -> None:
        """Add to the description what is known only at the end."""
        self._description.update(more)

    def __enter__(self) -> Sink:
        self._writer = self._open.__enter__()
        return self

    def __exit__(self, *raised: Any) -> None:
        self._open.__exit__(*raised)


SIDE, SIDE_LIST = ".side", "side.json"
"""Ending of the folder beside an output that holds its side data, and what lists these."""


def write_side(folder: Path, files: SideFiles) -> list[str]:
    """Write side data below a folder; return what lies in it by them."""
    names = set()
    for name, data in files:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
        names.add(name.partition("/")[0])
    folder.mkdir(parents=True, exist_ok=True)
    return sorted(names)


def foreign_of(description: str) -> Callable[[Path], str | None]:
    """Return a function that names what a folder holds beside the side data that one lists."""

    def foreign(folder: Path) -> str | None:
        held = {entry.name for entry in folder.iterdir()} - {description, *listed_side(folder)}
        return min(held, default=None)

    return foreign


def listed_side(folder: Path, description: str = SIDE_LIST) -> list[str]:
    """Return what of a folder its description lists as side data that we wrote."""
    try:
        return list(map(str, json.loads((folder / description).read_text("utf-8"))["side"]))
    except (OSError, ValueError, KeyError, TypeError):
        return []


@contextmanager
def _closing() -> Iterator[ExitStack]:
    """Give a stack for files; where the body raises, what closing them says is of no interest."""
    stack = ExitStack()
    try:
        yield stack
    except BaseException:
        with suppress(Exception):
            stack.close()
        raise
    stack.close()


def to_json(description: dict[str, Any]) -> str:
    """Return the description as text, the same for the same content, and fit for UTF-8."""
    text = json.dumps(description, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def to_line(description: dict[str, Any]) -> str:
    """Return the description as one line of ASCII, with room for more behind it.

    It holds no letter that means something in XML.
    """
    line = json.dumps(json.loads(to_json(description)))
    for letter in "&<>":
        line = line.replace(letter, f"\\u{ord(letter):04x}")
    return line + " " * _ROOM


def compress(array: NDArray[Any]) -> bytes:
    """Return the bytes of an array as deflate leaves them: libdeflate's, where it is installed.

    What libdeflate or zlib writes any inflate reads; how many bytes it takes differs.  Either gives
    the same bytes for the same data, which not every library does: ISA-L, several times faster,
    does not always.
    """
    data = np.ascontiguousarray(array).data
    if PACKAGES:
        return bytes(deflate.zlib_compress(data, 1))
    return zlib.compress(data, 1)


def compress_shuffled(values: NDArray[Any]) -> bytes:
    """Return the bytes of values as HDF5's filters shuffle and deflate leave them.

    Bytes of equal rank go together.  The low ones of columns and rows, and of times far apart, are
    noise, on which deflate spends most of its time and gains nothing: they are stored.
    """
    whole = np.ascontiguousarray(values).view(np.uint8)
    ranks = np.ascontiguousarray(whole.reshape(values.size, -1).T)
    noise = next((k for k, rank in enumerate(ranks) if not _is_noise(rank)), len(ranks))
    if not noise:
        return compress(ranks)
    low = ranks[:noise].tobytes()
    pieces = [low[at : at + _STORED] for at in range(0, len(low), _STORED)]
    blocks = (struct.pack("<BHH", 0, len(piece), len(piece) ^ _STORED) + piece for piece in pieces)
    total = zlib.adler32(ranks.data)
    # its header and sum stand around both
    return b"".join((_ZLIB, *blocks, compress(ranks[noise:])[2:-4], total.to_bytes(4, "big")))


def _is_noise(rank: NDArray[np.uint8]) -> bool:
    """Tell whether deflate gains next to nothing of bytes, by parts of them.

    What repeats from afar is looked for apart: light that flickers makes the same events anew.
    """
    data, size = rank.tobytes(), len(rank)
    pieces = b"".join(data[at : at + _PROBE] for at in range(size // 8, size, max(1, size // 4)))
    if len(zlib.compress(pieces, 1)) < 0.95 * len(pieces):
        return False
    words = ((at, data[at : at + 8]) for at in range(size - 8, size // 2, -max(8, size // 16)))
    return all(data.find(word, max(0, at - _WINDOW), at + 7) < 0 for at, word in words)

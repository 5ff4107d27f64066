"""Events of NumPy: in archives one structured array, or an array for each column; or one array.

The columns are called as in :mod:`adv2e.formats.columns`.  ``width`` and ``height`` tell the
geometry [pixels], ``adv2e`` (JSON) what wrote the file.  What is written here:

======================== =========================================
t_us                     int64, time [us]
x, y                     uint16, column and row, from the top left
p                        uint8, 1 is ON and 0 is OFF
causes                   uint8, with causes: see adv2e.causes
width, height            int64
adv2e                    text: version, configuration, seed (JSON)
======================== =========================================

References
----------
.. [1] NumPy, ``numpy.savez_compressed``, https://numpy.org/doc/stable/reference/routines.io.html.
"""

from __future__ import annotations

import io
import shutil
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from adv2e.causes import CAUSED_DTYPE
from adv2e.errors import DataError
from adv2e.events import Events
from adv2e.files.zips import Header, numpy_archive, open_member, read_array, read_header
from adv2e.formats.columns import SIZE_NAMES, find_columns, stated_unit
from adv2e.formats.event_file import Columns, EventFile, Facts
from adv2e.formats.writing import Request, Writer, to_json

_BEYOND = 1 << 31
_PART = 1 << 20  # events read at once
_LEVEL = 1  # of deflate
_BLOCK = 1 << 20  # bytes deflated at once

_FINE = ("timestamp", "x", "y", "polarity")
"""Names in BS-ERGB, of which x and y are in 1/32 of a pixel, in 16 bits whose sign was lost."""
_MOST_PIXELS, _MOST_SHARE = 4096, 0.1
"""A tenth of the events is not beyond so many columns or rows."""

_CAUSES = "causes"

_WRITTEN = {"t_us": "t", "x": "x", "y": "y", "p": "p"}
"""Fields of the events by the names of the arrays."""


def open_npz(path: Path, facts: Facts) -> EventFile:
    """Open a NumPy archive.

    Raises
    ------
    DataError
        Not such an archive, a column is missing, or columns differ in length; from `parts`: they
        hold no whole numbers.
    """
    with numpy_archive(path) as archive:
        headers = _headers(archive)
        held = {
            name: _read(archive, name)
            for name in ("adv2e", *SIZE_NAMES)
            if name in headers and headers[name].shape in ((), (2,), (3,))
        }
        if "adv2e" in held:
            facts.describe(str(held["adv2e"]), f"{path}: adv2e", "the file")
        facts.state_by_names(held, "the file")
        table, names, count = _table(path, headers)
    rows = partial(_parts_of, path, table, names, count)
    first = next(rows(), None)
    if first is not None and _is_fine(headers, names, first[1:3]):
        facts.tell("coordinates are in 1/32 of a pixel, as in BS-ERGB: rounded to pixels")
        facts.time_unit = facts.time_unit or "us"
        return _file("npz", facts, names, count, lambda: map(_rounded, rows()), _rounded(first))
    return _file("npz", facts, names, count, rows, first)


def open_npy(path: Path, facts: Facts) -> EventFile:
    """Open a structured array of events; errors as :func:`open_npz`."""

    def rows() -> Iterator[tuple[NDArray[Any], ...]]:
        with path.open("rb") as file:
            read_header(file, path.stat().st_size, str(path))
            yield from _rows({"": (file, header.dtype)}, "", names, count, str(path))

    with path.open("rb") as file:
        header = read_header(file, path.stat().st_size, str(path))
    if header.dtype.names is None:
        raise DataError(
            f"{path}: numbers of shape {header.shape} without names, which may be frames; events"
            " need the named fields t, x, y and p"
        )
    names = find_columns(header.dtype.names, str(path))
    if len(header.shape) != 1:
        raise DataError(f"{path}: events must be in one dimension, not of shape {header.shape}")
    count = header.shape[0]
    return _file("npy", facts, names, count, rows, next(rows(), None))


def _file(
    layout: str,
    facts: Facts,
    names: tuple[str, ...],
    count: int,
    rows: Callable[[], Iterator[tuple[NDArray[Any], ...]]],
    first: tuple[NDArray[Any], ...] | None,
) -> EventFile:
    """Return the events of `rows`, of which `first` tell the unit of the times."""
    path, time = facts.path, names[0]
    facts.time_unit, facts.stated_unit = facts.time_unit or stated_unit(time), None
    t, x, y = (np.empty(0, np.int64),) * 3 if first is None else first[:3]
    if t.dtype.kind not in "iuf":
        raise DataError(f"{path}: {time} must hold numbers, not {t.dtype}")
    whole = t.dtype.kind != "f"
    unit = facts.unit_of_events(t, x, y, facts.geometry, whole=whole)

    def parts() -> Iterator[Columns]:
        done = 0
        for t, x, y, p in rows():
            yield t, x, y, p
            done += t.size
            facts.progress(done, count)

    return EventFile(layout, facts, parts, unit_ns=unit.ns, times=time)


def _headers(archive: zipfile.ZipFile) -> dict[str, Header]:
    headers = {}
    for member in archive.infolist():
        if member.filename.endswith(".npy"):
            name = member.filename[:-4]
            with open_member(archive, member) as file:
                headers[name] = read_header(file, member.file_size, f"{archive.filename}: {name}")
    return headers


def _read(archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    with open_member(archive, f"{name}.npy") as file:
        size = archive.getinfo(f"{name}.npy").file_size
        return read_array(file, size, f"{archive.filename}: {name}")


def _table(path: Path, headers: Mapping[str, Header]) -> tuple[str, tuple[str, ...], int]:
    """Return the name of the structured array or "", the names of its columns, and their length."""
    structured = [name for name, header in headers.items() if header.dtype.names is not None]
    table = structured[0] if len(structured) == 1 else ""
    names = find_columns((headers[table].dtype.names or ()) if table else headers, str(path))
    shapes = {headers[name].shape for name in ([table] if table else names)}
    if len(shapes) != 1 or len(next(iter(shapes))) != 1:
        raise DataError(f"{path}: columns must be of one length, got {sorted(shapes)}")
    return table, names, next(iter(shapes))[0]


def _parts_of(
    path: Path, table: str, names: tuple[str, ...], count: int
) -> Iterator[tuple[NDArray[Any], ...]]:
    """Yield the columns, as :func:`_rows`."""
    with numpy_archive(path) as archive, ExitStack() as stack:
        streams = {}
        for name in [table] if table else names:
            file = stack.enter_context(open_member(archive, f"{name}.npy"))
            size = archive.getinfo(f"{name}.npy").file_size
            streams[name] = file, read_header(file, size, f"{archive.filename}: {name}").dtype
        yield from _rows(streams, table or None, names, count, str(path))


def _rows(
    streams: Mapping[str, tuple[IO[bytes], np.dtype[Any]]],
    table: str | None,
    names: tuple[str, ...],
    count: int,
    label: str,
) -> Iterator[tuple[NDArray[Any], ...]]:
    """Yield the columns, times as they are and the others as whole numbers."""
    for begin in range(0, count, _PART):
        held = {
            name: _take(file, dtype, min(_PART, count - begin), f"{label}: {name}".rstrip(": "))
            for name, (file, dtype) in streams.items()
        }
        t, *others = (held[name] if table is None else held[table][name] for name in names)
        yield t, *(_whole(label, *pair) for pair in zip(names[1:], others, strict=True))


def _is_fine(
    headers: Mapping[str, Header], names: tuple[str, ...], where: tuple[NDArray[Any], ...]
) -> bool:
    """Tell whether coordinates are in 1/32 of a pixel: 16 bits, and most beyond any sensor."""
    known = all(name in headers and headers[name].dtype.itemsize == 2 for name in names[1:3])
    if names != _FINE or not known:
        return False
    return any(np.mean(_signed(column) > _MOST_PIXELS) > _MOST_SHARE for column in where)


def _signed(column: NDArray[Any]) -> NDArray[Any]:
    """Return numbers that were stored without their sign, in 16 bits."""
    return column.astype(np.uint16).view(np.int16)


def _rounded(part: tuple[NDArray[Any], ...]) -> tuple[NDArray[Any], ...]:
    t, x, y, p = part
    return t, *(np.rint(_signed(column) / 32).astype(np.int64) for column in (x, y)), p


def _take(file: IO[bytes], dtype: np.dtype[Any], count: int, label: str) -> NDArray[Any]:
    data = file.read(count * dtype.itemsize)
    if len(data) < count * dtype.itemsize:
        raise DataError(f"{label}: cut short while it was read")
    return np.frombuffer(data, dtype)


def _whole(label: str, name: str, column: NDArray[Any]) -> NDArray[np.int64]:
    if column.dtype.kind not in "biuf":
        raise DataError(f"{label}: {name} must hold numbers, not {column.dtype}")
    if column.dtype.kind == "f" and not np.array_equal(np.floor(column), column):
        raise DataError(f"{label}: {name} must hold whole numbers")
    # beyond any sensor, and within 64 bits whatever the type
    whole: NDArray[np.int64] = np.clip(column, -_BEYOND, _BEYOND).astype(np.int64)
    return whole


def causes_of(path: Path) -> Callable[[], NDArray[Any]] | None:
    """Return a function that reads the causes of the events, None if the archive has none."""
    with numpy_archive(path) as archive:
        there = f"{_CAUSES}.npy" in archive.namelist()
    return partial(_read_causes, path) if there else None


def _read_causes(path: Path) -> NDArray[Any]:
    with numpy_archive(path) as archive:
        causes = _read(archive, _CAUSES)
    if causes.ndim != 1:
        raise DataError(f"{path}: {_CAUSES} must be a column, not of shape {causes.shape}")
    return causes


class NpzWriter(Writer):
    """Writes a NumPy archive, compressed; its bytes follow from its content.

    How many events there are stands before each column, so the columns wait on disk until then.
    """

    def __init__(self, request: Request, stack: ExitStack, path: Path) -> None:
        self._request = request
        self._archive = stack.enter_context(
            zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=_LEVEL)
        )
        self._written = _WRITTEN | ({_CAUSES: "cause"} if request.causes else {})
        # nameless: they are gone whatever becomes of the process
        self._columns = {
            name: stack.enter_context(tempfile.TemporaryFile(dir=path.parent))  # noqa: SIM115
            for name in self._written
        }
        self._count = 0

    def write_events(self, events: Events) -> None:
        """Append events."""
        self._count += events.size
        for name, field in self._written.items():
            self._columns[name].write(np.ascontiguousarray(events[field]).data)

    def finish(self) -> None:
        """Write the archive."""
        for name, field in self._written.items():
            file = self._columns[name]
            file.seek(0)
            self._add(name, CAUSED_DTYPE[field], (self._count,), file)
        for name, value in (
            ("width", np.array(self._request.width, np.int64)),
            ("height", np.array(self._request.height, np.int64)),
            ("adv2e", np.array(to_json(self._request.description))),
        ):
            self._add(name, value.dtype, value.shape, io.BytesIO(value.tobytes()))

    def _add(
        self, name: str, dtype: np.dtype[Any], shape: tuple[int, ...], data: IO[bytes]
    ) -> None:
        info = zipfile.ZipInfo(f"{name}.npy")
        info.compress_type = zipfile.ZIP_DEFLATED
        info.external_attr = 0o644 << 16
        with self._archive.open(info, "w", force_zip64=True) as member:
            header = {"descr": npy.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
            npy.write_array_header_1_0(member, header)
            shutil.copyfileobj(data, member, _BLOCK)

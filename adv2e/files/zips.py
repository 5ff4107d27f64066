"""Zip archives and ``.npy`` headers: damaged, encrypted, or made to fill the memory."""

from __future__ import annotations

import ast
import copy
import lzma
import math
import re
import stat
import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.files.regular import check_expansion, reading
from adv2e.process.machine import machine_complaint

_UNREADABLE = (
    *(zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, struct.error, OSError),
    *(NotImplementedError, RuntimeError, UnicodeDecodeError),
)
"""Exceptions for an archive that is damaged, encrypted or compressed in an unknown way."""


@contextmanager
def unpacking(trouble: str) -> Iterator[None]:
    """Turn exceptions of an archive in the body into a DataError: `trouble`, and the reason."""
    try:
        yield
    except _UNREADABLE as error:
        if machine_complaint(error):
            raise
        raise DataError(f"{trouble}, or damaged: {error}") from error


@contextmanager
def numpy_archive(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open an ``.npz``; any fault of it, when it is opened or read, is a DataError."""
    trouble = f"{path}: not a NumPy archive that can be read"
    with unpacking(trouble), zipfile.ZipFile(path) as archive:
        yield archive


def open_member(archive: zipfile.ZipFile, member: str | zipfile.ZipInfo) -> IO[bytes]:
    """Return a member as a file; DataError if it states far more bytes than it holds."""
    info = archive.getinfo(member) if isinstance(member, str) else member
    assert archive.fp is not None
    # no more than the archive itself, which is where its list of members ends
    held = min(info.compress_size, archive.start_dir)
    check_expansion(info.file_size, held, f"{archive.filename}: {info.filename}")
    return archive.open(info)


def _check_member(info: zipfile.ZipInfo, path: Path) -> None:
    """Refuse a member that would lie outside the folder into which its archive is unpacked."""
    parts = info.filename.replace("\\", "/").split("/")
    wrong = ""
    if ".." in parts:
        wrong = "leads out of the archive by '..'"
    elif not parts[0] or re.fullmatch("[A-Za-z]:", parts[0]):
        wrong = "is absolute"
    elif stat.S_ISLNK(info.external_attr >> 16):
        wrong = "is a link"
    if wrong:
        raise DataError(
            f"{path}: its member {info.filename!r} {wrong}, must be a file below its root"
        )


class Members:
    """The files of a recording by their names in it, in a folder or a zip.

    A zip holds them at its root or in one folder, and stays open as long as they may be read.

    Raises
    ------
    DataError
        `path` is neither a folder nor a zip that can be read, or a zip whose members lie outside.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._archive: zipfile.ZipFile | None = None
        self._names: set[str] = set()
        self._top = ""
        if not path.is_dir():
            with unpacking(f"{path}: not a zip archive that can be read"):
                self._archive = zipfile.ZipFile(path)
            for info in self._archive.infolist():
                _check_member(info, path)
            self._names = set(self._archive.namelist())

    def archived(self) -> list[str]:
        """Return the names of all files of a zip, in no order; none of what a Mac adds to them."""
        return [n for n in self._names if not n.endswith("/") and not n.startswith("__MACOSX/")]

    def below(self, folder: str) -> Members:
        """Return the files of a zip with their names below one of its folders ('' or 'a/b/')."""
        files = copy.copy(self)
        files._top = folder
        return files

    def enter(self, pattern: str) -> list[str]:
        """Return the files whose name matches; if there is one, the others are beside it."""
        if self._archive is None:
            return [file.name for file in self.path.glob(pattern) if file.is_file()]
        # of many names, no more than the end is looked at
        found = [
            (top + slash, name)
            for top, slash, name in (path.rpartition("/") for path in sorted(self._names))
            if fnmatchcase(name, pattern) and "/" not in top and top != "__MACOSX"
        ]
        if len(found) == 1:
            self._top = found[0][0]
        return [name for _, name in found]

    def names(self, folder: str) -> list[str]:
        """Return the names of what is in a folder, '' for all; none where there is no such."""
        if self._archive is None:
            place = self.path / folder
            return sorted(one.name for one in place.iterdir()) if place.is_dir() else []
        top = f"{self._top}{folder}/" if folder else self._top
        rests = (name[len(top) :] for name in self.archived() if name.startswith(top))
        return sorted({rest.partition("/")[0] for rest in rests})

    def has(self, name: str) -> bool:
        """Tell whether there is a file of that name, with the folders in which it is."""
        return self._top + name in self._names or (
            self._archive is None and (self.path / name).is_file()
        )

    def label(self, name: str) -> str:
        return str(self.path / name) if self._archive is None else f"{self.path}: {self._top}{name}"

    def size(self, name: str) -> int:
        """Return the size of a file as the folder or the archive states it [bytes]."""
        if self._archive is None:
            return (self.path / name).stat().st_size
        return self._archive.getinfo(self._top + name).file_size

    @contextmanager
    def open(self, name: str) -> Iterator[IO[bytes]]:
        """Open a file; any fault of it, when it is opened or read, is a DataError."""
        if self._archive is None:
            with (self.path / name).open("rb") as file:
                yield file
            return
        trouble = f"{self.label(name)}: cannot be read from the zip archive"
        with unpacking(trouble), open_member(self._archive, self._top + name) as file:
            yield file

    def read(self, name: str) -> bytes:
        """Return the bytes of a file; DataError if it cannot be read."""
        with reading(self.label(name)), self.open(name) as file:
            return file.read()


# ---- Arrays in the ``.npy`` format, of which no more is believed than is there.
#
# NumPy's own reader allocates what the header states before it looks for it, maps files into
# memory, where one that is cut short meanwhile ends the program, and warns of headers of Python 2.
#
# References
# ----------
# .. [1] NumPy, "NPY format", numpy.lib.format, https://numpy.org/neps/nep-0001-npy-format.html.


_LONGEST = 10_000
"""Bytes of the longest header that is read, as for NumPy: longer ones take long to parse."""


@dataclass(frozen=True)
class Header:
    """Header of a ``.npy`` file: data type, shape, order, and start of the data.

    Attributes
    ----------
    fortran : bool
        The first index runs fastest.
    begin : int
        Offset of the first number [bytes].
    """

    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    fortran: bool
    begin: int

    @property
    def nbytes(self) -> int:
        return math.prod(self.shape) * self.dtype.itemsize


def read_header(file: IO[bytes], available: int, label: str) -> Header:
    """Return the header at the beginning of a binary file, which then stands behind it.

    Parameters
    ----------
    available : int
        Bytes in it, header included.
    label : str
        Its name, for messages.

    Raises
    ------
    DataError
        No such array, one of Python objects, or one of which a part is missing.
    """
    try:
        shape, fortran, dtype = _stated(file)
    except (
        *(ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError),
        *(SyntaxError, RecursionError, MemoryError, struct.error),
    ) as error:
        raise DataError(f"{label}: not a .npy array that can be read") from error
    header = Header(dtype, shape, fortran, file.tell())
    if header.dtype.hasobject:
        raise DataError(f"{label}: an array of Python objects, must be one of numbers")
    if header.begin + header.nbytes > available:
        raise DataError(
            f"{label}: cut short: it holds {max(0, available - header.begin):,} bytes of an array"
            f" of {header.nbytes:,}"
        )
    return header


def _stated(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Return shape, order and data type; ValueError and others if they are not stated rightly."""
    version = npy.read_magic(file)
    length = struct.Struct({1: "<H", 2: "<I", 3: "<I"}[version[0]])
    (size,) = length.unpack(file.read(length.size))
    if version[1] or size > _LONGEST:
        raise ValueError
    text = file.read(size).decode("utf-8" if version[0] == 3 else "latin-1")
    # Python 2 wrote an L behind long numbers
    stated = ast.literal_eval(re.sub(r"(?<=[0-9])L(?=\s*[,)])", "", text).strip())
    if set(stated) != {"descr", "fortran_order", "shape"}:
        raise ValueError
    shape, fortran = stated["shape"], stated["fortran_order"]
    dtype = npy.descr_to_dtype(stated["descr"])
    if dtype.itemsize == 0 or not all(type(n) is int and n >= 0 for n in shape):
        raise ValueError
    if type(shape) is not tuple or type(fortran) is not bool:
        raise ValueError
    return shape, fortran, dtype


def read_array(file: IO[bytes], available: int, label: str) -> NDArray[Any]:
    """Return the array in a binary file; see :func:`read_header`."""
    header = read_header(file, available, label)
    data = file.read(header.nbytes)
    if len(data) < header.nbytes:
        raise DataError(f"{label}: cut short while it was read")
    array = np.frombuffer(data, header.dtype, math.prod(header.shape))
    return array.reshape(header.shape, order="F" if header.fortran else "C")

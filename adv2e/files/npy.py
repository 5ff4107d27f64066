"""Arrays in the ``.npy`` format, of which no more is believed than is there.

NumPy's own reader allocates what the header states before it looks for it, maps files into memory,
where one that is cut short meanwhile ends the program, and warns of headers of Python 2.

References
----------
.. [1] NumPy, "NPY format", numpy.lib.format, https://numpy.org/neps/nep-0001-npy-format.html.
"""

from __future__ import annotations

import ast
import math
import re
import struct
from dataclasses import dataclass
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from adv2e.errors import DataError

_LONGEST = 10_000
"""Bytes of the longest header that is read, as for NumPy: longer ones take long to parse."""


@dataclass(frozen=True)
class Header:
    """Header of a ``.npy`` file: data type, shape, order, and start of the data.

    Attributes
    ----------
    dtype : numpy.dtype
    shape : tuple of int
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
        """Bytes of the numbers."""
        return math.prod(self.shape) * self.dtype.itemsize


def read_header(file: IO[bytes], available: int, label: str) -> Header:
    """Return the header at the beginning of a binary file, which then stands behind it.

    Parameters
    ----------
    file : binary file
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

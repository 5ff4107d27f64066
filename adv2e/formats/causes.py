"""Causes of events in files: as a column, and beside formats that have none.

======================== =========================================================================
/events/causes           of HDF5: uint8; its attribute names has the names of the numbers from 0 on,
                         with commas between
causes.npy               in a NumPy archive: uint8
cause                    of CSV: the last column
<path>.causes.txt        beside other formats: a digit on each line, in the order of the events
======================== =========================================================================

:mod:`adv2e.causes` says what each number means.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.causes import CAUSES
from adv2e.errors import DataError
from adv2e.files.regular import beside as beside_of

_DIGITS, _END = ord("0"), ord("\n")

DATASET = "events/causes"

NAMES = ",".join(CAUSES)
"""The names in the order of the numbers, as files state them."""


def beside(path: Path) -> Path:
    """Return the path of the causes of the events in `path`."""
    return beside_of(path, ".causes.txt")


def lines_of(causes: NDArray[np.uint8]) -> bytes:
    """Return the lines for some events."""
    lines = np.full((causes.size, 2), _END, np.uint8)
    lines[:, 0] = causes + _DIGITS
    return lines.tobytes()


def check_numbers(causes: NDArray[Any], label: str) -> None:
    """Raise DataError for numbers that are no causes."""
    most = len(CAUSES) - 1
    if causes.dtype.kind not in "iu" or np.any((causes < 0) | (causes > most)):
        raise DataError(f"{label}: must be whole numbers from 0 to {most}")


def in_hdf5(path: Path) -> Callable[[], NDArray[Any]] | None:
    """Return a function that reads the causes in an HDF5 file, None if it has none."""
    from adv2e.formats import hdf5  # noqa: PLC0415 - h5py takes its time

    with hdf5.opened(path) as file:
        found = hdf5.find(file, DATASET)
    return None if found is None else partial(hdf5.read_column, path, DATASET)


def found_beside(path: Path) -> Callable[[], NDArray[Any]] | None:
    """Return a function that reads the causes beside the events in `path`, None without any."""
    return partial(read_beside, beside(path)) if beside(path).is_file() else None


def read_beside(path: Path) -> NDArray[np.uint8]:
    """Return the causes in a file beside the events, (n,) uint8.

    Raises
    ------
    DataError
        It has another form.
    """
    data = np.frombuffer(path.read_bytes(), np.uint8)
    if data.size % 2 or np.any(data[1::2] != _END):
        raise DataError(f"{path}: must hold a digit on each line")
    causes: NDArray[np.uint8] = data[::2] - np.uint8(_DIGITS)
    return causes

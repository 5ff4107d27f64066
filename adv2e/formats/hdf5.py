"""HDF5 files of which only what is in them is read.

An HDF5 file can hold links and datasets that stand for other files, any file of the system among
them, or for themselves.  Every name is therefore walked link by link, and a dataset is read only if
its numbers lie in the file.

References
----------
.. [1] The HDF Group, "HDF5 File Format Specification Version 3.0": link message, data layout
   message (virtual storage), external data files message.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5d
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.files.expansion import check_expansion
from adv2e.process.machine import machine_complaint

_LINKS = 16
"""Soft links on the way to one name, as in the library itself."""

_FAILURES = (OSError, RuntimeError, KeyError, ValueError, TypeError, OverflowError)
"""What h5py raises for files that are damaged."""


@contextmanager
def opened(path: Path) -> Iterator[h5py.File]:
    """Open a file for reading; whatever the library finds wrong with it is a DataError."""
    try:
        with h5py.File(path, "r") as file:
            yield file
    except DataError:
        raise
    except _FAILURES as error:
        if machine_complaint(error):
            raise
        why = str(error).partition("(")[2].rstrip(")") or str(error)
        raise DataError(f"{path}: not an HDF5 file that can be read, or damaged: {why}") from error


def find(file: h5py.File, name: str) -> h5py.Group | h5py.Dataset | None:
    """Return the object of a name, with slashes, in the file itself; None if there is none.

    Raises
    ------
    DataError
        A link on the way leads out of the file, to nothing, or in circles; or the name is that of a
        dataset whose numbers are not in the file.
    """
    label = f"{file.filename}: {name}"
    here: Any = file["/"]
    parts = name.split("/")
    followed = 0
    while parts:
        part, *parts = parts
        if part in ("", "."):
            continue
        link = here.get(part, getlink=True) if isinstance(here, h5py.Group) else None
        if isinstance(link, h5py.HardLink):
            here = here[part]
        elif isinstance(link, h5py.SoftLink):
            followed += 1
            if followed > _LINKS:
                raise DataError(f"{label}: is a link that leads to itself")
            if link.path.startswith("/"):
                here = file["/"]
            parts = link.path.split("/") + parts
        elif link is not None:
            raise DataError(f"{label}: is a link to another file, which is not followed")
        elif followed:
            raise DataError(f"{label}: is a link to nothing")
        else:
            return None
    if isinstance(here, h5py.Dataset):
        _check_own(here, label)
    return here if isinstance(here, (h5py.Group, h5py.Dataset)) else None


def dataset(file: h5py.File, name: str) -> h5py.Dataset:
    """Return the dataset of a name; DataError as :func:`find`, or if it is none."""
    found = find(file, name)
    if not isinstance(found, h5py.Dataset):
        raise DataError(f"{file.filename}: {name} is no dataset")
    return found


def read_all(column: h5py.Dataset, label: str) -> NDArray[Any]:
    """Return all that a dataset holds; DataError if it states far more than that."""
    check_stored([column], label)
    return np.asarray(column[()])


def check_stored(columns: list[h5py.Dataset], label: str) -> None:
    """Raise DataError if datasets together state far more than the file holds of them."""
    stated = sum(math.prod(column.shape or ()) * column.dtype.itemsize for column in columns)
    check_expansion(stated, sum(column.id.get_storage_size() for column in columns), label)


def _check_own(found: h5py.Dataset, label: str) -> None:
    """Refuse a dataset whose numbers are elsewhere, or that has none."""
    made = found.id.get_create_plist()
    if made.get_layout() == h5d.VIRTUAL:
        raise DataError(f"{label}: is a virtual dataset, made of others, which are not followed")
    if made.get_external_count():
        raise DataError(f"{label}: keeps its numbers in another file, which is not read")
    if found.shape is None:
        raise DataError(f"{label}: is an empty dataset")

"""Event files of several formats, read into one kind of recording."""

from __future__ import annotations

from pathlib import Path

from adv2e.errors import DataError
from adv2e.recordings.base import Recording

__all__ = ["Recording", "read_recording"]

_SUFFIXES = (".txt", ".zip", ".h5", ".hdf5", ".npz")


def read_recording(path: str | Path) -> Recording:
    """Read an event file, or a folder in the DAVIS240C layout.

    Parameters
    ----------
    path : str or Path
        The suffix tells the format: .txt, .zip (DAVIS240C, or a single text file), .h5 or .hdf5
        (layout ``monash``), .npz.

    Returns
    -------
    Recording
        Its `problems` tell what is doubtful.

    Raises
    ------
    DataError
        No such file, an unknown format, or content that cannot be read; the text names the file,
        and the line where there are lines.
    """
    path = Path(path)
    try:
        return _read(path)
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror or error}") from error


def _read(path: Path) -> Recording:
    suffix = path.suffix.lower()
    if path.is_dir() or suffix == ".zip":
        from adv2e.recordings import davis240c  # noqa: PLC0415

        _check_there(path)
        return davis240c.read_folder(path) if path.is_dir() else davis240c.read_zip(path)
    _check_there(path)
    if suffix == ".txt":
        from adv2e.recordings.text import read_text  # noqa: PLC0415

        return read_text(path)
    if suffix in (".h5", ".hdf5"):
        return _read_hdf5(path)
    if suffix == ".npz":
        from adv2e.recordings.npz import read_npz  # noqa: PLC0415

        return read_npz(path)
    raise DataError(
        f"{path}: unknown suffix '{suffix}', must be one of {', '.join(_SUFFIXES)}"
        " or a DAVIS240C folder"
    )


def _check_there(path: Path) -> None:
    if not path.exists():
        raise DataError(f"{path}: no such file or folder")


def _read_hdf5(path: Path) -> Recording:
    import h5py  # noqa: PLC0415

    from adv2e.recordings import monash  # noqa: PLC0415

    if not h5py.is_hdf5(path):
        raise DataError(f"{path}: not an HDF5 file")
    with h5py.File(path, "r") as file:
        if all(isinstance(file.get(name), h5py.Dataset) for name in monash.COLUMNS):
            return monash.read_monash(path, file)
    raise DataError(
        f"{path}: unknown HDF5 layout, must be monash (datasets {', '.join(monash.COLUMNS)})"
    )

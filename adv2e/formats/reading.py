"""Event files of several formats, read into one kind of recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from adv2e.errors import DataError
from adv2e.files.regular import check_ends
from adv2e.formats.builder import Progress, RecordingBuilder
from adv2e.formats.recording import Recording
from adv2e.process.machine import machine_complaint
from adv2e.sources import VIDEO_SUFFIXES

__all__ = ["Recording", "read_events"]

MOST_PIXELS = 1 << 25
"""Pixels of the largest sensor: 8192x4096."""

_SUFFIXES = (".txt", ".zip", ".h5", ".hdf5", ".npz")


def read_events(
    path: str | Path, *, time_unit: str | None = None, progress: Progress | None = None
) -> Recording:
    r"""Read an event file, or a folder in the DAVIS240C layout.

    Parameters
    ----------
    path : str or Path
        The suffix tells the format: .txt, .zip (DAVIS240C, or a single text file), .h5 or .hdf5
        (layout ``monash``), .npz.
    time_unit : {'s', 'ms', 'us', 'ns'}, optional
        Unit of the times; default: see :mod:`adv2e.formats.units`.
    progress : callable, optional
        Is called now and then with two numbers: how much was read, and of how much.

    Returns
    -------
    Recording
        Its `problems` tell what is doubtful.

    Raises
    ------
    DataError
        No such file, an unknown format, or content that cannot be read; the text names the file,
        and the line where there are lines.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from adv2e import read_events
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "events.txt")
    ...     _ = path.write_text("0.000001 3 2 1\n0.000250 0 0 0\n")
    ...     recording = read_events(path)
    >>> recording.events["t"].tolist(), recording.events["p"].tolist()
    ([1, 250], [1, 0])
    >>> recording.width, recording.height, recording.frame_times_ns is None
    (4, 3, True)
    """
    path = Path(path)
    try:
        check_ends(path)
        if not path.exists():
            raise DataError(f"{path}: no such file or folder")
        recording = _read(path, RecordingBuilder(path, time_unit, progress))
    except OSError as error:
        if machine_complaint(error):
            raise
        raise DataError(f"{path}: cannot be read: {error.strerror or error}") from error
    _check_size(recording)
    return recording


def _check_size(recording: Recording) -> None:
    """Refuse sensors too large to make a picture of, as one stray coordinate makes them."""
    width, height, events = recording.width, recording.height, recording.events
    if width * height <= MOST_PIXELS:
        return
    why = "is stated"
    if events.size and (int(events["x"].max()) + 1, int(events["y"].max()) + 1) == (width, height):
        far = events[int(np.argmax(np.maximum(events["x"], events["y"])))]
        why = (
            f"the event at {far['t'] / 1e6:.6f} s, x {far['x']}, y {far['y']} needs; if it is"
            " wrong, state the size, and what lies outside is left out"
        )
    raise DataError(
        f"{recording.path}: a sensor of {width}x{height} pixels, over {MOST_PIXELS:,}, {why}"
    )


def _read(path: Path, builder: RecordingBuilder) -> Recording:
    """Read a file or folder by what is imported late, as each needs other libraries."""
    suffix = path.suffix.lower()
    if path.is_dir() or suffix == ".zip":
        from adv2e.formats.davis240c.reader import read_davis240c  # noqa: PLC0415

        return read_davis240c(path, builder)
    if suffix == ".txt":
        from adv2e.formats.text.reader import read_text  # noqa: PLC0415

        return read_text(path, builder)
    if suffix in (".h5", ".hdf5"):
        from adv2e.formats.monash.reader import read_hdf5  # noqa: PLC0415

        return read_hdf5(path, builder)
    if suffix == ".npz":
        from adv2e.formats.npz import read_npz  # noqa: PLC0415

        return read_npz(path, builder)
    if suffix in VIDEO_SUFFIXES:
        raise DataError(f"{path}: is a video and holds no events; make some: adv2e convert {path}")
    raise DataError(
        f"{path}: unknown suffix '{suffix}', must be one of {', '.join(_SUFFIXES)}"
        " or a DAVIS240C folder"
    )

"""A training set for E2VID and its relatives, as event_cnn_minimal reads it.

============================ ======================================================================
sequences/NAME.h5            events and images, layout ``monash``; images grey, 8 bits
train.txt, valid.txt         a line for each sequence: where it lies
============================ ======================================================================

Of several recordings, some are for validation as a whole; of one alone, its last part is.

References
----------
.. [1] T. Stoffregen et al., "Reducing the sim-to-real gap for event cameras", ECCV 2020,
   arXiv:2003.09078; github.com/TimoStoff/event_cnn_minimal.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.conversion.transfer import copied_metadata, stored_picture
from adv2e.errors import DataError
from adv2e.events import Events, cut
from adv2e.exporting.sequence import Sequence
from adv2e.formats.reading import events_in_order, shots_of
from adv2e.formats.writing import open_sink

USUAL_FRAMES = 42
"""Fewer images than this give no item to a loader of 40 intervals, as its configuration has it."""

_LUMA = np.array([0.299, 0.587, 0.114])
"""Weights of red, green and blue in grey (ITU-R BT.601), as image libraries have them."""


def grey(picture: NDArray[Any]) -> NDArray[Any]:
    """Return a picture in grey, (rows, columns)."""
    if picture.ndim == 2:
        return picture
    shades: NDArray[Any] = np.rint(picture @ _LUMA).astype(picture.dtype)
    return shades


def write_training_set(
    sequences: list[Sequence], folder: Path, final: Path, valid_share: float, threads: int | None
) -> tuple[list[str], list[str]]:
    """Write sequences and lists.

    Parameters
    ----------
    sequences : list of Sequence
    folder, final : Path
        Where it is written, and where it will lie, which the lists name.
    valid_share : float
        Share of the sequences, or of the images of the only one, that is for validation.
    threads : int, optional
        Threads that compress.

    Returns
    -------
    list of str, list of str
        Names of the sequences for training, and for validation.

    Raises
    ------
    DataError
        A recording holds no images, or too few to be divided.
    """
    (folder / "sequences").mkdir()
    train: list[str] = []
    valid: list[str] = []
    if len(sequences) == 1 and valid_share:
        (only,) = sequences
        times = only.image_times_us
        first = len(times) - max(2, math.ceil(valid_share * len(times)))
        if first < 1:
            raise DataError(
                f"{only.file.facts.path}: {len(times)} images are too few to be divided; give more"
                " recordings, or --valid 0"
            )
        # the image between both ends one part and begins the other
        pieces = ("train", None, times[first]), ("valid", times[first], None)
        for part, start, stop in pieces:
            name = f"{only.name}_{part}"
            _write(only, folder / "sequences" / f"{name}.h5", start, stop, threads)
            (train if part == "train" else valid).append(name)
    else:
        held = math.ceil(valid_share * len(sequences))
        for number, sequence in enumerate(sequences):
            _write(sequence, folder / "sequences" / f"{sequence.name}.h5", None, None, threads)
            (valid if number >= len(sequences) - held else train).append(sequence.name)
    place = final.resolve() / "sequences"
    for list_name, chosen in (("train.txt", train), ("valid.txt", valid)):
        lines = "".join(f"{place / name}.h5\n" for name in chosen)
        (folder / list_name).write_text(lines, "utf-8", newline="\n")
    return train, valid


def _write(
    sequence: Sequence, path: Path, start_us: int | None, stop_us: int | None, threads: int | None
) -> None:
    """Write a sequence, or the part of it from one image to another; both images belong to it."""
    file = sequence.file
    size, _, parts = events_in_order(file)
    begin = -math.inf if start_us is None else start_us
    end = math.inf if stop_us is None else stop_us
    with open_sink(
        path,
        width=size[0],
        height=size[1],
        metadata=copied_metadata(file, {}, frames=True, keeps_all_bits=False),
        format="h5",
        with_frames=True,
        threads=threads,
    ) as sink:
        for t_ns, image in images_of(sequence, begin, end):
            sink.write_frame(t_ns, image)
        for events in parts:
            chosen = _between(events, begin, end)
            if chosen.size:
                sink.write_events(chosen)


def images_of(
    sequence: Sequence, begin_us: float = -math.inf, end_us: float = math.inf
) -> Iterator[tuple[int, NDArray[Any]]]:
    """Yield time [ns] and picture, grey and of 8 bits, of each image between two times."""
    file, times = sequence.file, sequence.image_times_us
    for t_us, shot in zip(times, shots_of(file), strict=True):
        if not begin_us <= t_us <= end_us:
            continue
        yield shot.t_ns, grey(stored_picture(shot.load(), file.facts.light, False))


def _between(events: Events, begin: float, end: float) -> Events:
    start = int(begin) if math.isfinite(begin) else int(events["t"][0])
    stop = int(end) if math.isfinite(end) else int(events["t"][-1]) + 1
    return cut(events, start, stop)

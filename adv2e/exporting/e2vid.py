"""A training set for E2VID and its relatives, as event_cnn_minimal reads it.

============================ ======================================================================
sequences/NAME.h5            events and images, layout ``monash``; images grey, 8 bits; flow, where
                             there is some: ``flow/flow%09d`` (2, rows, columns) [px/s]
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
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from adv2e.conversion.transfer import copied_metadata, stored_picture
from adv2e.errors import DataError
from adv2e.events import Events, cut
from adv2e.exporting.sequence import TRAIN, Sequence
from adv2e.exporting.targets import estimated_flow
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
    sequences: list[Sequence],
    folder: Path,
    final: Path,
    how: Mapping[str, Any],
    tell: Callable[[str], None],
) -> tuple[list[str], list[str]]:
    """Write sequences and lists.

    Parameters
    ----------
    sequences : list of Sequence
        Where folders of their names divide them, that holds.
    folder, final : Path
        Where it is written, and where it will lie, which the lists name.
    how : mapping
        ``valid``, the share of the sequences, or of the images of the only one, that is for
        validation; ``flow``; and ``threads`` that compress.
    tell : callable
        Takes lines for people.

    Returns
    -------
    list of str, list of str
        Names of the sequences for training, and for validation.

    Raises
    ------
    DataError
        A recording holds no images, or too few to be divided.
    """
    lists: dict[bool, list[str]] = {False: [], True: []}
    places = folder / "sequences"

    def write(sequence: Sequence, name: str, begin: float, end: float, is_held: bool) -> None:
        path = places / f"{name}.h5"
        path.parent.mkdir(parents=True, exist_ok=True)
        _write(sequence, path, begin, end, how["threads"])
        _write_flow(sequence, path, begin, end, how["flow"], tell)
        lists[is_held].append(name)

    share, divided = how["valid"], any(one.split for one in sequences)
    if len(sequences) == 1 and share and not divided:
        (only,) = sequences
        times = only.image_times_us
        first = len(times) - max(2, math.ceil(share * len(times)))
        if first < 1:
            raise DataError(
                f"{only.file.facts.path}: {len(times)} images are too few to be divided; give more"
                " recordings, or --valid 0"
            )
        # the image between both ends one part and begins the other
        write(only, f"{only.name}_train", -math.inf, times[first], False)
        write(only, f"{only.name}_valid", times[first], math.inf, True)
    else:
        held = math.ceil(share * len(sequences))
        for number, sequence in enumerate(sequences):
            last = number >= len(sequences) - held
            is_held = sequence.split not in (None, TRAIN) if divided else last
            write(sequence, sequence.name, -math.inf, math.inf, is_held)
    place = final.resolve() / "sequences"
    for list_name, is_held in (("train.txt", False), ("valid.txt", True)):
        lines = "".join(f"{place / name}.h5\n" for name in lists[is_held])
        (folder / list_name).write_text(lines, "utf-8", newline="\n")
    return lists[False], lists[True]


def _write(sequence: Sequence, path: Path, begin: float, end: float, threads: int | None) -> None:
    """Write a sequence, or the part of it from one image to another; both images belong to it."""
    file = sequence.file
    size, _, parts = events_in_order(file)
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


def _write_flow(
    sequence: Sequence,
    path: Path,
    begin: float,
    end: float,
    asked: str | None,
    tell: Callable[[str], None],
) -> None:
    """Add the flow of each interval to the file, at the image that ends it [px/s].

    event_cnn_minimal multiplies it by the time between the first and the last event.  The first
    image has the flow of the interval after it.
    """
    if asked == "none" or (asked is None and not sequence.targets.flow):
        return
    label, unknown, count = str(sequence.file.facts.path), 0, 0
    before: tuple[int, NDArray[Any]] | None = None
    with h5py.File(path, "r+") as file:
        group = file.create_group("flow", track_order=False)
        for number, (t_ns, image) in enumerate(images_of(sequence, begin, end)):
            t_us = (t_ns + 500) // 1000
            if before is not None:
                if asked == "estimated":
                    flow = estimated_flow(before[1], image)
                else:
                    flow = sequence.targets.flow_between(before[0], t_us, label)
                if flow.shape != (2, *image.shape):
                    raise DataError(f"{label}: flow of {flow.shape}, its images {image.shape}")
                known = np.isfinite(flow)
                unknown, count = unknown + int(np.count_nonzero(~known)), count + flow.size
                speed = np.where(known, flow, 0) / ((t_us - before[0]) / 1e6)
                for at in (number - 1, number) if number == 1 else (number,):
                    stored = file[f"images/image{at:09d}"].attrs
                    made = group.create_dataset(
                        f"flow{at:09d}", data=speed.astype(np.float32), compression="gzip"
                    )
                    made.attrs["size"] = np.array(speed.shape, np.int64)
                    made.attrs.update({name: stored[name] for name in ("timestamp", "event_idx")})
            before = t_us, image
        file.attrs["num_flow"] = np.int64(len(group))
    if unknown:
        share = 100 * unknown / count
        tell(f"{label}: {share:.1f} % of the flow is not known, and is written as 0")


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

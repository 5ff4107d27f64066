"""Pictures of events with the class of each pixel: rendered, of recordings, and of data sets.

DDD17 with the labels of Ev-SegNet comes in two layouts.  That of its authors, which ``adv2e export
--to ev-segnet`` writes, too (SPLIT is train or test; both orders of the folders are read)::

    events/SPLIT/NAME.npy     the six channels, (rows, columns, 6)
    labels/SPLIT/NAME.png     classes 0 to 5, 255 where nothing is said

And that of ESS, with the events themselves, from which the first is made (:func:`from_ess`)::

    dir0 ... dir6/events.dat.t, events.dat.xyp      int64 [ns]; int16 (x, y, p)
                  index/index_50ms.npy              of each image: time [ns], events before it
                  segmentation_masks/*_NUMBER.png   NUMBER counts images from 1
                  imgs/img_%08d.png                 ffmpeg -i video.mp4 imgs/img_%08d.png

References
----------
.. [1] I. Alonso, A. C. Murillo, "EV-SegNet: Semantic Segmentation for Event-based Cameras", CVPRW
   2019, arXiv:1811.12039; github.com/Shathe/Ev-SegNet.
.. [2] Z. Sun et al., "ESS: Learning Event-based Semantic Segmentation from Still Images", ECCV
   2022, arXiv:2203.10016; github.com/uzh-rpg/ess.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import click
import cv2
import numpy as np
from networks import torch_module
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.events import Events, cut, make_events, sort_events
from adv2e.exporting.ev_segnet import DDD17, DDD17_ROWS
from adv2e.representations.voxel_grid import event_image
from experiments.clip import Clip, Simulator
from experiments.scenes import HZ, shape_clip
from experiments.training import Update, written

IGNORED = 255
WINDOW_US = 50_000
CLASSES = "flat", "construction and sky", "object", "nature", "human", "vehicle"
"""Of DDD17, by number."""
ESS_SPLITS = {"train": (0, 2, 3, 5, 6), "valid": (1,), "test": (4,)}
"""Which of the seven folders, in the order of their names."""
_LEAD, _PIECE = 5, 200
"""Images before the first one with labels, and in a piece that is simulated at a time."""

Sample = tuple[NDArray[np.float32], NDArray[np.uint8]]
"""Channels (6, rows, columns), and the class of each pixel."""


class Samples(Protocol):
    """Pictures with labels."""

    def __len__(self) -> int:
        """Return how many there are."""

    def __getitem__(self, number: int) -> Sample:
        """Return one."""


@dataclass(frozen=True)
class Folder:
    """A split of a data set in the layout of Ev-SegNet, read when it is asked for.

    Attributes
    ----------
    pairs : list of (Path, Path)
        Channels and labels.
    size : (int, int), optional
        Columns and rows to which both are brought, by the nearest pixel.
    """

    pairs: list[tuple[Path, Path]]
    size: tuple[int, int] | None

    @classmethod
    def of(cls, folder: Path, split: str, size: tuple[int, int] | None) -> Folder:
        """Return the split in a folder."""
        ways = (("events", split, "labels", split), (split, "events", split, "labels"))
        for a, b, c, d in ways:
            events = sorted((folder / a / b).glob("*.npy"))
            if events:
                pairs = [(path, folder / c / d / f"{path.stem}.png") for path in events]
                for _, label in pairs:
                    if not label.is_file():
                        raise DataError(f"{label}: not there, but its events are")
                return cls(pairs, size)
        raise DataError(f"{folder}: no events/{split}/*.npy in it")

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.pairs)

    def __getitem__(self, number: int) -> Sample:
        """Return one."""
        path, label_path = self.pairs[number]
        picture = np.load(path, allow_pickle=False)
        if picture.ndim != 3 or picture.shape[2] < 6:
            raise DataError(f"{path}: {picture.shape}, must be (rows, columns, 6)")
        label = cv2.imread(str(label_path), cv2.IMREAD_GRAYSCALE)
        if label is None or label.shape != picture.shape[:2]:
            shape = None if label is None else label.shape
            raise DataError(f"{label_path}: {shape}, but its events are {picture.shape[:2]}")
        picture, label = (
            cv2.resize(one, self.size or one.shape[1::-1], interpolation=cv2.INTER_NEAREST_EXACT)
            for one in (picture[..., :6].astype(np.float32), label)
        )
        return np.ascontiguousarray(picture.transpose(2, 0, 1)), label


def from_ess(folder: Path, output: Path, simulator: Simulator | None, seed: int) -> dict[str, int]:
    """Write DDD17 in the layout of Ev-SegNet from that of ESS; return how many pictures of a split.

    The lower 60 of 260 rows, the car itself, are cut off.  Events are those of the 50 ms before
    each image with labels.  What was written before stays.

    Parameters
    ----------
    folder, output : Path
    simulator : Simulator, optional
        Makes the events from the images; default: the measured ones.
    seed : int
    """
    places = sorted(path for path in folder.glob("dir*") if path.is_dir())
    if len(places) != 7:
        raise DataError(f"{folder}: {len(places)} folders dir*, must be the seven of ESS")
    counts = {}
    for split, numbers in ESS_SPLITS.items():
        made = 0
        labels = output / "labels" / split
        for place in (places[number] for number in numbers):
            for name, picture, label in _pictures(place, labels, simulator, seed):
                _keep(output, split, name, picture, label)
            click.echo(f"{place.name}: done ({split})", err=True)
            made += len(list(labels.glob(f"{place.name}_*.png")))
        counts[split] = made
    return counts


def _keep(
    output: Path, split: str, name: str, picture: NDArray[np.float32], label: NDArray[np.uint8]
) -> None:
    """Write channels (rows, columns, 6) and labels in the layout of Ev-SegNet."""
    for kind in ("events", "labels"):
        (output / kind / split).mkdir(parents=True, exist_ok=True)

    def save(path: Path) -> None:
        with path.open("wb") as file:
            np.save(file, picture, allow_pickle=False)

    written(output / "events" / split / f"{name}.npy", save)
    done, data = cv2.imencode(".png", label)
    assert done
    # the label last: it says that both are there
    raw = data.tobytes()
    written(output / "labels" / split / f"{name}.png", lambda path: path.write_bytes(raw))


def write_shapes(output: Path, simulator: Simulator, clips: int, seed: int, side: int) -> None:
    """Write pictures of moving dark shapes in the layout of Ev-SegNet, 8 a clip.

    The shapes are the same for all simulators, others for each seed, and half as many are of test.
    """
    step = HZ * WINDOW_US // 10**6
    for split, first in (("train", 1000 * seed), ("test", 10**6 + 1000 * seed)):
        for number in range(first, first + (clips if split == "train" else clips // 2)):
            clip, labels = shape_clip(number, 8 * step + 1, (side, side))
            events = simulator.events(clip, number)
            for k in range(step, len(labels), step):
                end = int(clip.times_ns[k]) // 1000
                window = end - WINDOW_US, end
                picture = event_image(cut(events, *window), (side, side), window)
                _keep(output, split, f"shapes_{number:07d}_{k:04d}", picture, labels[k])


def _pictures(
    place: Path, there: Path, simulator: Simulator | None, seed: int
) -> Iterator[tuple[str, NDArray[np.float32], NDArray[np.uint8]]]:
    """Yield name, channels and labels of those images of a folder that are not `there`."""
    masks = {}
    for path in (place / "segmentation_masks").glob("*.png"):
        number = re.search(r"(\d+)$", path.stem)
        if number:
            masks[int(number[1])] = path
    if not masks:
        raise DataError(f"{place}/segmentation_masks: no masks; unzip segmentation_masks.zip")
    index = place / "index" / "index_50ms.npy"
    if not index.is_file():
        raise DataError(f"{index}: not there")
    times_ns = np.load(index)[:, 0].astype(np.int64)
    names = {number: f"{place.name}_{number:08d}" for number in masks}
    missing = sorted(k for k in masks if not (there / f"{names[k]}.png").is_file())
    for piece in pieces(missing):
        stream = _measured(place, times_ns, piece) if simulator is None else None
        if simulator is not None:
            stream = simulator.events(_clip(place, times_ns, piece), seed)
        for number in piece:
            end = int(times_ns[number - 1]) // 1000
            window = end - WINDOW_US, end
            events = cut(stream, *window)
            events = events[events["y"] < DDD17_ROWS]
            label = cv2.imread(str(masks[number]), cv2.IMREAD_GRAYSCALE)
            if label is None or label.shape[0] < DDD17_ROWS or label.shape[1] != DDD17[0]:
                raise DataError(f"{masks[number]}: must be {DDD17[0]}x{DDD17_ROWS} pixels")
            yield (
                names[number],
                event_image(events, (DDD17[0], DDD17_ROWS), window),
                label[:DDD17_ROWS],
            )


def pieces(numbers: Sequence[int]) -> Iterator[list[int]]:
    """Yield numbers in runs, each within a piece of a clip."""
    piece: list[int] = []
    for number in numbers:
        if piece and number - piece[0] > _PIECE - _LEAD:
            yield piece
            piece = []
        piece.append(number)
    if piece:
        yield piece


def _clip(place: Path, times_ns: NDArray[np.int64], piece: Sequence[int]) -> Clip:
    """Return the images from some before the first number to the last one."""
    wanted = range(max(1, piece[0] - _LEAD), piece[-1] + 1)
    images = []
    for number in wanted:
        path = place / "imgs" / f"img_{number:08d}.png"
        image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        if image is None or image.shape != DDD17[::-1]:
            raise DataError(f"{path}: not there, or not of {DDD17[0]}x{DDD17[1]} pixels")
        images.append(image)
    return Clip(np.stack(images), times_ns[wanted.start - 1 : wanted.stop - 1])


def _measured(place: Path, times_ns: NDArray[np.int64], piece: Sequence[int]) -> Events:
    """Return the measured events from 50 ms before the first number to the last one."""
    t = np.memmap(place / "events.dat.t", np.int64, "r")
    xyp = np.memmap(place / "events.dat.xyp", np.int16, "r").reshape(-1, 3)
    if len(t) != len(xyp):
        raise DataError(
            f"{place}: {len(t)} times in events.dat.t, but {len(xyp)} in events.dat.xyp"
        )
    begin = times_ns[piece[0] - 1] - 1000 * WINDOW_US - 1000
    first, last = np.searchsorted(t, (begin, times_ns[piece[-1] - 1]))
    x, y, p = xyp[first:last].T
    return sort_events(make_events(t=t[first:last] // 1000, x=x, y=y, p=p > 0))


def confusion(net: Any, samples: Samples, classes: int, device: str) -> NDArray[np.int64]:
    """Return how many pixels of each class (rows) are said to be of each (columns)."""
    torch = torch_module()
    counts = np.zeros((classes, classes), np.int64)
    with torch.inference_mode():
        for number in range(len(samples)):
            picture, label = samples[number]
            said = net(torch.from_numpy(picture)[None].to(device))[0].argmax(0).cpu().numpy()
            known = label < classes
            pairs = classes * label[known].astype(np.int64) + said[known]
            counts += np.bincount(pairs, minlength=classes**2).reshape(classes, classes)
    return counts


def scores_of(counts: NDArray[np.int64]) -> dict[str, float]:
    """Return accuracy and mIoU."""
    hit = np.diag(counts)
    union = counts.sum(0) + counts.sum(1) - hit
    shares = hit / np.maximum(union, 1)
    return {"accuracy": float(hit.sum() / max(counts.sum(), 1)), "mIoU": float(shares.mean())}


def of_one_class(samples: Samples, classes: int) -> dict[str, float]:
    """Return accuracy and mIoU of saying the most common class of all pixels."""
    counts = np.zeros(classes, np.int64)
    for number in range(len(samples)):
        label = samples[number][1]
        counts += np.bincount(label[label < classes], minlength=classes)
    said = np.zeros((classes, classes), np.int64)
    said[:, counts.argmax()] = counts
    return scores_of(said)


def last_and_best(checks: Sequence[dict[str, float]]) -> dict[str, dict[str, float]]:
    """Return the last test and the best one."""
    return {"last": checks[-1], "best": max(checks, key=lambda one: one["mIoU"])}


def update_of(samples: Samples, batch: int, device: str, changed: bool) -> Update:
    """Return one step: pictures by chance, mirrored, and `changed` as Ev-SegNet does."""
    torch = torch_module()

    def update(net: Any, optimiser: Any, rng: np.random.Generator) -> float:
        chosen = rng.integers(len(samples), size=batch)
        pairs = [augmented(samples[int(k)], rng, changed) for k in chosen]
        pictures, labels = (
            torch.from_numpy(np.stack(one)).to(device) for one in zip(*pairs, strict=True)
        )
        optimiser.zero_grad()
        loss = loss_of(net(pictures), labels)
        loss.backward()
        optimiser.step()
        return float(loss.detach())

    return update


def loss_of(scores: Any, labels: Any) -> Any:
    """Return the mean cross entropy over pixels with a class."""
    functional = torch_module().nn.functional
    return functional.cross_entropy(scores, labels.long(), ignore_index=IGNORED)


def augmented(sample: Sample, rng: np.random.Generator, changed: bool) -> Sample:
    """Return a picture with its labels, mirrored in a half of all cases.

    With `changed` it is also made 0.5 to 2 times as large, shifted by a fifth at most, and turned
    by 10 degrees at most, by the nearest pixel; what comes from outside is 0, and of no class.
    """
    picture, label = sample
    if rng.random() < 0.5:
        picture, label = picture[..., ::-1], label[:, ::-1]
    if changed:
        rows, columns = label.shape
        scale, turn = rng.uniform(0.5, 2), np.deg2rad(rng.uniform(-10, 10))
        shift = rng.uniform(-0.2, 0.2, 2) * (rows, columns)
        y, x = np.indices(label.shape) - np.reshape([rows - 1, columns - 1], (2, 1, 1)) / 2
        y, x = y - shift[0], x - shift[1]
        from_y = (np.cos(turn) * y - np.sin(turn) * x) / scale + (rows - 1) / 2
        from_x = (np.sin(turn) * y + np.cos(turn) * x) / scale + (columns - 1) / 2
        at_y, at_x = (np.rint(one).astype(int) for one in (from_y, from_x))
        inside = (at_y >= 0) & (at_y < rows) & (at_x >= 0) & (at_x < columns)
        at_y, at_x = np.clip(at_y, 0, rows - 1), np.clip(at_x, 0, columns - 1)
        picture = np.where(inside, picture[:, at_y, at_x], np.float32(0))
        label = np.where(inside, label[at_y, at_x], np.uint8(IGNORED))
    return np.ascontiguousarray(picture), np.ascontiguousarray(label)

"""Networks that make images of events: what they are trained and tested on, steps, measures."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import islice
from pathlib import Path
from typing import Any

import click
import cv2
import numpy as np
from networks import torch_module
from networks.e2vid import e2vid
from networks.firenet import BINS, NETWORKS, Images, Network, firenet, grid_of, reconstructed
from networks.image_loss import Lpips, structural_loss
from numpy.typing import NDArray

from adv2e.config.model import Sensor
from adv2e.errors import DataError
from adv2e.events import Events, cut
from adv2e.light.sensor import fitting_of
from adv2e.sources import open_source
from experiments.clip import Clip, Simulator
from experiments.recordings import Recording, decoder_of, read
from experiments.scenes import texture_clip
from experiments.training import CHECKPOINT, Update, checkpoint, written

Array = NDArray[np.float32]


@dataclass(frozen=True)
class Pair:
    """Sorted events of a clip, and some of its images.

    Images are light, 0 black and 1 white; their times [us] are on the clock of the events.
    """

    events: Events
    images: Array
    times_us: NDArray[np.int64]

    @classmethod
    def simulated(cls, clip: Clip, simulator: Simulator, seed: int, every: int) -> Pair:
        """Return the events of all frames, and one frame in `every` of them."""
        images = clip.frames[::every].astype(np.float32) / np.float32(255.0)
        return cls(simulator.events(clip, seed), images, clip.times_ns[::every] // 1000)

    def grid(self, window: int, corner: tuple[int, int], size: tuple[int, int]) -> Array:
        """Return the grid of the events between an image and the next, of a part of the picture."""
        events = cut(self.events, *(int(t) for t in self.times_us[window : window + 2]))
        x, y = events["x"].astype(np.int64) - corner[0], events["y"].astype(np.int64) - corner[1]
        inside = (x >= 0) & (x < size[0]) & (y >= 0) & (y < size[1])
        part = events[inside].copy()
        part["x"], part["y"] = x[inside], y[inside]
        return grid_of(part, size)

    def save(self, path: Path) -> None:
        """Write it as ``.npz``."""
        with path.open("wb") as file:
            np.savez(file, events=self.events, images=self.images, times_us=self.times_us)

    @classmethod
    def load(cls, path: Path) -> Pair:
        """Read it."""
        with np.load(path) as held:
            return cls(held["events"], held["images"], held["times_us"])


@dataclass(frozen=True)
class Batches:
    """Draws of a training: runs of windows, of a part of the picture, mirrored or not.

    It draws `batch` runs of `length` windows at a time, of `crop` columns and rows.
    """

    pairs: Sequence[Pair]
    batch: int
    length: int
    crop: tuple[int, int]

    def __post_init__(self) -> None:
        if not self.pairs:
            raise DataError("no sequence to train on")
        for pair in self.pairs:
            count, rows, columns = pair.images.shape
            if count <= self.length or columns < self.crop[0] or rows < self.crop[1]:
                raise DataError(
                    f"a sequence of {count} images of {columns}x{rows} pixels is too small for runs"
                    f" of {self.length} windows of {self.crop[0]}x{self.crop[1]}"
                )

    def draw(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Return grids (length, batch, bins, rows, columns), images (length, batch, 1, ...)."""
        columns, rows = self.crop
        grids = np.empty((self.length, self.batch, BINS, rows, columns), np.float32)
        images = np.empty((self.length, self.batch, 1, rows, columns), np.float32)
        for one in range(self.batch):
            pair = self.pairs[rng.integers(len(self.pairs))]
            count, height, width = pair.images.shape
            first = int(rng.integers(count - self.length))
            x, y = (int(rng.integers(most + 1)) for most in (width - columns, height - rows))
            turned = tuple(slice(None, None, -1 if rng.random() < 0.5 else 1) for _ in range(2))
            for k in range(self.length):
                grids[k, one] = pair.grid(first + k, (x, y), self.crop)[(slice(None), *turned)]
                image = pair.images[first + k + 1, y : y + rows, x : x + columns]
                images[k, one, 0] = image[turned]
        return grids, images


Sequences = Iterator[tuple[str, Callable[[], Iterator[Clip]]]]
"""Names, and what makes the clips of each when they are needed."""


def gopro_sequences(folder: Path, size: tuple[int, int], frames: int) -> Sequences:
    """Yield the sequences of ``GOPRO_Large_all``, in pieces of so many frames."""
    for sequence in gopro_folders(folder):
        yield sequence.name, partial(gopro_clips, sequence, size, frames)


def moving_textures(count: int, seed: int, size: tuple[int, int], frames: int) -> Sequences:
    """Yield clips of textures, others for each seed."""
    for number in range(1000 * seed, 1000 * seed + count):
        yield f"texture-{number:06d}", lambda k=number: iter([texture_clip(k, frames, size)])


def gopro_folders(folder: Path) -> list[Path]:
    """Return the sequences of ``GOPRO_Large_all`` that are for training."""
    inside = folder / "train"
    place = inside if inside.is_dir() else folder
    found = sorted(one for one in place.iterdir() if one.is_dir() and one.name.startswith("GOPR"))
    if not found:
        raise DataError(f"{folder}: no GOPR... in it or in its train/; give GOPRO_Large_all")
    return found


def gopro_clips(folder: Path, size: tuple[int, int], frames: int) -> Iterator[Clip]:
    """Yield pieces of a sequence of GOPRO, of so many frames each, on a sensor of a size.

    A rest of less than a piece is left out.
    """
    source = open_source(folder)
    decoder = decoder_of(source)
    sensor = Sensor(width=size[0], height=size[1], fit="crop")
    fitting = fitting_of(source.width, source.height, sensor, str(folder))

    def light(image: NDArray[Any], label: str) -> NDArray[np.float32]:
        seen = decoder.decode(image)
        return seen if fitting is None else fitting.light(seen, label)

    coming = ((one.t_ns, light(one.image, one.label)) for one in source.frames())
    while len(piece := list(islice(coming, frames))) == frames:
        times, images = zip(*piece, strict=True)
        yield Clip(np.stack(images), np.array(times, np.int64))


def kept(
    sequences: Sequences, simulator: Simulator, folder: Path, settings: dict[str, Any]
) -> Iterator[Pair]:
    """Yield events and images of all clips, which are simulated where they were not before."""
    folder.mkdir(parents=True, exist_ok=True)
    told = folder / "settings.json"
    about = {
        name: settings[name]
        for name in ("simulator", "nature", "digest", "data", "seed", "size", "every", "frames")
    }
    if told.exists() and (held := json.loads(told.read_text("utf-8"))) != about:
        raise DataError(f"{told}: events were made with {held}, not {about}; take another folder")
    written(told, lambda path: path.write_text(json.dumps(about) + "\n", "utf-8"))
    for name, clips in sequences:
        whole = folder / f"{name}.done"
        if not whole.exists():
            count = 0
            for count, clip in enumerate(clips(), 1):
                pair = Pair.simulated(clip, simulator, settings["seed"], settings["every"])
                written(folder / f"{name}-{count:03d}.npz", pair.save)
            whole.touch()
            click.echo(f"{name}: {count} pieces simulated", err=True)
        for path in sorted(folder.glob(f"{name}-*.npz")):
            yield Pair.load(path)


CUTS = {
    "boxes_6dof": (5.0, 20.0), "calibration": (5.0, 20.0), "dynamic_6dof": (5.0, 20.0),
    "office_zigzag": (5.0, 12.0), "poster_6dof": (5.0, 20.0), "shapes_6dof": (5.0, 20.0),
    "slider_depth": (1.0, 2.5),
}  # fmt: skip
"""Sequences of DAVIS240C and the part that is used [s], as EVREAL has it (config/dataset/ECD.json,
github.com/ercanburak/EVREAL)."""
GREY = "one grey"


@dataclass(frozen=True)
class Part:
    """The part of a recording that is used: its frame intervals [us]."""

    name: str
    real: Recording
    spans: Sequence[tuple[int, int]]

    @cached_property
    def frames(self) -> Images:
        """The frames at the ends of the intervals, 0 black and 1 white."""
        ends = {stop for _, stop in self.spans}
        source = self.real.source
        scale = np.float32(1 / source.full_scale)
        return np.array(
            [
                scale * np.asarray(frame.image, np.float32)
                for frame, t_us in zip(source.frames(), self.real.times_us, strict=True)
                if int(t_us) in ends
            ]
        )

    def windows(self) -> Iterator[Events]:
        """Yield the events of each interval."""
        return (cut(self.real.events, *span) for span in self.spans)


def parts(data: Path) -> Iterator[Part]:
    """Yield the sequences of DAVIS240C in a folder with their cuts, or the recording that it is."""
    there = {
        name: path for name in CUTS for path in (data / f"{name}.zip", data / name) if path.exists()
    }
    if not there:
        real = read(str(data))
        yield Part(real.name, real, real.windows.used)
    for name, path in there.items():
        real = read(str(path))
        begin, end = (round(1e6 * one) for one in CUTS[name])
        spans = [one for one in real.windows.used if begin <= one[0] and one[1] <= end]
        if not spans:
            raise DataError(f"{path}: no frame interval with events within {CUTS[name]} s")
        yield Part(name, real, spans)


def equalised(image: NDArray[Any]) -> NDArray[np.float64]:
    """Return an image whose histogram, of 256 values, is even."""
    return cv2.equalizeHist(np.rint(255 * image).astype(np.uint8)) / 255.0


def similarity(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Return the mean structural similarity of two images between 0 and 1; 1 for equal ones.

    Means, variances and covariance are under a Gaussian of 1.5 pixels (11 x 11), the constants
    0.01**2 and 0.03**2, as in doi:10.1109/TIP.2003.819861.
    """
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)

    def mean(image: NDArray[Any]) -> NDArray[Any]:
        return cv2.GaussianBlur(image, (11, 11), 1.5)

    at_a, at_b = mean(a), mean(b)
    spread = mean(a * a) - at_a**2 + mean(b * b) - at_b**2
    both = mean(a * b) - at_a * at_b
    light = (2 * at_a * at_b + 1e-4) / (at_a**2 + at_b**2 + 1e-4)
    return float(np.mean(light * (2 * both + 9e-4) / (spread + 9e-4)))


def measures_of(images: Images, frames: Images, lpips: Lpips | None) -> dict[str, float]:
    """Return the means of all measures over images and frames between 0 and 1."""
    found: dict[str, list[float]] = {}
    for image, frame in zip(images, frames, strict=True):
        for kind, a, b in (("", image, frame), ("equalised ", equalised(image), equalised(frame))):
            found.setdefault(f"{kind}MSE", []).append(float(np.mean((a - b) ** 2)))
            found.setdefault(f"{kind}SSIM", []).append(similarity(a, b))
        if lpips is not None:
            torch = torch_module()
            pair = (
                torch.from_numpy(np.ascontiguousarray(one))[None, None] for one in (image, frame)
            )
            with torch.inference_mode():
                found.setdefault("LPIPS", []).append(float(lpips(*pair)))
    return {name: float(np.mean(each)) for name, each in found.items()}


def made_of(net: Any, part: Part) -> Images:
    """Return the images that a network makes."""
    return reconstructed(net, (grid_of(events, part.real.size) for events in part.windows()))


def references(
    part: Part, weights: Path | None, lpips: Lpips | None
) -> dict[str, dict[str, float]]:
    """Return the measures of one grey, the mean of each frame, and of published networks."""
    grey = np.broadcast_to(part.frames.mean((1, 2), keepdims=True), part.frames.shape)
    found = {GREY: measures_of(grey, part.frames, lpips)}
    if weights is not None:
        for name in NETWORKS:
            images = Network(name, weights).images(part.windows(), part.real.size)
            found[f"{name}, published"] = measures_of(images, part.frames, lpips)
    return found


def picture(part: Part, rows: Sequence[Images]) -> NDArray[np.uint8]:
    """Return the last frame, and beside it the last of each of several images."""
    line = np.hstack([part.frames[-1], *(one[-1] for one in rows)])
    return np.rint(255 * np.clip(line, 0, 1)).astype(np.uint8)


BUILD = {"e2vid": e2vid, "firenet": firenet}
LOSS = "L1 + 1 - SSIM"


def update_of(batches: Batches, truncate: int, device: str, lpips: Lpips | None = None) -> Update:
    """Return one step of a training: a run of windows, the gradient cut after each `truncate`."""
    torch = torch_module()

    def loss_of(image: Any, wanted: Any) -> Any:
        return structural_loss(image, wanted) if lpips is None else lpips(image, wanted).mean()

    def update(net: Any, optimiser: Any, rng: np.random.Generator) -> float:
        grids, images = (torch.from_numpy(one).to(device) for one in batches.draw(rng))
        state, total = None, 0.0
        for begin in range(0, batches.length, truncate):
            optimiser.zero_grad()
            losses = []
            for k in range(begin, min(begin + truncate, batches.length)):
                image, state = net(grids[k], state)
                losses.append(loss_of(image, images[k]))
            loss = torch.stack(losses).mean()
            loss.backward()
            optimiser.step()
            state = detached(state)
            total += float(loss.detach()) * len(losses)
        return total / batches.length

    return update


def detached(state: Any) -> Any:
    """Return a state, nested as it is, through which no gradient flows back."""
    if isinstance(state, (list, tuple)):
        return [detached(one) for one in state]
    return state.detach()


def trained(run: Path) -> Any:
    """Return the network of a training."""
    path = run / CHECKPOINT
    if not path.is_file():
        raise DataError(f"{path}: not there; give a folder that train made")
    state, rest = checkpoint(path)
    network = rest["settings"].get("network")
    if network not in BUILD:
        raise DataError(f"{path}: network: {network!r} is none of {', '.join(BUILD)}")
    net = BUILD[network]()
    net.load_state_dict(state["net"])
    return net.eval()

"""Layouts of exports: for each kind, what is made of one recording, and where it lies."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import UsageError
from adv2e.exporting import folders, voxels
from adv2e.exporting.folders import Made, Tell
from adv2e.exporting.sequence import TEST, TRAIN, VALID, Sequence, in_class, is_held_out, split_of
from adv2e.exporting.voxels import Save, Slice, saved
from adv2e.formats.reading import events_in_order
from adv2e.light.pictures import png_of
from adv2e.options import EXPORTS, declared
from adv2e.rendering.styles import STYLES, Style
from adv2e.representations.histogram import stacked_histogram
from adv2e.representations.time_surface import TimeSurface

Size = tuple[int, int]


@dataclass(frozen=True)
class Layout:
    """Layout of an export in which each recording has a place of its own.

    Attributes
    ----------
    what : str
        What its items are, for people.
    write : callable
        Is given a recording, its place, the options, and who takes lines for people.
    place : str
        Where it lies: with ``{name}``, ``{split}``, ``{label}``, the class, and ``{own}``, its
        name in that; or ``{flat}``, its name without folders and split.
    splits : mapping
        Names of the folders of parts of the set; default: as they are called here.
    held_out : str
        Part to which those that are held out belong.
    """

    what: str
    write: Callable[[Sequence, Path, Mapping[str, Any], Tell], Made]
    place: str = "{name}"
    splits: Mapping[str, str] | None = None
    held_out: str = VALID

    @property
    def has_classes(self) -> bool:
        """True if recordings lie in folders of their classes."""
        return "{label}" in self.place

    def place_of(self, name: str, share: float) -> tuple[PurePosixPath, str, str]:
        """Return where a recording lies, its class or "", and its part of the set.

        Raises
        ------
        DataError
            It has no class, and needs one.
        """
        split = split_of(name) or (self.held_out if is_held_out(name, share) else TRAIN)
        rest = name.partition("/")[2] if split_of(name) else name
        label, own = in_class(name) if self.has_classes else (rest.rpartition("/")[0], "")
        folder = (self.splits or {}).get(split, split)
        parts = {"name": name, "flat": rest.replace("/", "_"), "label": label, "own": own}
        return PurePosixPath(self.place.format(split=folder, **parts)), label, split


def chosen_options(to: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options of a kind of export, with what those that were left out stand for."""
    how = {name: options[name] for name in declared(EXPORTS[to])}
    if "bins" in how:
        how["bins"] = how["bins"] or (5 if to == "voxel" else 10)
    name = {"rvt": "window_us", "ev-segnet": "window_us", "surface": "tau_us"}.get(to)
    if name is not None:
        how[name] = how[name] or 50_000
    return how


def windows_of(sequence: Sequence, how: Mapping[str, Any]) -> tuple[Size, Iterator[Slice]]:
    """Return the size of the sensor and the windows of a recording."""
    size, first_us, parts = events_in_order(sequence.file)
    if how["at"] == "images":
        return size, voxels.between_images(parts, sequence.image_times_us)
    if how["count"] is not None:
        return size, voxels.by_count(parts, how["count"])
    label = str(sequence.file.facts.path)
    return size, voxels.by_time(parts, first_us, how["window_us"], label, how["most_empty"])


def _voxels(how: Mapping[str, Any], size: Size) -> Save:
    names = ("bins", "normalise", "polarity", "span")
    settings = voxels.VoxelSettings(**{name: how[name] for name in names})
    return lambda path, part: saved(path, settings.grid(part, size).astype(np.float32))


def _histograms(how: Mapping[str, Any], size: Size) -> Save:
    return lambda path, part: saved(
        path, stacked_histogram(part.events, how["bins"], size, how["cutoff"])
    )


def _surfaces(how: Mapping[str, Any], size: Size) -> Save:
    surface = TimeSurface(size, how["tau_us"])
    return lambda path, part: saved(path, surface.at(part.events, part.stop_us))


def _pictures(how: Mapping[str, Any], size: Size) -> Save:
    def save(path: Path, part: Slice) -> None:
        style = Style(name=how["style"], window_us=max(1, part.stop_us - part.start_us))
        picture: NDArray[Any] = STYLES[style.name](part.events, *size, part.stop_us, style)
        path.with_name(f"{path.name}.png").write_bytes(png_of(picture))

    return save


REPRESENTATIONS = {
    "voxel": ("event_tensor_", _voxels),
    "histogram": ("histogram_", _histograms),
    "surface": ("time_surface_", _surfaces),
    "picture": ("", _pictures),
}
"""Of each window: how the names of its files begin, and what returns the function that saves it."""


def _windowed(kind: str, what: str) -> Layout:
    stem, saving = REPRESENTATIONS[kind]

    def write(sequence: Sequence, folder: Path, how: Mapping[str, Any], tell: Tell) -> Made:
        size, slices = windows_of(sequence, how)
        with voxels.WindowFiles(folder, stem, saving(how, size)) as files:
            for part in slices:
                files.add(part)
        return size, files.count

    return Layout(what, write)


LAYOUTS = {
    "voxel": _windowed("voxel", "voxel grids"),
    "histogram": _windowed("histogram", "histograms"),
    "surface": _windowed("surface", "time surfaces"),
    "picture": _windowed("picture", "pictures of events"),
    "evreal": Layout("images", folders.write_evreal, "{flat}"),
    "rvt": Layout("histograms", folders.write_rvt, "{split}/{flat}", {VALID: "val"}),
    "dsec": Layout("sequences", folders.write_dsec, "{split}/{flat}", held_out=TEST),
    "spikingjelly": Layout(
        *("samples", folders.write_spikingjelly, "events_np/{split}/{label}/{own}.npz"),
        held_out=TEST,
    ),
    "nmnist": Layout(
        *("samples", folders.write_nmnist, "{split}/{label}/{own}.bin"),
        *({TRAIN: "Train", VALID: "Valid", TEST: "Test"}, TEST),
    ),
}
"""Layouts of exports, by the kind."""


def check_kind(to: str, options: Mapping[str, Any]) -> None:
    """Raise UsageError where options are missing, or do not fit what is made."""
    if to not in EXPORTS:
        raise UsageError(f"--to: must be one of {', '.join(EXPORTS)}, got {to!r}")
    for name, option in declared(*EXPORTS.values()).items():
        if name not in declared(EXPORTS[to]) and options[name] != option.default:
            raise UsageError(f"{option.flag_of(name)} is not for --to {to}: leave it out")
    cuts = [options[name] is not None for name in ("window_us", "count", "at")]
    if to in REPRESENTATIONS and sum(cuts) != 1:
        raise UsageError(f"--to {to} needs one of --window TIME, --count N and --at images")

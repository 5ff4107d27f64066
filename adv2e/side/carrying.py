"""Side data of an input: found, read, and written beside the events, or named if that cannot be.

It lies in the input itself, in the folders that data sets have for it, in ``INPUT.side`` beside the
input, or where ``--side`` says.  Of several places for one kind, the first that is there counts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Protocol

from adv2e.errors import DataError
from adv2e.files.regular import beside, shown
from adv2e.files.zips import Members
from adv2e.formats.writing import SIDE
from adv2e.label import left_out, told_of
from adv2e.side import boxes, maps
from adv2e.side.calibration import parse_calibration
from adv2e.side.placement import Clock, Placement
from adv2e.side.tables import parse_table
from adv2e.sources.images.source import natural_key
from adv2e.sources.times.lists import decoded

_STATES = "state_groundtruth_estimate0/data.csv"
_PLACES = {
    "poses": ("groundtruth.txt", f"mav0/{_STATES}", _STATES),
    "imu": ("imu.txt", "mav0/imu0/data.csv", "imu0/data.csv"),
    "accelerometer": ("accelerometer.txt",),
    "calibration": (
        *("sensor.yaml", "mav0/cam0/sensor.yaml", "cam0/sensor.yaml", "camchain.yaml", "calib.txt"),
    ),
    "exposures": (
        *("exposures.txt", "image_exposure_timestamps.txt", "image_exposure_timestamps_left.txt"),
    ),
    "boxes": ("boxes.json", "annotations.json", "coco.json", "gt/gt.txt", "boxes_bbox.npy"),
}
_FOLDERS = {
    "masks": ("masks", "mask", "segmentation", "semantic", "labels"),
    "depth": ("depth",),
    "flow": ("flow", "optical_flow", "flow/forward"),
}
_LABELS = "labels"  # of YOLO
"""Places of each kind in a folder, in the order in which they are looked for."""

_INSIDE = {
    **{"data": "data.csv", "rgb": "rgb.txt", "img": "left_images.txt", "images": "images.txt"},
    **{"cam0": "cam0/data.csv", "cam1": "cam1/data.csv", "mav0": "mav0"},
}
"""Folders of frames within that of a sequence, and what this then holds."""

_FRAMES = (
    *("events.txt", "images.txt", "adv2e.json", "side.json", "images", "rgb", "rgb.txt", "img"),
    *("left_images.txt", "right_images.txt", "timestamps.txt", "info.txt", "data", "data.csv"),
    *("boxes.json", "boxes_bbox.npy", "calib.txt", "sensor.yaml", "mav0", "cam0"),
)
"""What is no side data, or is written twice."""

_LIKELY = ("", ".txt", ".csv", ".yaml", ".yml", ".json", ".npy", ".npz", ".bag", ".mat")
"""Suffixes of side data, and of folders."""

Tell = Callable[[str], None]


class Kind(Protocol):
    """Side data of a kind, as they were read."""

    def written(self, place: Placement, clock: Clock) -> Iterator[tuple[str, bytes]]:
        """Yield name and bytes of each file; DataError, at last, for what cannot be carried."""
        ...


@dataclass
class SideData:
    """Side data of an input, as they were read.

    Attributes
    ----------
    place : Placement
        Where the frames lie on the sensor.
    kinds : dict
        What was read of each kind, by its name.
    labels : dict
        Where each was found.
    rest : list of str
        Names of what is in the input and is not carried.
    doubts : list of str
        What else is to be told.
    """

    place: Placement
    kinds: dict[str, Kind] = field(default_factory=dict)
    labels: dict[str, str] = field(default_factory=dict)
    rest: list[str] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)

    def files(self, clock: Callable[[], Clock], tell: Tell) -> Iterator[tuple[str, bytes]]:
        """Yield name and bytes of each file; what cannot be carried is told.

        `clock` is called once the frames are read.
        """
        known = clock()
        for name, kind in self.kinds.items():
            try:
                yield from kind.written(self.place, known)
            except DataError as error:  # noqa: PERF203 - the others are carried
                tell(left_out(f"{error}: not carried", name))
                del self.labels[name]

    def told(self) -> str:
        """Return what is carried, in a line for people."""
        return f"side data carried: {', '.join(f'{k} ({v})' for k, v in self.labels.items())}"


def find_side(
    source: str | Path,
    given: str | Path | None,
    place: Placement,
    tell: Tell,
    uncarried: Iterable[str] = (),
) -> SideData | None:
    """Return the side data of an input; None: it has none, or none are wanted.

    Parameters
    ----------
    source : str or Path
        The input.
    given : str or Path, optional
        Folder or zip in which they are, in place of the input; "none": none are wanted.
    place : Placement
        Where the frames lie on the sensor.
    tell : callable
        Takes lines on what cannot be carried.
    uncarried : iterable of str
        What is within the input itself, and cannot be carried.

    Raises
    ------
    DataError
        What was given holds none, or what cannot be read.
    """
    if str(given) == "none" or (given is None and str(source) == "-"):
        return None
    found = SideData(place, rest=[*uncarried])
    for files in _roots(Path(source), given):
        names, before = _Names(files), len(found.labels)
        for kind in [*_PLACES, *_FOLDERS]:
            try:
                if kind not in found.labels:
                    _read(kind, names, found)
            except DataError as error:  # noqa: PERF203 - the others are carried
                if given is not None:
                    raise
                tell(left_out(f"{error}: not carried", kind))
        if len(found.labels) > before or names.files.names("mav0"):
            found.rest += names.rest(found, Path(source).name)
    boxed = _boxes_beside(Path(source))
    if given is None and "boxes" not in found.labels and boxed.is_file():
        found.kinds["boxes"] = boxes.of_prophesee(boxed.read_bytes(), str(boxed))
        found.labels["boxes"] = boxed.name
    if given is not None and not found.labels:
        known = [name for one in (*_PLACES.values(), *_FOLDERS.values()) for name in one[:1]]
        raise DataError(f"{given}: no side data in it that is known, such as {', '.join(known)}")
    for line in found.doubts:
        tell(line)
    if found.rest:
        more = f" and {len(found.rest) - 6} more" if len(found.rest) > 6 else ""
        told = f"not carried: {', '.join(map(shown, found.rest[:6]))}{more}"
        tell(told_of(source, left_out(told)))
    return found if found.labels else None


def places_of(source: Path) -> list[Path]:
    """Return the files and folders of side data of an input that lie outside of it."""
    kinds = [*_PLACES.values(), *_FOLDERS.values(), (_LABELS,)]
    roots = [files.path for files in _roots(source, None) if files.path != source.absolute()]
    found = (root / name for root in roots for kind in kinds for name in kind)
    places = {*found, _boxes_beside(source.absolute())}
    return sorted(path for path in places if path.exists() and path != source.absolute())


def _roots(source: Path, given: str | Path | None) -> Iterator[Members]:
    """Yield the folders and zips in which side data may be."""
    if given is not None:
        if not Path(given).exists():
            raise DataError(f"--side {given}: no such folder or zip")
        yield Members(Path(given))
        return
    own = beside(source, SIDE)
    if own.is_dir():
        yield Members(own)
    if source.suffix.lower() == ".zip" and source.is_file():
        yield Members(source)
    whole = source.absolute()
    while source.is_dir():
        yield Members(whole)
        above = whole.parent
        if whole.name not in _INSIDE or not (above / _INSIDE[whole.name]).exists():
            return
        whole = above


def _boxes_beside(source: Path) -> Path:
    """Return the place of boxes beside a file of events, as Prophesee's sets have it."""
    return source.with_name(f"{source.stem.removesuffix('_td')}_bbox.npy")


class _Names:
    """The files of a folder, or of a zip, which may hold all in one folder."""

    def __init__(self, files: Members) -> None:
        self.files = files
        if not files.path.is_dir():
            names = files.archived()
            tops = {name.partition("/")[0] for name in names}
            if len(tops) == 1 and all("/" in name for name in names):
                self.files = files.below(f"{tops.pop()}/")

    def within(self, folder: str, suffixes: tuple[str, ...]) -> list[str]:
        """Return the files of a folder with one of the suffixes, in the order of their names."""
        held = self.files.names(folder)
        named = sorted((one for one in held if one.lower().endswith(suffixes)), key=natural_key)
        return [f"{folder}/{name}" for name in named]

    def text(self, name: str) -> str:
        return decoded(self.files.read(name), self.files.label(name))

    def rest(self, found: SideData, source: str) -> list[str]:
        """Return what is there, and is neither carried nor of the frames of the source."""
        used = {*found.labels.values(), *(f"{kind}.txt" for kind in found.labels), *_FRAMES, source}
        return [
            f"{folder}{name}"
            for folder in ("", "mav0/")
            for name in self.files.names(folder.rstrip("/"))
            if PurePosixPath(name).suffix in _LIKELY and not name.startswith(".")
            if name not in used
            if not any(one.startswith((f"{name}/", f"{folder}{name}/")) for one in used)
        ]


def _read(kind: str, names: _Names, found: SideData) -> None:
    """Add what there is of a kind to what was found."""
    files, place = names.files, found.place
    made: Kind | None = None
    name = next(filter(files.has, _PLACES.get(kind, ())), "")
    label = files.label(name or _LABELS)
    if kind == "calibration" and name:
        made = calibration = parse_calibration(names.text(name), label)
        calibration.placed(place)
    elif kind == "boxes":
        boxed: boxes.Boxes | None = None
        if name:
            made = boxed = _BOXES[PurePosixPath(name).suffix](files.read(name), label)
        elif inside := names.within(_LABELS, (".txt",)):
            name, known = _LABELS, [one for one in inside if not one.endswith("classes.txt")]
            made = boxed = boxes.of_yolo({one: files.read(one) for one in known}, label)
        for size in boxed.sizes if boxed else ():
            place.check(size, label)
    elif kind in _PLACES and name:
        made = table = parse_table(names.text(name), label, kind)
        found.doubts += table.told
    for folder in _FOLDERS.get(kind, ()):
        if inside := names.within(folder, maps.SUFFIXES):
            name, mapped = folder, maps.Maps(kind, files.label(folder), inside, files.read)
            mapped.map_of(inside[0], place)
            lists = (f"{kind}.txt", f"{folder}.txt", f"{folder}_timestamps.txt")
            if listed := next(filter(files.has, lists), None):
                mapped = _by_list(mapped, listed, names, found.doubts)
            made = mapped
            break
    if made is not None:
        found.kinds[kind], found.labels[kind] = made, name


_BOXES = {".json": boxes.of_coco, ".txt": boxes.of_mot, ".npy": boxes.of_prophesee}


def _by_list(made: maps.Maps, name: str, names: _Names, doubts: list[str]) -> maps.Maps:
    """Return maps in the order, and at the times, of a list; what is doubtful is added."""
    label = names.files.label(name)
    listed, times, doubtful = maps.listed(names.text(name), label, 2 if made.kind == "flow" else 1)
    doubts += doubtful
    chosen = listed or list(made.names)
    missing = next((one for one in chosen if not names.files.has(one)), None)
    if missing is not None or len(chosen) != len(times):
        told = f"no file {missing}" if missing else f"{len(times)} times for {len(chosen)} files"
        raise DataError(f"{label}: {told}")
    return replace(made, names=chosen, times=times)

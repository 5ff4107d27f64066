"""Exports: what ``adv2e export`` does."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from collections.abc import Sequence as Many
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from adv2e import __version__
from adv2e.conversion.transfer import clock_of, side_of
from adv2e.errors import UsageError, warn
from adv2e.exporting import e2vid, ev_segnet, voxels
from adv2e.exporting.sequence import Sequence, open_sequences
from adv2e.exporting.voxels import (
    Slice,
    before_images,
    between_images,
    by_count,
    by_time,
)
from adv2e.files.regular import shown
from adv2e.files.staging import Staging, writing
from adv2e.formats.reading import events_in_order
from adv2e.formats.writing import write_side
from adv2e.in_python import in_python
from adv2e.options import EXPORTS, MOST_EMPTY, EventInput, ExportOptions, chosen, declared, takes

DESCRIPTION = "export.json"
"""Name of the file that describes an export."""


@dataclass(frozen=True)
class Cutting:
    """Windows into which events are cut: by time, by count, or at images; one of the three.

    Attributes
    ----------
    window_us : int, optional
        Length of a window [us]; of a picture for Ev-SegNet, that before each image.
    count : int, optional
        Events of a window.
    at_images : bool
        From each image to the next.
    """

    window_us: int | None = None
    count: int | None = None
    at_images: bool = False


@dataclass(frozen=True)
class Exported:
    """Summary of an export: its output, and numbers of sequences and items."""

    output: str
    sequences: int
    items: int
    what: str
    seconds: float

    def text(self) -> str:
        """Return it as a line for people."""
        recordings = f"{self.sequences} recording" + "s" * (self.sequences != 1)
        return (
            f"{shown(self.output)}: {self.items:,} {self.what} of {recordings}; took"
            f" {self.seconds:.1f} s"
        )


@takes(ExportOptions, *EXPORTS.values())
def export(
    events: str | Path | Iterable[str | Path],
    output: str | Path,
    to: str,
    *,
    doubt: Callable[[str], None] = lambda text: warn(in_python(text)),
    **options: Any,
) -> Exported:
    """Make a training set, or a representation, of event files or recordings.

    Parameters
    ----------
    events : path, or iterable of paths
        Measured or simulated.  For e2vid, ev-segnet, and windows at images they must hold images.
    output : str or Path
        Folder to write.
    to : {'voxel', 'ev-segnet', 'e2vid'}
        Voxel grids, pictures for Ev-SegNet, or a training set for E2VID.
    doubt : callable
        Takes lines for people that ask for a look; default: they are warnings.
    **options
        See :class:`adv2e.options.ExportOptions` and :data:`adv2e.options.EXPORTS`.

    Returns
    -------
    Exported
        Numbers of recordings and items.

    Raises
    ------
    UsageError
        Options do not fit what is made.
    DataError, OutputError
        Something is wrong with an input or the output; then nothing is left.

    Examples
    --------
    >>> import os, tempfile
    >>> from adv2e import export, write_events
    >>> from adv2e.events import make_events
    >>> events = make_events(t=[10, 20], x=[0, 3], y=[0, 2], p=[1, 0])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     clip, grids = os.path.join(folder, "a.h5"), os.path.join(folder, "grids")
    ...     write_events(clip, events, (4, 3))
    ...     export(clip, grids, "voxel", count=2).items
    1
    """
    _check_kind(to, options)
    paths = [events] if isinstance(events, (str, Path)) else list(events)
    if len(paths) > 1 and options["side"] not in (None, "none"):
        raise UsageError("--side: is of one recording, and there are several: export one by one")
    how = {**chosen(EventInput, options), "overwrite": options["overwrite"], "doubt": doubt}
    how["side"] = options["side"]
    if to == "e2vid":
        return export_e2vid(paths, output, options["valid"], options["threads"], **how)
    window_us = options["window_us"]
    if to == "ev-segnet":
        drawn = ev_segnet.SegmentationSettings(
            options["split"], options["rows"], options["counts"] == "scaled"
        )
        return export_ev_segnet(paths, output, window_us or 50_000, drawn, **how)
    names = ("bins", "normalise", "polarity", "span")
    settings = voxels.VoxelSettings(**{name: options[name] for name in names})
    cutting = Cutting(window_us, options["count"], options["at"] == "images")
    most_empty = options["most_empty"]
    return export_voxels(paths, output, cutting, settings, most_empty=most_empty, **how)


def _check_kind(to: str, options: Mapping[str, Any]) -> None:
    """Raise UsageError where options are missing, or do not fit what is made."""
    if to not in EXPORTS:
        raise UsageError(f"--to: must be one of {', '.join(EXPORTS)}, got {to!r}")
    for name, option in declared(*EXPORTS.values()).items():
        if name not in declared(EXPORTS[to]) and options[name] != option.default:
            raise UsageError(f"{option.flag_of(name)} is not for --to {to}: leave it out")
    cuts = [options[name] is not None for name in ("window_us", "count", "at")]
    if to == "voxel" and sum(cuts) != 1:
        raise UsageError("--to voxel needs one of --window TIME, --count N and --at images")


def export_voxels(
    paths: Many[str | Path],
    output: str | Path,
    cutting: Cutting,
    settings: voxels.VoxelSettings | None = None,
    *,
    most_empty: int = MOST_EMPTY,
    **how: Any,
) -> Exported:
    """Write the voxel grids of all windows; `how` as in :func:`_exported`.

    `most_empty` windows of time in a row may have no event.

    Raises
    ------
    Adv2eError
        For anything wrong with an input or the output; then nothing is left.
    """
    settings = settings or voxels.VoxelSettings()

    def one(sequence: Sequence, folder: Path) -> tuple[tuple[int, int], int]:
        size, slices = _slices(sequence, cutting, most_empty)
        return size, voxels.write_voxels(slices, size, folder / sequence.name, settings)

    described = {"to": "voxel", "cutting": asdict(cutting), **asdict(settings)}
    return _exported(paths, output, described, "voxel grids", _each(one), **how)


def export_ev_segnet(
    paths: Many[str | Path],
    output: str | Path,
    window_us: int = 50_000,
    settings: ev_segnet.SegmentationSettings | None = None,
    **how: Any,
) -> Exported:
    """Write a picture of the events before each image; `how` as in :func:`_exported`.

    Raises
    ------
    Adv2eError
        For anything wrong with an input or the output; then nothing is left.
    """
    settings = settings or ev_segnet.SegmentationSettings()

    def one(sequence: Sequence, folder: Path) -> tuple[tuple[int, int], int]:
        size, _, parts = events_in_order(sequence.file)
        slices = before_images(parts, sequence.image_times_us, window_us)
        images = (image for _, image in e2vid.images_of(sequence))
        number = ev_segnet.write_event_images(sequence.name, slices, images, size, folder, settings)
        return size, number

    described = {"to": "ev-segnet", "window_us": window_us, **asdict(settings)}
    return _exported(paths, output, described, "pictures of events", _each(one), **how)


def export_e2vid(
    paths: Many[str | Path],
    output: str | Path,
    valid_share: float = 0.2,
    threads: int | None = None,
    **how: Any,
) -> Exported:
    """Write a training set for E2VID; `how` as in :func:`_exported`.

    Raises
    ------
    Adv2eError
        For anything wrong with an input or the output; then nothing is left.
    """

    def write(sequences: list[Sequence], folder: Path, told: dict[str, Any]) -> int:
        for sequence in sequences:
            number = len(sequence.image_times_us)
            if number < e2vid.USUAL_FRAMES:
                told["doubts"].append(
                    f"{sequence.file.facts.path}: {number} images; a loader of 40 intervals, as"
                    f" event_cnn_minimal has it, needs {e2vid.USUAL_FRAMES}"
                )
        train, valid = e2vid.write_training_set(
            sequences, folder, Path(output), valid_share, threads
        )
        told.update(train=train, valid=valid)
        return len(train) + len(valid)

    described = {"to": "e2vid", "valid_share": valid_share}
    return _exported(paths, output, described, "sequences", write, **how)


Write = Callable[[list[Sequence], Path, dict[str, Any]], int]
"""Is given the recordings, the folder, and what is told of them; returns how many items."""


def _each(one: Callable[[Sequence, Path], tuple[tuple[int, int], int]]) -> Write:
    """Return a writer of recordings one by one; `one` returns sensor size and number of items."""

    def write(sequences: list[Sequence], folder: Path, told: dict[str, Any]) -> int:
        for sequence in sequences:
            size, items = one(sequence, folder)
            told["sequences"].append({"name": sequence.name, "size": list(size), "items": items})
        return sum(entry["items"] for entry in told["sequences"])

    return write


def _exported(
    paths: Many[str | Path],
    output: str | Path,
    described: dict[str, Any],
    what: str,
    write: Write,
    *,
    overwrite: bool = False,
    doubt: Callable[[str], None] = lambda text: None,
    side: str | Path | None = None,
    **reading: Any,
) -> Exported:
    """Let `write` fill a folder, which comes into place when all is there.

    Parameters
    ----------
    paths : sequence of str or Path
        Event files or recordings, measured or simulated.
    output : str or Path
        Folder to write.
    described : dict
        What ``export.json`` says of the settings.
    what : str
        What the items are, for people.
    write : callable
        Fills the folder.
    overwrite : bool
        Replace, at the end, an export that exists.
    doubt : callable
        Takes lines for people that ask for a look.
    side : str or Path, optional
        Where side data are, in place of the recordings; "none": none are written.
    **reading
        See :func:`adv2e.formats.reading.open_events`.
    """
    began = time.perf_counter()
    sequences = open_sequences(paths, **reading)
    told: dict[str, Any] = {"sequences": [], "doubts": []}
    read = [one for sequence in sequences for one in sequence.file.inputs]
    with Staging(overwrite, read) as staging, writing(output):
        folder = staging.folder(Path(output), _foreign)
        staging.prepare()
        folder.mkdir()
        items = write(sequences, folder, told)
        for sequence in sequences:
            _write_side(sequence, side, folder / "side" / sequence.name, told["doubts"].append)
        doubts = told.pop("doubts")
        entries = sorted([entry.name for entry in folder.iterdir()] + [DESCRIPTION])
        inputs = [
            {"name": sequence.name, "file": shown(sequence.file.facts.path.name)}
            for sequence in sequences
        ]
        asked = {name: reading.get(name) for name in ("start_s", "stop_s", "crop")}
        part = {name: value for name, value in asked.items() if value is not None}
        described |= {"part": part} if part else {}
        text = {"adv2e": __version__, **described, "inputs": inputs, **told, "entries": entries}
        (folder / DESCRIPTION).write_text(json.dumps(text, indent=2) + "\n", "utf-8", newline="\n")
    for sequence in sequences:
        doubts += [
            f"{sequence.file.facts.path}: {problem}"
            for problem in dict.fromkeys(sequence.file.facts.problems)
        ]
    for line in doubts:
        doubt(line)
    return Exported(str(output), len(sequences), items, what, time.perf_counter() - began)


def _write_side(
    sequence: Sequence, given: str | Path | None, folder: Path, tell: Callable[[str], None]
) -> None:
    """Write the side data of a recording, whose events were read, on the clock of its events."""
    side = side_of(sequence.file, given, tell)
    if side is not None:
        write_side(folder, side.files(partial(clock_of, sequence.file), tell))


def _slices(
    sequence: Sequence, cutting: Cutting, most_empty: int
) -> tuple[tuple[int, int], Iterator[Slice]]:
    """Return the size of the sensor and the windows of a recording."""
    size, first_us, parts = events_in_order(sequence.file)
    if cutting.at_images:
        return size, between_images(parts, sequence.image_times_us)
    if cutting.count is not None:
        return size, by_count(parts, cutting.count)
    assert cutting.window_us is not None
    label = str(sequence.file.facts.path)
    return size, by_time(parts, first_us, cutting.window_us, label, most_empty)


def _foreign(folder: Path) -> str | None:
    """Name something in `folder` that no export of ours has put there."""
    try:
        ours = json.loads((folder / DESCRIPTION).read_text("utf-8"))["entries"]
    except (OSError, ValueError, KeyError, TypeError):
        ours = []
    found = sorted(entry.name for entry in folder.iterdir())
    return next((name for name in found if name not in ours), None)

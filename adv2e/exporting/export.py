"""Exports: what ``adv2e export`` does."""

from __future__ import annotations

import csv
import io
import json
import time
from collections.abc import Callable, Iterable, Mapping
from collections.abc import Sequence as Many
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from adv2e import __version__
from adv2e.conversion.transfer import clock_of
from adv2e.errors import UsageError, warn
from adv2e.exporting import e2vid, ev_segnet
from adv2e.exporting.layouts import LAYOUTS, check_kind, chosen_options
from adv2e.exporting.sequence import MADE_BY_US, Sequence, check_once, is_tree, open_sequences
from adv2e.exporting.targets import Targets
from adv2e.exporting.voxels import before_images
from adv2e.files.regular import shown
from adv2e.files.staging import Staging, writing
from adv2e.formats.reading import events_in_order
from adv2e.formats.writing import write_side
from adv2e.in_python import in_python
from adv2e.label import report_of
from adv2e.options import EXPORTS, EventInput, ExportOptions, chosen, takes

DESCRIPTION, FILES = MADE_BY_US
"""Names of the file that describes an export, and of the list of what is in it."""


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
    targets: Many[Targets] | None = None,
    doubt: Callable[[str], None] = lambda text: warn(in_python(text)),
    **options: Any,
) -> Exported:
    """Make a training set, or a representation, of event files or recordings.

    Parameters
    ----------
    events : path, or iterable of paths
        Measured or simulated; or one folder, of which all below it are exported.  For e2vid,
        ev-segnet, and windows at images they must hold images.
    output : str or Path
        Folder to write.
    to : str
        What to make: a layout of ``adv2e export --to``, such as "voxel" or "rvt".
    targets : sequence of Targets, optional
        Boxes and flow of each recording; default: what lies beside it.  See
        :mod:`adv2e.exporting.targets`.
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
    check_kind(to, options)
    paths = [events] if isinstance(events, (str, Path)) else list(events)
    if len(paths) > 1 and options["side"] not in (None, "none"):
        raise UsageError("--side: is of one recording, and there are several: export one by one")
    began = time.perf_counter()
    how = chosen_options(to, options)
    described = {"to": to, **how}
    how |= {"threads": options["threads"]}
    sequences = open_sequences(paths, targets, options["side"], **chosen(EventInput, options))
    told: dict[str, Any] = {"sequences": [], "doubts": []}
    read = [one for sequence in sequences for one in sequence.file.inputs]
    with Staging(options["overwrite"], read) as staging, writing(output):
        folder = staging.folder(Path(output), foreign)
        staging.prepare()
        folder.mkdir()
        if to == "e2vid":
            what, items = "sequences", _write_e2vid(sequences, folder, Path(output), how, told)
        elif to == "ev-segnet":
            what, items = "pictures of events", _write_ev_segnet(sequences, folder, how, told)
        else:
            of_tree = is_tree([*map(Path, paths)])
            what, items = LAYOUTS[to].what, _write_units(to, sequences, folder, how, told, of_tree)
        for sequence in sequences:
            _write_side(sequence, folder / "side" / sequence.name)
            told["doubts"] += sequence.told
        doubts = told.pop("doubts")
        entries = sorted([entry.name for entry in folder.iterdir()] + [DESCRIPTION])
        inputs = [
            {
                "name": sequence.name,
                "file": shown(sequence.file.facts.path.name),
                "label": report_of(sequence.file.facts.description, sequence.file.facts.problems),
            }
            for sequence in sequences
        ]
        asked = {name: options[name] for name in ("start_s", "stop_s", "crop")}
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


@takes(ExportOptions, *EXPORTS.values())
def export_unit(
    events: Path,
    output: Path,
    to: str,
    *,
    doubt: Callable[[str], None] = lambda text: None,
    **options: Any,
) -> int:
    """Make what a set of :data:`LAYOUTS` holds of one recording; return the number of items.

    What is there is replaced.

    Raises
    ------
    Adv2eError
        For anything wrong with an input or the output; then nothing is left.
    """
    how = {**chosen_options(to, options), "threads": options["threads"]}
    (sequence,) = open_sequences([events], **chosen(EventInput, options))
    with Staging(True, sequence.file.inputs) as staging, writing(output):
        is_file = LAYOUTS[to].has_classes
        made = staging.file(output) if is_file else staging.folder(output, lambda path: None)
        staging.prepare()
        _, items = LAYOUTS[to].write(sequence, made, how, doubt)
    for problem in dict.fromkeys(sequence.file.facts.problems):
        doubt(f"{events}: {problem}")
    return items


def _write_units(
    to: str,
    sequences: list[Sequence],
    folder: Path,
    how: Mapping[str, Any],
    told: dict[str, Any],
    of_tree: bool,
) -> int:
    """Write recordings, each to its place; with lists, of a tree or of a set; return how many."""
    layout, rows = LAYOUTS[to], []
    for sequence in sequences:
        place, label, split = layout.place_of(sequence.name, how["valid"])
        rows.append((str(place), label, split))
    check_once([row[0] for row in rows])
    for sequence, (where, *_) in zip(sequences, rows, strict=True):
        size, items = layout.write(sequence, folder / where, how, told["doubts"].append)
        told["sequences"].append({"name": sequence.name, "size": list(size), "items": items})
    if of_tree or layout.place != "{name}":
        (folder / FILES).write_text(list_of(rows), "utf-8", newline="")
    return sum(entry["items"] for entry in told["sequences"])


def list_of(rows: Iterable[tuple[str, str, str]]) -> str:
    """Return a list of files or folders, their classes, and parts of the set that they are in."""
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerows([("file", "class", "split"), *sorted(rows)])
    return text.getvalue()


def _write_ev_segnet(
    sequences: list[Sequence], folder: Path, how: Mapping[str, Any], told: dict[str, Any]
) -> int:
    check_once([sequence.flat for sequence in sequences])
    for sequence in sequences:
        size, _, parts = events_in_order(sequence.file)
        slices = before_images(parts, sequence.image_times_us, how["window_us"])
        images = (image for _, image in e2vid.images_of(sequence))
        items = ev_segnet.write_event_images(sequence.flat, slices, images, size, folder, how)
        told["sequences"].append({"name": sequence.name, "size": list(size), "items": items})
    return sum(entry["items"] for entry in told["sequences"])


def _write_e2vid(
    sequences: list[Sequence],
    folder: Path,
    final: Path,
    how: Mapping[str, Any],
    told: dict[str, Any],
) -> int:
    for sequence in sequences:
        number = len(sequence.image_times_us)
        if number < e2vid.USUAL_FRAMES:
            told["doubts"].append(
                f"{sequence.file.facts.path}: {number} images; a loader of 40 intervals, as"
                f" event_cnn_minimal has it, needs {e2vid.USUAL_FRAMES}"
            )
    train, valid = e2vid.write_training_set(sequences, folder, final, how, told["doubts"].append)
    told.update(train=train, valid=valid)
    return len(train) + len(valid)


def _write_side(sequence: Sequence, folder: Path) -> None:
    """Write the side data of a recording, whose events were read, on the clock of its events."""
    if sequence.side is not None:
        clock = partial(clock_of, sequence.file)
        write_side(folder, sequence.side.files(clock, sequence.told.append))


def foreign(folder: Path) -> str | None:
    """Name something in `folder` that no export of ours has put there."""
    try:
        ours = json.loads((folder / DESCRIPTION).read_text("utf-8"))["entries"]
    except (OSError, ValueError, KeyError, TypeError):
        ours = []
    found = sorted(entry.name for entry in folder.iterdir())
    return next((name for name in found if name not in ours), None)

"""Recordings in the layout of the Event-Camera Dataset (DAVIS240C): a folder or its zip.

======================== ========================================================================
events.txt               ``seconds x y polarity``, see :mod:`adv2e.formats.text`
images.txt               ``seconds images/frame_%08d.png``, a line for each frame stored
images/frame_%08d.png    frames, counted from 0, 8 or 16 bit as given
adv2e.json               version, geometry, configuration, seed
======================== ========================================================================

An archive that is written holds these at its root; one that is read may hold them in one folder.

What rpg_e2vid and its descendants read is written, too: text with a heading, or a zip of it alone,
which is read as text.

============ ==================================================
first line   ``width height``, which these programs skip
other lines  ``seconds x y polarity``, polarity 0 (OFF) or 1 (ON)
============ ==================================================

Without the first line they would lose the first event, and refuse a zip of more than one file.

References
----------
.. [1] E. Mueggler, H. Rebecq, G. Gallego, T. Delbruck, D. Scaramuzza, "The event-camera dataset and
   simulator", IJRR 36(2), 2017, doi:10.1177/0278364917691115.
.. [2] H. Rebecq et al., "High speed and high dynamic range video with an event camera", TPAMI 2019,
   arXiv:1906.07165; github.com/uzh-rpg/rpg_e2vid: utils/event_readers.py.
"""

from __future__ import annotations

import zipfile
from abc import abstractmethod
from contextlib import ExitStack, closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from adv2e.background import OrderedWork
from adv2e.errors import DataError
from adv2e.events import Events
from adv2e.files.backlog import Backlog
from adv2e.files.regular import beside
from adv2e.files.staging import Staging
from adv2e.files.zips import Members
from adv2e.formats.event_file import EventFile, Facts
from adv2e.formats.text import lines_of
from adv2e.formats.text_writer import blocks_of, formatted, text_blocks
from adv2e.formats.writing import Pieces, Request, Writer, listed_side, to_json, write_side
from adv2e.label import told_of
from adv2e.light.pictures import png_of
from adv2e.sources.frame import Shot
from adv2e.sources.images.opencv import image_of
from adv2e.sources.stored import DESCRIPTION, EVENTS, LIST
from adv2e.sources.times.lists import FrameList, decoded, has_lines, members_of, parse_list
from adv2e.sources.times.rates import nine_decimals


def open_davis240c(path: Path, facts: Facts) -> EventFile:
    """Open the recording in a folder or zip.

    Raises
    ------
    DataError
        No ``events.txt`` in it, a line that cannot be read, or an image that is listed is missing;
        a zip that cannot be read.
    """
    files = Members(path)
    if path.is_dir():
        if not files.has(EVENTS):
            raise DataError(f"{path}: no {EVENTS} in it; a folder must be a DAVIS240C recording")
        name = EVENTS
    else:
        found = files.enter(EVENTS) or files.enter("*.txt")
        if len(found) != 1:
            raise DataError(
                f"{path}: must hold one {EVENTS}, at its root or in one folder, or a single text"
                " file"
            )
        (name,) = found
    if files.has(DESCRIPTION):
        text = files.read(DESCRIPTION).decode("utf-8-sig", "replace")
        facts.describe(text, files.label(DESCRIPTION), DESCRIPTION)
    elif not path.is_dir() and (described := beside(path, ".json")).is_file():
        facts.describe_from(described)  # a zip for rpg_e2vid holds nothing but events
    facts.inputs += map(files.label, (name, LIST, DESCRIPTION))
    listed = _listed(files, stated=facts.stated_unit)
    if listed is not None and len(listed.stamps) > 1:
        facts.note_frames(listed.unit, whole=listed.whole)
    if facts.geometry is None and listed is not None:
        first = members_of(listed.stamps[:1], files.label(LIST), files.has)[0]
        rows, columns = image_of(files, first).image.shape[:2]
        facts.state((columns, rows), first)
    label = files.label(name)
    header = f"the first line of {name}"
    text_file = lines_of(lambda: files.open(name), files.size(name), label, facts, header)
    if listed is None:
        return replace(text_file, layout="davis240c" if name == EVENTS else "text")
    if unit := facts.unit_of_frames(whole=listed.whole):
        listed = _listed(files, time_unit=unit) or listed
    facts.problems += [told_of(LIST, line) for line in (listed.unit.doubt, listed.order) if line]
    names = members_of(listed.stamps, files.label(LIST), files.has)
    shots = [
        Shot(stamp.t_ns, files.label(member), partial(image_of, files, member))
        for stamp, member in zip(listed.stamps, names, strict=True)
    ]
    return replace(text_file, layout="davis240c", shots=lambda: iter(shots))


def _listed(files: Members, **evidence: Any) -> FrameList | None:
    if not files.has(LIST):
        return None
    label = files.label(LIST)
    text = decoded(files.read(LIST), label)
    return parse_list(text, label, **evidence) if has_lines(text) else None


_BLOCK = 1 << 20  # bytes of text deflated at once: the archive must not depend on who calls how
_LEVEL = 4  # of deflate: a fifth more bytes than level 6, in a third of its time


class _Davis240cWriter(Writer):
    """Base of the writers of folder and archive: names and list of the frames."""

    def __init__(self, request: Request, stack: ExitStack) -> None:
        self._description, self._side = request.description, request.side
        self._work = OrderedWork(request.threads - 1)
        stack.callback(self._work.abandon)
        self._lines: list[str] = []

    def write_frame(self, t_ns: int, image: NDArray[Any]) -> None:
        """Append a frame."""
        name = f"images/frame_{len(self._lines):08d}.png"
        self._lines.append(f"{nine_decimals(t_ns)} {name}\n")
        self._store_frame(name, t_ns, image.copy())

    @abstractmethod
    def _store_frame(self, name: str, t_ns: int, image: NDArray[Any]) -> None:
        """Have an image encoded and stored, which nobody else changes."""


class FolderWriter(_Davis240cWriter):
    """Writes a DAVIS240C folder; one that exists is replaced if it holds nothing else."""

    @staticmethod
    def stage(path: Path, staging: Staging) -> list[Path]:
        """Return the temporary name of the folder."""
        return [staging.folder(path, _foreign)]

    def __init__(self, request: Request, stack: ExitStack, *temporary: Path) -> None:
        super().__init__(request, stack)
        (self._folder,) = temporary
        self._folder.mkdir()
        if request.with_frames:
            (self._folder / "images").mkdir()
        self._events = stack.enter_context((self._folder / EVENTS).open("wb"))

    def write_events(self, events: Events) -> None:
        """Append events."""
        for block in blocks_of(events):
            self._work.submit(formatted, block, take=self._events.write)

    def _store_frame(self, name: str, t_ns: int, image: NDArray[Any]) -> None:
        self._work.submit(png_of, image, take=(self._folder / name).write_bytes)

    def finish(self) -> None:
        """Write the remaining frames, the list and the description."""
        self._work.finish()
        (self._folder / LIST).write_text("".join(self._lines), "ascii", newline="\n")
        if self._side is not None:
            self._description["side"] = write_side(self._folder, self._side)
        text = to_json(self._description)
        (self._folder / DESCRIPTION).write_text(text, "utf-8", newline="\n")


def _foreign(folder: Path) -> str | None:
    """Name something in `folder` that this layout, as written here, does not have."""
    ours = (EVENTS, LIST, DESCRIPTION, *listed_side(folder, DESCRIPTION))
    for entry in sorted(folder.iterdir()):
        if entry.name == "images" and entry.is_dir():
            for image in sorted(entry.iterdir()):
                if not image.match("frame_*.png"):
                    return f"images/{image.name}"
        elif entry.name not in ours:
            return entry.name
    return None


class ZipWriter(_Davis240cWriter):
    """Writes the DAVIS240C files to a zip archive, whose bytes follow from its content."""

    def __init__(self, request: Request, stack: ExitStack, path: Path) -> None:
        super().__init__(request, stack)
        self._archive = stack.enter_context(
            zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=_LEVEL)
        )
        # an archive takes one member at a time: events go straight in, frames wait
        self._events = stack.enter_context(self._archive.open(EVENTS, "w", force_zip64=True))
        self._deflating = OrderedWork(min(1, request.threads - 1))
        stack.callback(self._deflating.abandon)
        self._text = Pieces(_BLOCK, np.uint8)
        self._encoded = stack.enter_context(closing(Backlog(path.parent, limit=0)))

    def write_events(self, events: Events) -> None:
        """Append events."""
        for block in text_blocks(events):
            for piece in self._text.add(np.frombuffer(block, np.uint8)):
                self._deflating.submit(self._events.write, piece.data)

    def _store_frame(self, name: str, t_ns: int, image: NDArray[Any]) -> None:
        def take(data: bytes) -> None:
            self._encoded.append(t_ns, np.frombuffer(data, np.uint8))

        self._work.submit(png_of, image, take=take)

    def finish(self) -> None:
        """Write the remaining events, the list, the frames and the description."""
        self._deflating.submit(self._events.write, self._text.take().data)
        self._deflating.finish()
        self._events.close()
        self._archive.getinfo(EVENTS).external_attr = 0o644 << 16
        self._work.finish()
        self._add(LIST, "".join(self._lines).encode("ascii"))
        for number in range(len(self._encoded)):
            data = self._encoded.take().tobytes()
            self._add(f"images/frame_{number:08d}.png", data, zipfile.ZIP_STORED)
        for name, data in self._side or ():
            self._add(name, data)
        self._add(DESCRIPTION, to_json(self._description).encode())

    def _add(self, name: str, data: bytes, method: int = zipfile.ZIP_DEFLATED) -> None:
        info = zipfile.ZipInfo(name)
        info.compress_type = method
        info.external_attr = 0o644 << 16
        self._archive.writestr(info, data)


class E2vidWriter(Writer):
    """Writes the text, or, to a path that ends in ``.zip``, a zip that holds it alone."""

    def __init__(self, request: Request, stack: ExitStack, path: Path) -> None:
        self._file: IO[bytes]
        if request.path.suffix.lower() == ".zip":
            archive = stack.enter_context(
                zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=_LEVEL)
            )
            name = f"{request.path.stem}.txt"
            self._file = stack.enter_context(archive.open(name, "w", force_zip64=True))
        else:
            self._file = stack.enter_context(path.open("wb"))
        self._text = Pieces(_BLOCK, np.uint8)
        self._write(f"{request.width} {request.height}\n".encode())

    def write_events(self, events: Events) -> None:
        """Append events."""
        for block in text_blocks(events):
            self._write(block)

    def _write(self, text: bytes | memoryview) -> None:
        for piece in self._text.add(np.frombuffer(text, np.uint8)):
            self._file.write(piece.data)

    def finish(self) -> None:
        """Write the remaining lines."""
        self._file.write(self._text.take().data)

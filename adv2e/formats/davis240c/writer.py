"""The layout of the Event-Camera Dataset (DAVIS240C), as a folder or a zip archive.

======================== ========================================================================
events.txt               ``seconds x y polarity``, see :mod:`adv2e.formats.text.writer`
images.txt               ``seconds images/frame_%08d.png``, a line for each frame stored
images/frame_%08d.png    frames, counted from 0, 8 or 16 bit as given
adv2e.json               version, geometry, configuration, seed
======================== ========================================================================

An archive holds these at its root.

References
----------
.. [1] E. Mueggler, H. Rebecq, G. Gallego, T. Delbruck, D. Scaramuzza, "The event-camera dataset and
   simulator", IJRR 36(2), 2017, doi:10.1177/0278364917691115.
"""

from __future__ import annotations

import zipfile
from abc import abstractmethod
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, BinaryIO

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.background import OrderedWork
from adv2e.events import Events
from adv2e.files.staging import Staging
from adv2e.formats.sink import FileSink, seconds_text, to_json
from adv2e.formats.spool import FrameSpool
from adv2e.formats.text.writer import text_blocks

_BLOCK = 1 << 20  # bytes of text deflated at once: the archive must not depend on who calls how
_LEVEL = 4  # of deflate: a fifth more bytes than level 6, in a third of its time


def _png(image: NDArray[Any]) -> bytes:
    done, data = cv2.imencode(".png", image)
    assert done
    return data.tobytes()


def _in_file_order(image: NDArray[Any]) -> NDArray[Any]:
    """Return a copy, in the order of colours that OpenCV writes."""
    ordered = image[..., ::-1] if image.ndim == 3 else image
    return np.array(ordered)


class _Davis240cSink(FileSink):
    """What folder and archive share: the frames' names and list."""

    def __init__(
        self,
        path: Path,
        staging: Staging,
        description: dict[str, Any],
        with_frames: bool,
        threads: int,
    ) -> None:
        super().__init__(path, staging)
        self.wants_frames = with_frames
        self._description = to_json(description)
        self._threads = threads
        self._frames: OrderedWork | None = None
        self._lines: list[str] = []

    def _open(self) -> None:
        self._frames = OrderedWork(self._threads - 1)

    def _write_frame(self, t_ns: int, image: NDArray[Any]) -> None:
        assert self._frames is not None
        name = f"images/frame_{len(self._lines):08d}.png"
        self._lines.append(f"{seconds_text(t_ns)} {name}\n")
        self._frames.submit(
            _png, _in_file_order(image), take=lambda data: self._store_frame(name, t_ns, data)
        )

    @abstractmethod
    def _store_frame(self, name: str, t_ns: int, data: bytes) -> None: ...

    def _finish(self) -> None:
        assert self._frames is not None
        self._frames.finish()

    def _abandon(self) -> None:
        if self._frames is not None:
            self._frames.abandon()


class FolderSink(_Davis240cSink):
    """A DAVIS240C folder.

    Parameters
    ----------
    path : Path
        The folder; one that exists is replaced as a whole, if it holds nothing else.
    description : dict
        Content of ``adv2e.json``.
    staging : Staging
        Takes it.
    with_frames : bool
        Store frames.
    threads : int
        Threads that compress frames.
    """

    def __init__(
        self,
        path: Path,
        description: dict[str, Any],
        *,
        staging: Staging,
        with_frames: bool,
        threads: int,
    ) -> None:
        self._folder = staging.folder(path, _foreign)
        self._events: BinaryIO | None = None
        super().__init__(path, staging, description, with_frames, threads)

    def _open(self) -> None:
        super()._open()
        self._folder.mkdir()
        if self.wants_frames:
            (self._folder / "images").mkdir()
        self._events = (self._folder / "events.txt").open("wb")

    def _write_events(self, events: Events) -> None:
        assert self._events is not None
        for block in text_blocks(events):
            self._events.write(block)

    def _store_frame(self, name: str, t_ns: int, data: bytes) -> None:
        (self._folder / name).write_bytes(data)

    def _finish(self) -> None:
        assert self._events is not None
        super()._finish()
        self._events.close()
        (self._folder / "images.txt").write_text("".join(self._lines), "ascii", newline="\n")
        (self._folder / "adv2e.json").write_text(self._description, "utf-8", newline="\n")

    def _abandon(self) -> None:
        super()._abandon()
        if self._events is not None:
            self._events.close()


def _foreign(folder: Path) -> str | None:
    """Name something in `folder` that this layout, as written here, does not have."""
    for entry in sorted(folder.iterdir()):
        if entry.name == "images" and entry.is_dir():
            for image in sorted(entry.iterdir()):
                if not image.match("frame_*.png"):
                    return f"images/{image.name}"
        elif entry.name not in ("events.txt", "images.txt", "adv2e.json"):
            return entry.name
    return None


class ZipSink(_Davis240cSink):
    """A zip archive of the DAVIS240C files, at its root; its bytes follow from its content.

    Parameters
    ----------
    path : Path
        The archive.
    description : dict
        Content of ``adv2e.json``.
    staging : Staging
        Takes it.
    with_frames : bool
        Store frames.
    threads : int
        Threads that compress frames.
    """

    def __init__(
        self,
        path: Path,
        description: dict[str, Any],
        *,
        staging: Staging,
        with_frames: bool,
        threads: int,
    ) -> None:
        self._temporary = staging.file(path)
        self._archive: zipfile.ZipFile | None = None
        self._events: IO[bytes] | None = None
        self._spool: FrameSpool | None = None
        self._deflating: OrderedWork | None = None
        self._text = bytearray()
        super().__init__(path, staging, description, with_frames, threads)

    def _open(self) -> None:
        super()._open()
        self._archive = zipfile.ZipFile(
            self._temporary, "w", zipfile.ZIP_DEFLATED, compresslevel=_LEVEL
        )
        # an archive takes one member at a time: events go straight in, frames wait
        self._events = self._archive.open("events.txt", "w", force_zip64=True)
        self._deflating = OrderedWork(min(1, self._threads - 1))
        if self.wants_frames:
            self._spool = FrameSpool(self._temporary.parent)

    def _write_events(self, events: Events) -> None:
        for block in text_blocks(events):
            self._text += block
            while len(self._text) >= _BLOCK:
                self._deflate(bytes(self._text[:_BLOCK]))
                del self._text[:_BLOCK]

    def _deflate(self, text: bytes) -> None:
        assert self._deflating is not None
        assert self._events is not None
        self._deflating.submit(self._events.write, text, take=lambda size: None)

    def _store_frame(self, name: str, t_ns: int, data: bytes) -> None:
        assert self._spool is not None
        self._spool.add(t_ns, (), data)

    def _finish(self) -> None:
        assert self._archive is not None
        assert self._events is not None
        assert self._deflating is not None
        super()._finish()
        self._deflate(bytes(self._text))
        self._deflating.finish()
        self._events.close()
        self._archive.getinfo("events.txt").external_attr = 0o644 << 16
        self._add("images.txt", "".join(self._lines).encode("ascii"))
        for number, frame in enumerate(self._spool or ()):
            self._add(f"images/frame_{number:08d}.png", frame.data, zipfile.ZIP_STORED)
        self._add("adv2e.json", self._description.encode())
        self._archive.close()
        if self._spool is not None:
            self._spool.close()

    def _add(self, name: str, data: bytes, method: int = zipfile.ZIP_DEFLATED) -> None:
        """Add a member with the time that zip counts from."""
        assert self._archive is not None
        info = zipfile.ZipInfo(name)
        info.compress_type = method
        info.external_attr = 0o644 << 16
        self._archive.writestr(info, data)

    def _abandon(self) -> None:
        super()._abandon()
        if self._deflating is not None:
            self._deflating.abandon()
        for part in (self._events, self._archive, self._spool):
            if part is not None:
                with suppress(Exception):  # each must be closed, whatever became of the others
                    part.close()

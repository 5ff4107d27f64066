"""Video files, opened so that no other file is read, and the track of them that is the film.

FFmpeg takes texts for what they name: scripts that join files, playlists, patterns of numbered
images, addresses.  Here it reads bytes of a file that is open already, and knows formats alone that
hold their pictures themselves.
"""

from __future__ import annotations

import io
import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import av
import av.logging
from av.stream import Disposition

from adv2e.errors import DataError
from adv2e.files.regular import reading
from adv2e.process.standard_error import Shared
from adv2e.sources.frame import Track, choose

FORMATS = (
    *("mov", "avi", "matroska", "mpegts", "mpeg", "flv", "asf", "ogg", "gif", "apng", "dv", "ivf"),
    *("yuv4mpegpipe", "h264", "hevc", "m4v", "mpegvideo"),
)
"""Demultiplexers of FFmpeg that are used: none of them opens further files."""

_NO_FILM = Disposition.attached_pic | Disposition.timed_thumbnails
_FIRST_BOXES = (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip", b"pnot")
"""Kinds of box with which an MP4 or MOV file can begin."""
_BUFFER_BYTES = 1 << 18


@dataclass(frozen=True)
class Video:
    """An open video file.

    Attributes
    ----------
    path : str
        Its name, for messages.
    size : int
        Its bytes.
    container, stream : Any
        Container of PyAV, and the stream of it that is the film.
    told : list of str
        What is to be told of its tracks, where there are several.
    said : list of str
        Errors that FFmpeg told of when it was opened.
    """

    path: str
    size: int
    container: Any
    stream: Any
    told: list[str]
    said: list[str]

    @property
    def format(self) -> str:
        """Name of the first of the formats that its demultiplexer reads."""
        return str(self.container.format.name).partition(",")[0]


@contextmanager
def opened(path: str, track: str | None = None) -> Iterator[Video]:
    """Open a video within the context, and choose a track of it.

    Parameters
    ----------
    track : str, optional
        Number of the wanted track among those of video, from 0, or its language or title; default:
        the one that players take, which is flagged as default.

    Raises
    ------
    DataError
        It is no video, damaged beyond reading, or has no such track.
    """
    with reading(path):
        file = io.FileIO(path)
    with file:
        size = os.fstat(file.fileno()).st_size
        if not size:
            raise DataError(f"{path}: an empty file")
        # the suffix may help to tell formats apart; the rest of a name could be an address
        file.name = f"video{Path(path).suffix}" if Path(path).suffix.isascii() else "video"
        with overheard() as said:
            container = _container(file, path)
        try:
            stream, told = _chosen(container, track, path)
            yield Video(path, size, container, stream, told, [text for _, _, text in said])
        finally:
            container.close()


def _container(file: io.FileIO, name: str) -> Any:
    try:
        return av.open(
            file,
            "r",
            options={"format_whitelist": ",".join(FORMATS), "protocol_whitelist": "none"},
            metadata_errors="replace",
            buffer_size=_BUFFER_BYTES,
            io_open=_refused,
        )
    except (av.error.FFmpegError, OSError, ValueError) as error:
        why = "not a video that can be read, or damaged"
        file.seek(4)
        if file.read(4) in _FIRST_BOXES:
            why = "cut short, damaged or never finished: its index ('moov') cannot be read"
        raise DataError(f"{name}: {why}") from error


def _refused(*_: Any) -> NoReturn:
    raise OSError("no further files are opened")


def _chosen(container: Any, wanted: str | None, name: str) -> tuple[Any, list[str]]:
    """Return the wanted video track, and what is to be told of it.

    Pictures that are attached, such as covers, are no tracks.
    """
    films = [
        each
        for each in container.streams.video
        if each.codec_context is not None and not each.disposition & _NO_FILM
    ]
    if not films:
        raise DataError(f"{name}: not a video that can be read, or damaged: no film in it")
    usual = container.streams.best("video")
    tracks = []
    for each in films:
        language = each.language if each.language != "und" else None
        named = filter(None, (language, each.metadata.get("title")))
        about = f"{each.codec_context.width}x{each.codec_context.height}"
        tracks.append(Track("/".join(named) or "video", about, is_usual=each is usual))
    _, number, told = choose(wanted, [], tracks, name)
    return films[number or 0], told


def _log(level: int | None, skips_repeated: bool) -> tuple[int | None, bool]:
    """Set what FFmpeg logs; return what it logged before."""
    before = av.logging.get_level(), av.logging.get_skip_repeated()
    av.logging.set_skip_repeated(skips_repeated)
    av.logging.set_level(level)
    return before


_listening = Shared(lambda: _log(av.logging.ERROR, False), lambda before: _log(*before))
# what threads of others say meanwhile is not printed
logging.getLogger("libav").addHandler(logging.NullHandler())


@contextmanager
def overheard() -> Iterator[list[tuple[int, str, str]]]:
    """Give errors that FFmpeg tells in no other way: level, part and text, of this thread alone."""
    with _listening, av.logging.Capture() as said:
        yield said

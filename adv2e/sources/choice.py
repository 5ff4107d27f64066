"""Which decoder a video needs, decided by the file alone, and what it says its light is.

OpenCV is the decoder wherever it gives the pictures that are in the file.  Else it is PyAV, and
without that the video is refused.  The one exception are more than 8 bits of usual dynamic range:
without PyAV they are read with 8, and that is told.
"""

from __future__ import annotations

from dataclasses import dataclass

from adv2e.errors import DataError
from adv2e.sources.colours import HIGH_RANGE, Colours, encoding_of, is_stated
from adv2e.sources.stated import Stated, stated_by
from adv2e.sources.streams import RAW, Stream, examine_stream

_FIELDS = (
    "interlaced: each picture is taken whole, with the two fields that it has of different times;"
    " ffmpeg -vf bwdif makes pictures of them"
)


@dataclass(frozen=True)
class Choice:
    """How a video is to be read.

    Attributes
    ----------
    why_pyav : str
        What it has that OpenCV cannot give; empty if it can.
    colours : Colours
        What it states of them.
    notes : list of str
        Things to tell the user.
    """

    why_pyav: str
    colours: Colours
    notes: tuple[str, ...] = ()


def choose(path: str, height: int) -> Choice:
    """Look at the headers of a video and of all its coded pictures.

    Parameters
    ----------
    path : str
        The video.
    height : int
        Rows that its container states.

    Raises
    ------
    DataError
        Parts of it state transfers that differ.
    """
    stated, stream = stated_by(path), examine_stream(path, height)
    colours = [each.completed(stated.colours) for each in stream.colours] or [stated.colours]
    _check_transfer(path, colours)
    interlaced = stream.interlaced or (stated.interlaced and stream.codec in (RAW, "FFV1"))
    why = _beyond_opencv(stated, stream, interlaced, colours)
    return Choice(why, colours[-1], (_FIELDS,) if interlaced else ())


def _check_transfer(path: str, colours: list[Colours]) -> None:
    meanings = {encoding_of(each.transfer) for each in colours}
    if len({encoding for encoding, _ in meanings}) > 1:
        reasons = " and ".join(sorted(reason for _, reason in meanings))
        raise DataError(f"{path}: its parts differ ({reasons}); cut it where that changes")


def _beyond_opencv(stated: Stated, stream: Stream, interlaced: bool, colours: list[Colours]) -> str:
    transfer = colours[-1].transfer
    if interlaced:
        return "its pictures are interlaced, or could be"
    if not stream.known:
        return f"its codec ({stream.codec}) does not say whether pictures are interlaced"
    if transfer in HIGH_RANGE:
        return f"it has a high dynamic range ({encoding_of(transfer)[0]})"
    if not all(each.kept_by_opencv for each in colours):
        return "it states colours that OpenCV does not keep"
    if not stated.readable and not is_stated(transfer):
        return "its container may state colours that cannot be read here"
    return ""

"""Structure of YUV4MPEG2 files: a line, and then pictures of one size after lines of their own.

References
----------
.. [1] MJPEG Tools, yuv4mpeg(5): the stream header and its tags; ``FRAME`` lines.
"""

from __future__ import annotations

import mmap
import re
from fractions import Fraction

from adv2e.sources.times.rates import FrameRate
from adv2e.sources.video.containers.base import Container, DamagedError, cut_short

MAGIC = b"YUV4MPEG2 "
_LONGEST_LINE = 1024
_SHARE = {"420": (2, 2), "411": (4, 1), "422": (2, 1), "440": (1, 2), "444": (1, 1)}
"""Columns and rows of luma that share a sample of each chroma."""


def examine(data: mmap.mmap, found: Container) -> None:
    """Note the times of the pictures; DamagedError if not all of them are there."""
    place = data.find(b"\n", 0, _LONGEST_LINE)
    tags = data[len(MAGIC) : max(place, 0)].decode("latin-1").split(" ")
    stated = {tag[0]: tag[1:] for tag in tags if tag}
    found.interlaced = stated.get("I", "") in ("t", "b", "m")
    size = _picture_bytes(stated)
    rate = re.fullmatch(r"(\d{1,10}):(\d{1,10})", stated.get("F", ""))
    if place < 0 or size is None:
        return
    place, count = place + 1, 0
    while place < len(data):
        line = data.find(b"\n", place, place + _LONGEST_LINE)
        if data[place : place + 5] != b"FRAME" or line < 0:
            if len(data) - place < 6 and b"FRAME\n".startswith(data[place:]):
                raise cut_short(place + 6 + size, len(data))
            raise DamagedError(f"damaged after frame {count - 1}, at byte {place}")
        place = line + 1 + size
        if place > len(data):
            raise cut_short(place, len(data))
        count += 1
    if not rate or not int(rate[1]) or not int(rate[2]):
        found.pictures = count
        return
    found.rate = Fraction(int(rate[1]), int(rate[2]))
    found.stamps_ns = [FrameRate(found.rate).time_ns(n) for n in range(count)]


def _picture_bytes(stated: dict[str, str]) -> int | None:
    """Return the bytes of a picture, or None for a layout that is not known here."""
    form = re.fullmatch(
        r"(mono|\d{3})(jpeg|paldv|mpeg2|alpha)?(?:p?(\d{1,2}))?", stated.get("C", "420")
    )
    try:
        width, height = int(stated["W"]), int(stated["H"])
    except (KeyError, ValueError):
        return None
    if form is None:
        return None
    samples = width * height
    if form[1] != "mono":
        if form[1] not in _SHARE:
            return None
        across, down = _SHARE[form[1]]
        samples += 2 * (-(-width // across)) * (-(-height // down))
    if form[2] == "alpha":
        samples += width * height
    return samples * (2 if int(form[3] or 8) > 8 else 1)

"""Which decoder a video needs, decided by the file alone, and what it says its light is.

OpenCV is the decoder wherever it gives the pictures that are in the file.  Else it is PyAV, and
without that the video is refused.  The one exception are more than 8 bits of usual dynamic range:
without PyAV they are read with 8, and that is told.
"""

from __future__ import annotations

from adv2e.errors import DataError
from adv2e.sources.video.colours import HIGH_RANGE, Colours, encoding_of, is_stated
from adv2e.sources.video.containers import Container
from adv2e.sources.video.streams import RAW, Stream

_PACKED_ALPHA = (b"BGRA", b"RGBA", b"ARGB", b"ABGR", b"RBA@", b"BRA@", b"@RBA", b"@BRA")
_COLOURS_TOGETHER, _MOST_TOGETHER = (b"RGB", b"BGR"), bytes([48])
_MOST_BITS = bytes([32])


def choose(
    path: str, container: Container, stream: Stream, pixels: bytes = b""
) -> tuple[str, Colours]:
    """Return what a video has that OpenCV cannot give, or "", and the colours that it states.

    `pixels` is FFmpeg's tag of the kind of pixels.

    Raises
    ------
    DataError
        Parts of it state transfers that differ, or it has transparency that cannot be read.
    """
    if container.alpha_apart and stream.codec in ("vp80", "vp90"):
        raise DataError(
            f"{path}: its transparency is beside the pictures, where it cannot be read; make"
            " pictures of it with ffmpeg -c:v libvpx-vp9 -i VIDEO folder/%06d.png"
        )
    colours = [each.completed(container.colours) for each in stream.colours] or [container.colours]
    _check_transfer(path, colours)
    why = _beyond_opencv(container, stream, colours)
    if not why and not container.opaque and _has_alpha(pixels):
        why = "its pixels could be transparent"
    return why, colours[-1]


def bits_of(pixels: bytes) -> int:
    """Return the bits of each colour, 8 or more, by FFmpeg's tag of the kind of pixels."""
    # the tag ends with the number, or begins with it (big endian)
    for letters, number in ((pixels[:3], pixels[3:]), (pixels[1:], pixels[:1])):
        if letters in _COLOURS_TOGETHER and number <= _MOST_TOGETHER:
            return max(ord(number) // 3, 8)
    ends = (pixels[-1:] + pixels[:1]) or b"\0"
    return next((byte for byte in ends if 8 < byte <= 16), 8)


def _has_alpha(pixels: bytes) -> bool:
    # planes are counted in the second letter, with the bits behind, or before for big endian; all
    # letters are names, as Y42B is of three planes
    kinds = {pixels[:2] for pixels in (pixels, pixels[::-1]) if pixels[3:] <= _MOST_BITS}
    return pixels in _PACKED_ALPHA or bool(kinds & {b"Y4", b"G4", b"Y2"})


def _check_transfer(path: str, colours: list[Colours]) -> None:
    meanings = {encoding_of(each.transfer) for each in colours}
    if len({encoding for encoding, _ in meanings}) > 1:
        reasons = " and ".join(sorted(reason for _, reason in meanings))
        raise DataError(f"{path}: its parts differ ({reasons}); cut it where that changes")


def _beyond_opencv(container: Container, stream: Stream, colours: list[Colours]) -> str:
    transfer = colours[-1].transfer
    if stream.interlaced or (container.interlaced and stream.codec == RAW):
        return "its pictures are interlaced, or could be"
    if not stream.known:
        return f"its codec ({stream.codec}) is not one that OpenCV is known to read rightly"
    if not stream.clear:
        return "headers of its coded pictures are damaged, or unlike those that are known"
    if transfer in HIGH_RANGE:
        return f"it has a high dynamic range ({encoding_of(transfer)[0]})"
    if not all(each.kept_by_opencv for each in colours):
        return "it states colours that OpenCV does not keep"
    if not container.readable and not is_stated(transfer):
        return "its container may state colours that cannot be read here"
    return ""

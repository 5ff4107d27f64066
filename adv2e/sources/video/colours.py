"""Codes by which videos state their colours, and the encoding of frames behind each transfer.

References
----------
.. [1] ITU-T H.273 (07/2021), tables 2 (primaries), 3 (transfer) and 4 (matrix).
"""

from __future__ import annotations

from dataclasses import dataclass

from adv2e.effects.frames.encoding import UNKNOWN

UNSTATED = 2

_ENCODINGS = {
    **dict.fromkeys((1, 6, 11, 12, 14, 15), "bt709"),
    4: "gamma:2.2",
    5: "gamma:2.8",
    8: "linear",
    13: "srgb",
    16: "pq",
    18: "hlg",
}
_NAMES = {
    **{1: "BT.709", 4: "gamma 2.2", 5: "gamma 2.8", 6: "BT.601", 7: "SMPTE 240M", 8: "linear"},
    **{9: "logarithmic 100:1", 10: "logarithmic 316:1", 11: "xvYCC", 12: "BT.1361", 13: "sRGB"},
    **{14: "BT.2020", 15: "BT.2020", 16: "PQ", 17: "SMPTE ST 428-1", 18: "HLG"},
}
HIGH_RANGE = (16, 18)
"""Transfers of high dynamic range, PQ and HLG."""

_LIKE_BT709, _MATRICES = (0, 1, 2, 3, 4, 5, 6, 7), (0, 1, 2, 3, 4, 5, 6, 7, 9)
_CURVES_OF_FFMPEG = (0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 12, 13, 14, 15, 17)


@dataclass(frozen=True)
class Colours:
    """Codes for primaries, transfer and matrix."""

    primaries: int = UNSTATED
    transfer: int = UNSTATED
    matrix: int = UNSTATED

    def completed(self, other: Colours) -> Colours:
        """Return them, with what `other` states in place of what they do not."""
        return Colours(
            self.primaries if is_stated(self.primaries) else other.primaries,
            self.transfer if is_stated(self.transfer) else other.transfer,
            self.matrix if is_stated(self.matrix) else other.matrix,
        )

    @property
    def kept_by_opencv(self) -> bool:
        """OpenCV gives the pictures as they are: it neither refuses nor changes their colours.

        Since 4.13 it brings wide primaries to those of BT.709 and high dynamic range to the usual
        one, and leaves alone pictures whose matrix or transfer it does not know.
        """
        return (
            self.primaries in _LIKE_BT709
            and self.transfer in _CURVES_OF_FFMPEG
            and self.matrix in _MATRICES
        )


def is_stated(code: int) -> bool:
    """Tell whether a code says anything: the reserved ones do not."""
    return code not in (0, UNSTATED, 3)


def encoding_of(transfer: int) -> tuple[str, str]:
    """Return the encoding of frames behind a transfer, and how that is known, in a few words.

    A transfer that cannot be decoded gives what `LightDecoder` refuses by name.
    """
    if not is_stated(transfer):
        return "srgb", "usual for video that states no curve"
    name = _NAMES.get(transfer, f"number {transfer}")
    if transfer not in _ENCODINGS:
        return UNKNOWN + name, f"the video states {name}, which is not known here"
    return _ENCODINGS[transfer], f"the video states {name}"

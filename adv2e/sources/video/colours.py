"""Transfers by which videos state their light, and the encoding of frames behind each.

References
----------
.. [1] ITU-T H.273 (07/2021), table 3 (transfer).
"""

from __future__ import annotations

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

r"""Encoding of the frames: how their numbers stand for light.

======== ====================================================================================
linear   light = value
srgb     light = value/12.92 up to 0.04045, ((value + 0.055)/1.055)^2.4 above
gamma:g  light = value^g
======== ====================================================================================

with value and light in 0..1 of full scale.  Colour is decoded first, each channel by itself, and
then weighed to luma in linear light (0.2126 R + 0.7152 G + 0.0722 B).  The pixel is told
DN = 255 light.

References
----------
.. [1] IEC 61966-2-1:1999 (sRGB).
.. [2] Recommendation ITU-R BT.709-6 (luma weights).
"""

from __future__ import annotations

from adv2e.errors import ConfigError


def check_encoding(encoding: str) -> None:
    """Raise ConfigError unless `encoding` is auto, linear, srgb or gamma:<g> with g above 0."""
    if encoding in ("auto", "linear", "srgb"):
        return
    name, _, exponent = encoding.partition(":")
    try:
        if name == "gamma" and 0 < float(exponent) < float("inf"):
            return
    except ValueError:
        pass
    raise ConfigError(
        f"encoding: must be auto, linear, srgb or gamma:<g> (such as gamma:2.2), got {encoding!r}"
    )

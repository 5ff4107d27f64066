"""Encoding of the frames: how their numbers stand for light.

linear      light = value
srgb        light = value/12.92                              up to 0.04045
                    ((value + 0.055)/1.055)^2.4              above [1]
bt709       light = value/4.5                                below 4.5 d
                    ((value + e - 1)/e)^(1/0.45)             above [2]
gamma:g     light = value^g
hlg         light = value^2/3                                up to 0.5
                    (exp((value - c)/a) + b)/12              above [3]
pq          light = (max(value^(1/m2) - c1, 0) / (c2 - c3 value^(1/m2)))^(1/m1) [3]

Value and light are in 0..1 of full scale.  The constants are
a = 0.17883277, b = 1 - 4a, c = 0.5 - a ln(4a); m1 = 2610/16384, m2 = 2523/32, c1 = 3424/4096,
c2 = 2413/128, c3 = 2392/128; e = 1.0993 and d = 0.0181 to as many digits as make the curve smooth
(1.099 and 0.018 leave a step at 0.081).

bt709 and hlg are the inverse of what a camera does to the light (OETF), so the light is that of
the scene.  BT.601 and BT.2020 have the curve of BT.709.  pq is the light of a display (EOTF).  Its
10000 cd/m^2 are white here, so a film made for a display of 1000 cd/m^2 reaches a tenth of white.

Each colour channel is decoded by itself.  Then the channels are weighed to luma in linear light:
0.2126 R + 0.7152 G + 0.0722 B, whatever the primaries.  The pixel sees DN = 255 light.

Applied in adv2e/light/pictures.py.

References
----------
[1] IEC 61966-2-1:1999 (sRGB).
[2] Recommendation ITU-R BT.709-6 (luma weights; opto-electronic transfer).
[3] Recommendation ITU-R BT.2100-2, tables 4 (PQ, as SMPTE ST 2084) and 5 (HLG).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from adv2e.errors import ConfigError, DataError

LABELS = {"frame_encoding": "encoding of the frames"}
SEPARATED_BY = {
    "frame_encoding": "one motion over dark and bright parts: the ratio of events between them"
}

UNKNOWN = "unknown: "
"""Prefix of an encoding that a source states and that is not one of those here."""

LUMA_WEIGHTS = (0.2126, 0.7152, 0.0722)
"""Shares of red, green and blue light in luma."""

_FULL_SCALES = {"uint8": 255.0, "uint16": 65535.0, "float32": 1.0, "float64": 1.0}


_BT709_D, _BT709_E = 0.018053968510807, 1.09929682680944
_HLG_A = 0.17883277
_HLG_B = 1 - 4 * _HLG_A
_HLG_C = 0.5 - _HLG_A * math.log(4 * _HLG_A)
_PQ_M1, _PQ_M2 = 2610 / 16384, 2523 / 32
_PQ_C1, _PQ_C2, _PQ_C3 = 3424 / 4096, 2413 / 128, 2392 / 128


def check_encoding(encoding: str) -> None:
    """Raise ConfigError unless `encoding` is auto, a curve, or gamma:<g> with g above 0."""
    if encoding == "auto" or encoding in _CURVES:
        return
    name, _, exponent = encoding.partition(":")
    try:
        if name == "gamma" and 0 < float(exponent) < float("inf"):
            return
    except ValueError:
        pass
    raise ConfigError(f"encoding: must be auto, {_KNOWN}, got {encoding!r}")


def is_light(dtype: DTypeLike) -> bool:
    """Tell whether frames may be of `dtype`."""
    return np.dtype(dtype).name in _FULL_SCALES


def full_scale_of(dtype: DTypeLike) -> float:
    """Return the number that means white in frames of `dtype`: 255, 65535 or 1.0.

    Raises
    ------
    DataError
        For data types that have no such number.
    """
    return _full_scale(np.dtype(dtype))


@cache  # it is asked of every frame, and NumPy makes the name anew
def _full_scale(dtype: np.dtype[Any]) -> float:
    if dtype.name not in _FULL_SCALES:
        raise DataError(f"frames of {dtype.name}: give {', '.join(_FULL_SCALES)}")
    return _FULL_SCALES[dtype.name]


def encoding_of_images(dtype: DTypeLike) -> str:
    """Return the encoding of still images and arrays for ``auto``: 8 bits sRGB, else linear."""
    return "srgb" if np.dtype(dtype) == np.uint8 else "linear"


def decode_values(values: NDArray[Any], encoding: str, full_scale: float) -> NDArray[Any]:
    """Return DN = 255 light of encoded values, in their own float type; above white they go on."""
    if encoding == "linear":
        # multiplied first: whole numbers of 0..255 come back as they are
        return np.divide(values * 255.0, full_scale, dtype=values.dtype)
    value = np.divide(values, full_scale, dtype=values.dtype)
    if encoding in _CURVES:
        light = _CURVES[encoding](value)
    else:
        light = np.power(value, float(encoding.partition(":")[2]), dtype=values.dtype)
    light *= 255.0
    return light


def encode_light(light: NDArray[Any], encoding: str) -> NDArray[Any]:
    """Return the value, 1 for white, whose light is `light` [DN], in its own float type.

    The inverse of :func:`decode_values`; negative light has the value of none, above white curves
    go on.

    Raises
    ------
    ConfigError
        For auto, pq and hlg, which nothing needs to be encoded to, and for what is no curve.
    """
    check_encoding(encoding)
    share = np.maximum(light, 0) / light.dtype.type(255)
    value: NDArray[Any]
    if encoding == "linear":
        value = share
    elif encoding == "srgb":
        value = np.where(share <= 0.0031308, 12.92 * share, 1.055 * share ** (1 / 2.4) - 0.055)
    elif encoding == "bt709":
        above = _BT709_E * share**0.45 - (_BT709_E - 1)
        value = np.where(share < _BT709_D, 4.5 * share, above)
    elif encoding.startswith("gamma:"):
        value = np.power(share, 1 / float(encoding.partition(":")[2]), dtype=share.dtype)
    else:
        raise ConfigError(f"encoding: must be linear, srgb, bt709 or gamma:<g>, got {encoding!r}")
    return value


def _linear(value: NDArray[Any]) -> NDArray[Any]:
    return value


def _srgb(value: NDArray[Any]) -> NDArray[Any]:
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def _bt709(value: NDArray[Any]) -> NDArray[Any]:
    above = ((value + (_BT709_E - 1)) / _BT709_E) ** (1 / 0.45)
    return np.where(value < 4.5 * _BT709_D, value / 4.5, above)


def _hlg(value: NDArray[Any]) -> NDArray[Any]:
    # floats may be above white, where the curve goes on; far above they have no light to stand for
    above = (np.exp(np.minimum((value - _HLG_C) / _HLG_A, 80.0)) + _HLG_B) / 12
    return np.where(value <= 0.5, value * value / 3, above)


def _pq(value: NDArray[Any]) -> NDArray[Any]:
    # the curve ends at white: beyond, its denominator goes through zero
    root = np.minimum(value, 1) ** (1 / _PQ_M2)
    light: NDArray[Any] = np.maximum(root - _PQ_C1, 0) / (_PQ_C2 - _PQ_C3 * root)
    return light ** (1 / _PQ_M1)


_CURVES: dict[str, Callable[[NDArray[Any]], NDArray[Any]]] = {
    "linear": _linear,
    "srgb": _srgb,
    "bt709": _bt709,
    "pq": _pq,
    "hlg": _hlg,
}
"""Light of values, both in 0..1 of white, by the name of the encoding."""

_KNOWN = f"{', '.join(_CURVES)} or gamma:<g> (such as gamma:2.2)"


class LightDecoder:
    """Turns frames as read into linear light, luma, in DN.

    Parameters
    ----------
    encoding : str
        Any but ``auto``, which must be settled before.
    full_scale : float
        The number that means white.
    dtype : uint8, uint16, float32 or float64
        Data type of the frames.
    colour : bool
        Frames are (rows, columns, 3) RGB rather than (rows, columns).

    Raises
    ------
    ConfigError
        `encoding` is unknown.
    DataError
        `dtype` is not one of the four.

    Notes
    -----
    Whole numbers go through a table for each channel, computed in float64 and multiplied by the
    luma weight beforehand, so that a frame costs look-ups and two additions.
    """

    def __init__(self, encoding: str, full_scale: float, dtype: DTypeLike, colour: bool) -> None:
        if encoding.startswith(UNKNOWN):
            raise ConfigError(
                f"frames.encoding: auto: frames are said to be {encoding[len(UNKNOWN) :]}, which is"
                f" not known; say what they are: {_KNOWN}"
            )
        check_encoding(encoding)
        if encoding == "auto":
            raise ConfigError("encoding: auto must be settled by the source of the frames")
        full_scale_of(dtype)
        self.encoding = encoding
        self.full_scale = full_scale
        self.dtype = np.dtype(dtype)
        self.colour = colour
        self._tables: list[NDArray[np.float32]] = []
        if self.dtype.kind == "u":
            codes = np.arange(np.iinfo(self.dtype).max + 1, dtype=np.float64)
            weights = LUMA_WEIGHTS if colour else (1.0,)
            with np.errstate(over="ignore"):  # what becomes infinite is refused with its frame
                dn = decode_values(codes, encoding, full_scale)
                self._tables = [(weight * dn).astype(np.float32) for weight in weights]

    @property
    def grey_table(self) -> NDArray[np.float32] | None:
        """Light [DN] of each grey value of 8 bits; None for other frames."""
        return self._tables[0] if self.dtype == np.uint8 and not self.colour else None

    def decode(self, image: NDArray[Any], alpha: NDArray[Any] | None = None) -> NDArray[Any]:
        """Return the light of an image, luma [DN of 255], float64 for frames of float64.

        `alpha` (rows, columns) says how much of each pixel is there before black, 0..1.
        """
        if image.dtype != self.dtype or image.ndim != (3 if self.colour else 2):
            raise ValueError(
                f"a frame of {image.dtype} and shape {image.shape} for a decoder of {self.dtype},"
                f" {'colour' if self.colour else 'grey'}"
            )
        light = self._decode(image)
        return light if alpha is None else light * alpha

    def over_black(self, image: NDArray[Any], alpha: NDArray[Any]) -> NDArray[Any]:
        """Return the whole numbers whose light is nearest to that of `image` times `alpha`."""
        return self.encode(self.shares(image, alpha))

    def shares(
        self, image: NDArray[Any], alpha: NDArray[Any] | None = None
    ) -> Iterator[NDArray[Any]]:
        """Yield the share of each channel in the light of an image [DN]; :meth:`decode` adds."""
        planes = np.moveaxis(image, -1, 0) if self.colour else image[np.newaxis]
        weights = LUMA_WEIGHTS if self.colour else (1.0,)
        for number, (plane, weight) in enumerate(zip(planes, weights, strict=True)):
            if self._tables:
                share = self._tables[number].take(plane)
            else:
                share = weight * decode_values(plane, self.encoding, self.full_scale)
            yield share if alpha is None else share * alpha

    def encode(self, shares: Iterable[NDArray[Any]]) -> NDArray[Any]:
        """Return the whole numbers whose light is nearest, in each channel, to its share."""
        planes = []
        for share, table in zip(shares, self._tables, strict=True):
            middles = (table[1:] + table[:-1]) / 2
            planes.append(np.searchsorted(middles, share).astype(self.dtype))
        return np.stack(planes, axis=-1) if self.colour else planes[0]

    def _decode(self, image: NDArray[Any]) -> NDArray[Any]:
        if self._tables:
            return self._look_up(image)
        with np.errstate(over="ignore"):  # see above
            dn = decode_values(image, self.encoding, self.full_scale)
            if not self.colour:
                return dn
            red, green, blue = LUMA_WEIGHTS
            luma: NDArray[Any] = red * dn[..., 0] + green * dn[..., 1] + blue * dn[..., 2]
        return luma

    def _look_up(self, image: NDArray[Any]) -> NDArray[Any]:
        if not self.colour:
            return self._tables[0].take(image)
        # imported late: checking an encoding needs no compiled code
        from adv2e.kernel.effect_loops import fill_luma  # noqa: PLC0415

        light = np.empty(image.shape[:2], np.float32)
        # writable, too: one type for the compiled code
        pixels = np.require(image, requirements=["C", "W"]).reshape(-1, 3)
        red, green, blue = self._tables
        fill_luma(pixels, red, green, blue, light.reshape(-1))
        return light

"""Random numbers as functions of (seed, effect, pixel, draw).

Philox4x32-10, a counter-based generator: the key is the seed, the counter names the effect, the
pixel and the number of the draw.  No state, so nothing depends on threads, tiles or chunks, and an
effect that is switched on does not change the draws of another.

References
----------
.. [1] J. K. Salmon, M. A. Moraes, R. O. Dror, D. E. Shaw, "Parallel random numbers: as easy as
   1, 2, 3", SC'11, doi:10.1145/2063384.2063405.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from adv2e.jit import kernel

# Streams: one for each kind of draw; never renumber, or old seeds give other events.
ON_THRESHOLD = 1
OFF_THRESHOLD = 2
INITIAL_REFERENCE = 3
SHOT_TIME = 4
SHOT_KIND = 5
HOT_CHOICE = 6
HOT_TIME = 7
LEAK_PERIOD = 8
PHOTORECEPTOR = 9
DEAD_CHOICE = 10
LOSS = 11

_LOW = np.uint64(0xFFFFFFFF)
_M0 = np.uint64(0xD2511F53)
_M1 = np.uint64(0xCD9E8D57)
_W0 = np.uint64(0x9E3779B9)
_W1 = np.uint64(0xBB67AE85)
_32 = np.uint64(32)
_5 = np.uint64(5)
_6 = np.uint64(6)


@kernel
def philox(
    c0: np.uint64, c1: np.uint64, c2: np.uint64, c3: np.uint64, k0: np.uint64, k1: np.uint64
) -> tuple[np.uint64, np.uint64, np.uint64, np.uint64]:
    """Philox4x32-10: four 32-bit words (in uint64) from a counter and a key of 32-bit words."""
    for _ in range(10):
        p0 = _M0 * c0
        p1 = _M1 * c2
        c0 = (p1 >> _32) ^ c1 ^ k0
        c1 = p1 & _LOW
        c2 = (p0 >> _32) ^ c3 ^ k1
        c3 = p0 & _LOW
        k0 = (k0 + _W0) & _LOW
        k1 = (k1 + _W1) & _LOW
    return c0, c1, c2, c3


@kernel
def uniforms(seed: int, stream: int, pixel: int, draw: float) -> tuple[float, float]:
    """Return two independent uniform numbers in (0, 1), 53 bits each."""
    s = np.uint64(seed)
    d = np.uint64(draw)
    a, b, c, e = philox(
        np.uint64(pixel) & _LOW, np.uint64(stream), d & _LOW, d >> _32, s & _LOW, s >> _32
    )
    scale = 1.0 / 9007199254740992.0
    u = (np.float64(a >> _5) * 67108864.0 + np.float64(b >> _6) + 0.5) * scale
    v = (np.float64(c >> _5) * 67108864.0 + np.float64(e >> _6) + 0.5) * scale
    return u, v


@kernel
def normal(seed: int, stream: int, pixel: int, draw: float) -> float:
    """Return a standard normal number (Box and Muller)."""
    u, v = uniforms(seed, stream, pixel, draw)
    return math.sqrt(-2.0 * math.log(u)) * math.cos(2.0 * math.pi * v)


@kernel
def exponential(seed: int, stream: int, pixel: int, draw: float) -> float:
    """Return an exponential number of mean 1."""
    return -math.log(uniforms(seed, stream, pixel, draw)[0])


@kernel
def _fill_uniforms(
    seed: int,
    stream: int,
    pixels: NDArray[np.int64],
    draws: NDArray[np.int64],
    out: NDArray[np.float64],
) -> None:
    for k in range(out.shape[0]):
        out[k] = uniforms(seed, stream, pixels[k], draws[k])[0]


def uniform_array(
    seed: int, stream: int, pixels: ArrayLike, draws: ArrayLike
) -> NDArray[np.float64]:
    """Return uniform numbers in (0, 1) for arrays of pixels and draws, broadcast to one shape."""
    both = np.broadcast_arrays(np.asarray(pixels, np.int64), np.asarray(draws, np.int64))
    out = np.empty(both[0].shape)
    # writable, too: one type for the compiled code
    flat = [np.require(part, requirements=["C", "W"]).reshape(-1) for part in both]
    _fill_uniforms(seed, stream, flat[0], flat[1], out.reshape(-1))
    return out


@kernel
def _fill_next(
    seed: int,
    stream: int,
    pixels: NDArray[np.int64],
    numbers: NDArray[np.int64],
    out: NDArray[np.float64],
) -> None:
    for k in range(out.shape[0]):
        pixel = pixels[k]
        out[k] = uniforms(seed, stream, pixel, numbers[pixel])[0]
        numbers[pixel] += 1


def next_uniforms(
    seed: int, stream: int, pixels: NDArray[np.int64], numbers: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the next uniform number in (0, 1) of each of `pixels`, in turn.

    Parameters
    ----------
    pixels : (n,) int64
        Pixels, as often as they draw.
    numbers : (pixels,) int64
        How often each pixel has drawn before; counted on.
    """
    out = np.empty(pixels.size)
    _fill_next(seed, stream, np.ascontiguousarray(pixels), numbers, out)
    return out

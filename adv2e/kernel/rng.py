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

from adv2e.compiled import inlined, kernel
from adv2e.kernel import special

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
PHOTORECEPTOR_STEPS = 10
DEAD_CHOICE = 11
LOSS = 12
REQUEST = 13
LEAK_AGE = 14
LEAK_RUNNING = 15
HOT_RATE = 16
PHOTORECEPTOR_BEHIND = 17
PHOTORECEPTOR_SAMPLES = 18
PHOTORECEPTOR_BETWEEN = 19
PHOTORECEPTOR_RUNNING = 20
PHOTORECEPTOR_SLOW = 21
DOUBLE_READ = 22

LARGEST_SEED = (1 << 64) - 1
"""Seeds are the 64 bits of the generator's key."""

_LOW = np.uint64(0xFFFFFFFF)
_M0 = np.uint64(0xD2511F53)
_M1 = np.uint64(0xCD9E8D57)
_W0 = np.uint64(0x9E3779B9)
_W1 = np.uint64(0xBB67AE85)
_32 = np.uint64(32)
_2, _3, _4, _5, _6, _7, _8, _9 = (np.uint64(k) for k in range(2, 10))


def key_of(seed: int) -> np.uint64:
    """Return `seed` as compiled code takes it: of one type, so that none is compiled anew."""
    return np.uint64(seed)


@kernel
def _round(c0, c1, c2, c3, k0, k1):
    p0 = np.uint64(_M0 * c0)
    p1 = np.uint64(_M1 * c2)
    return (p1 >> _32) ^ c1 ^ k0, p1 & _LOW, (p0 >> _32) ^ c3 ^ k1, p0 & _LOW


@inlined
def philox_7(c0, c1, c2, c3, k0, k1):
    """Philox4x32-7, the fewest rounds that pass BigCrush (Salmon et al.), as :func:`philox`."""
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, k0, k1)
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, k0 + _W0 & _LOW, k1 + _W1 & _LOW)
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, k0 + _W0 * _2 & _LOW, k1 + _W1 * _2 & _LOW)
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, k0 + _W0 * _3 & _LOW, k1 + _W1 * _3 & _LOW)
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, k0 + _W0 * _4 & _LOW, k1 + _W1 * _4 & _LOW)
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, k0 + _W0 * _5 & _LOW, k1 + _W1 * _5 & _LOW)
    return _round(c0, c1, c2, c3, k0 + _W0 * _6 & _LOW, k1 + _W1 * _6 & _LOW)


@inlined
def philox(c0, c1, c2, c3, k0, k1):
    """Philox4x32-10: four 32-bit words (in uint64) from a counter and a key of 32-bit words.

    Written out so that a loop over pixels vectorises.
    """
    c0, c1, c2, c3 = philox_7(c0, c1, c2, c3, k0, k1)
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, k0 + _W0 * _7 & _LOW, k1 + _W1 * _7 & _LOW)
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, k0 + _W0 * _8 & _LOW, k1 + _W1 * _8 & _LOW)
    return _round(c0, c1, c2, c3, k0 + _W0 * _9 & _LOW, k1 + _W1 * _9 & _LOW)


@kernel
def _uniforms_of(a, b, c, d):
    """Two uniform numbers in (0, 1), 53 bits each, from four 32-bit words."""
    scale = 1.0 / 9007199254740992.0
    u = (np.float64(a >> _5) * 67108864.0 + np.float64(b >> _6) + 0.5) * scale
    v = (np.float64(c >> _5) * 67108864.0 + np.float64(d >> _6) + 0.5) * scale
    return u, v


@kernel
def uniforms(seed, stream, pixel, draw):
    """Return two independent uniform numbers in (0, 1), 53 bits each."""
    s, d = np.uint64(seed), np.uint64(draw)
    pixel, stream = np.uint64(pixel) & _LOW, np.uint64(stream)
    a, b, c, e = philox(pixel, stream, d & _LOW, d >> _32, s & _LOW, s >> _32)
    return _uniforms_of(a, b, c, e)


@kernel
def normal_of(u, v):
    """Return the standard normal number of two uniform ones (Box and Muller)."""
    return math.sqrt(-2.0 * math.log(u)) * math.cos(2.0 * math.pi * v)


@kernel
def normal(seed, stream, pixel, draw):
    """Return a standard normal number."""
    u, v = uniforms(seed, stream, pixel, draw)
    return normal_of(u, v)


@kernel
def exponential(seed, stream, pixel, draw):
    """Return an exponential number of mean 1."""
    return -math.log(uniforms(seed, stream, pixel, draw)[0])


@kernel
def uniforms_of_pixels(seed, stream, first, u, v):
    """Draw the uniform numbers of :func:`uniforms`, draw 0 of pixels first.., into `u` and `v`.

    Vectorises, which a loop that goes on to call a logarithm of the C library does not.
    """
    s = np.uint64(seed)
    low, high = s & _LOW, s >> _32
    none, stream = np.uint64(0), np.uint64(stream)
    for k in range(u.shape[0]):
        a, b, c, e = philox(np.uint64(first + k) & _LOW, stream, none, none, low, high)
        u[k], v[k] = _uniforms_of(a, b, c, e)


@kernel
def _fill_uniforms(seed, stream, pixels, draws, out):
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
    _fill_uniforms(key_of(seed), stream, flat[0], flat[1], out.reshape(-1))
    return out


@kernel
def _fill_next(seed, stream, pixels, numbers, out):
    for k in range(out.shape[0]):
        pixel = pixels[k]
        out[k] = uniforms(seed, stream, pixel, numbers[pixel])[0]
        numbers[pixel] += 1


def next_uniforms(
    seed: int, stream: int, pixels: NDArray[np.int64], numbers: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the next uniform number in (0, 1) of each of `pixels`, as often as they draw.

    `numbers` counts on how often each pixel of all has drawn before.
    """
    out = np.empty(pixels.size)
    _fill_next(key_of(seed), stream, np.ascontiguousarray(pixels), numbers, out)
    return out


_SIN = (1.0, -1 / 6, 1 / 120, -1 / 5040, 1 / 362880, -1 / 39916800)
_COS = (1.0, -1 / 2, 1 / 24, -1 / 720, 1 / 40320, -1 / 3628800, 1 / 479001600)
_HALF_PI = 0.5 * math.pi


@kernel
def _cos_sin(turns):
    """Cosine and sine of 2 pi turns, 0 <= turns <= 1, good to 1e-11, for loops over pixels."""
    quarter = np.floor(4.0 * turns + 0.5)
    t = (4.0 * turns - quarter) * _HALF_PI
    g = t * t
    s = _SIN[2] + g * (_SIN[3] + g * (_SIN[4] + g * _SIN[5]))
    s = t * (_SIN[0] + g * (_SIN[1] + g * s))
    c = _COS[3] + g * (_COS[4] + g * (_COS[5] + g * _COS[6]))
    c = _COS[0] + g * (_COS[1] + g * (_COS[2] + g * c))
    odd = (quarter == 1.0) | (quarter == 3.0)
    x, y = (s, c) if odd else (c, s)
    x = -x if (quarter == 1.0) | (quarter == 2.0) else x
    y = -y if (quarter == 2.0) | (quarter == 3.0) else y
    return x, y


@kernel
def normals_of_four(seed, stream, first, count, block, out):
    """Draw four standard normal numbers for each of the pixels first.. into `out`, (4, count..).

    One block of Philox and two pairs of Box and Muller a pixel, from uniforms of 32 bits: tails
    end at 6.8.
    """
    s, d, stream = np.uint64(seed), np.uint64(block), np.uint64(stream)
    low, high, k0, k1 = d & _LOW, d >> _32, s & _LOW, s >> _32
    scale = 1.0 / 4294967296.0
    a, b, c, e = out[0], out[1], out[2], out[3]
    for k in range(count):
        w0, w1, w2, w3 = philox(np.uint64(first + k) & _LOW, stream, low, high, k0, k1)
        r = math.sqrt(-2.0 * special.log((np.float64(w0) + 0.5) * scale))
        x, y = _cos_sin((np.float64(w1) + 0.5) * scale)
        a[k] = r * x
        b[k] = r * y
        r = math.sqrt(-2.0 * special.log((np.float64(w2) + 0.5) * scale))
        x, y = _cos_sin((np.float64(w3) + 0.5) * scale)
        c[k] = r * x
        e[k] = r * y


_f = np.float32
_HALF_32, _SCALE_32, _TURN_32 = _f(0.5), _f(1.0 / 2147483648.0), _f(1.0 / 1073741824.0)
_SIN_32 = tuple(_f(c) for c in (1.5707963, -0.64596409, 0.07969258, -0.0046817, 0.00016044))
_COS_32 = tuple(_f(c) for c in (1.0, -1.2337005, 0.25366950, -0.02086348, 0.00091926, -0.0000252))


@kernel
def _pair32(a, b):
    """Two standard normal numbers in single precision from two 32-bit words; tails end at 6.6."""
    u = (_f(np.int32(a >> np.uint32(1))) + _HALF_32) * _SCALE_32
    r = _f(math.sqrt(_f(-2.0) * special.log32(u)))
    # an angle within an eighth of a turn, a sign of its cosine, and which of the two comes first
    low = np.int32(np.int32(b & np.uint32(0x3FFFFFFF)) - np.int32(0x20000000))
    t = (_f(low) + _HALF_32) * _TURN_32
    g = t * t
    s, c = _SIN_32, _COS_32
    sine = t * (s[0] + g * (s[1] + g * (s[2] + g * (s[3] + g * s[4]))))
    cosine = c[0] + g * (c[1] + g * (c[2] + g * (c[3] + g * (c[4] + g * c[5]))))
    cosine = -cosine if (b & np.uint32(0x80000000)) != np.uint32(0) else cosine
    swapped = (b & np.uint32(0x40000000)) != np.uint32(0)
    return r * (sine if swapped else cosine), r * (cosine if swapped else sine)


@kernel
def words_of_pixels(seed, stream, pixels, block, words):
    """Draw the four 32-bit words of a block for each of `pixels` into `words`, (4, pixels)."""
    s, d, stream = np.uint64(seed), np.uint64(block), np.uint64(stream)
    low, high, k0, k1 = d & _LOW, d >> _32, s & _LOW, s >> _32
    a, b, c, e = words[0], words[1], words[2], words[3]
    for k in range(pixels.shape[0]):
        w0, w1, w2, w3 = philox_7(np.uint64(pixels[k]) & _LOW, stream, low, high, k0, k1)
        a[k], b[k], c[k], e[k] = np.uint32(w0), np.uint32(w1), np.uint32(w2), np.uint32(w3)


@kernel
def words_of_blocks(seed, stream, pixels, blocks, more, words):
    """Draw the words of block blocks[k] + `more` of each of `pixels` into `words`, (4, pixels)."""
    s, stream, more = np.uint64(seed), np.uint64(stream), np.int64(more)
    k0, k1 = s & _LOW, s >> _32
    a, b, c, e = words[0], words[1], words[2], words[3]
    for k in range(pixels.shape[0]):
        d = np.uint64(blocks[k] + more)
        w0, w1, w2, w3 = philox_7(np.uint64(pixels[k]) & _LOW, stream, d & _LOW, d >> _32, k0, k1)
        a[k], b[k], c[k], e[k] = np.uint32(w0), np.uint32(w1), np.uint32(w2), np.uint32(w3)


@kernel
def normals_of_words(count, words, normals):
    """Make four standard normal numbers of four words each: (4, count) of both.

    In a loop of its own: numbers of 32 bits, as many at a time as fit a vector.
    """
    for h in range(2):
        a, b, x, y = words[2 * h], words[2 * h + 1], normals[2 * h], normals[2 * h + 1]
        for k in range(count):
            x[k], y[k] = _pair32(a[k], b[k])


@kernel
def normals32_of_pixels(seed, stream, pixels, block, words, normals):
    """Draw four standard normal numbers for each of `pixels`: `normals`, (4, pixels) float32."""
    words_of_pixels(seed, stream, pixels, block, words)
    normals_of_words(pixels.shape[0], words, normals)


@kernel
def normals32_of_blocks(seed, stream, pixels, blocks, more, words, normals):
    """Draw the numbers of block blocks[k] + `more` of each of `pixels`."""
    words_of_blocks(seed, stream, pixels, blocks, more, words)
    normals_of_words(pixels.shape[0], words, normals)

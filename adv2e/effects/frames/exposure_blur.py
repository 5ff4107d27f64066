"""Exposure blur: a frame is the mean of the light over its exposure, the events are sharp.

    DN_frame(t) = 1/T * integral of DN(s) ds from t - T/2 to t + T/2

T           frames.exposure_us, or the exposure of each frame where a list says it
t           time of the frame, the middle of its exposure

The pixel sees the light itself, so what the exposure took away is put back.  This module seeks the
light at the times of the frames whose means are the frames.  Changes faster than 1/T are not in the
frames and cannot come back.  Noise of the frames grows with what does come back.  Between the
frames the light is linear in time here.  Where frames are interpolated along the motion, the module
motion_blur takes the place of this one.

B is the matrix of the mean over the exposure: its rows have sum 1 and the variance T^2/12 of the
exposure.  Fifty steps of the Richardson-Lucy iteration [1, 2] start from the frames themselves.
Total variation in time holds down noise and ringing [3]:

    y   <-  y / (1 - lambda (g_k - g_(k-1))) * B'(DN_frame / (B y)) / (B' 1)
    g_k  =  d_k / sqrt(d_k^2 + epsilon^2)
    d_k  =  2 (y_(k+1) - y_k) / (y_(k+1) + y_k)

B' is B transposed, lambda = 0.004, epsilon = 0.02; d_k is the contrast from frame k to the next, as
the pixel sees it.  Light stays positive, and edges that passed within the exposure come back as
steps.  The sequence is solved in blocks, each with a margin of at least two exposures before and
behind it.

References
----------
[1] W. H. Richardson, "Bayesian-Based Iterative Method of Image Restoration", JOSA 62(1), 1972,
    doi:10.1364/JOSA.62.000055.
[2] L. B. Lucy, "An iterative technique for the rectification of observed distributions",
    Astronomical Journal 79, 1974, doi:10.1086/111605.
[3] N. Dey, L. Blanc-Feraud, C. Zimmer, P. Roux, Z. Kam, J.-C. Olivo-Marin, J. Zerubia,
    "Richardson-Lucy Algorithm with Total Variation Regularization for 3D Confocal Microscope
    Deconvolution", Microscopy Research and Technique 69(4), 2006, doi:10.1002/jemt.20294.
[4] C. Brandli, R. Berner, M. Yang, S.-C. Liu, T. Delbruck, "A 240 x 180 130 dB 3 us Latency Global
    Shutter Spatiotemporal Vision Sensor", IEEE JSSC 49(10), 2014, doi:10.1109/JSSC.2014.2342715
    (frames integrate, events do not).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.effects.hooks import Frames, Hooks, LightFrame
from adv2e.kernel.effect_loops import sharpen

LABELS = {"exposure_blur": "exposure of the frames"}
SEPARATED_BY = {"exposure_blur": "small, fast features at two exposure times"}

Array = NDArray[np.float64]

_ITERATIONS = 50
_VARIATION = 0.004
_SOFT = 0.02
"""Lambda and epsilon: what a step of light costs, and the contrast below which it costs less."""

_LEAST_DN = 0.05
"""Light below this counts as this: what is zero would stay zero."""

_MARGIN_EXPOSURES = 2.0
_MARGIN_FRAMES = 6
_BLOCK_EXPOSURES = 4.0
_BLOCK_FRAMES = 12
_STRIP = 1024
"""Pixels that are solved at a time."""


def means(times: Array, exposure: float | Array) -> Array:
    """Return the matrix that takes light at `times` to its means over exposures about them.

    Its rows have sum 1 and, as near as it comes, the variance of the exposure: a mixture of the
    means over light that is constant about each time, and over light that is linear between.
    Towards both ends the exposures are cut, on both sides alike, to what lies between the first and
    the last time.
    """
    widths = np.minimum(exposure, 2.0 * np.minimum(times - times[0], times[-1] - times))
    first, last = (times - 0.5 * widths)[:, None], (times + 0.5 * widths)[:, None]
    middles = 0.5 * (times[1:] + times[:-1])
    starts, ends = np.append(times[0], middles), np.append(middles, times[-1])
    steps = np.clip(np.minimum(ends, last) - np.maximum(starts, first), 0.0, None)
    lines = _under_hats(last, times) - _under_hats(first, times)
    open_ = widths > 0.0
    scale = np.where(open_, widths, 1.0)[:, None]
    steps, lines = steps / scale, lines / scale
    squared = (times[None, :] - times[:, None]) ** 2
    narrow, wide = (steps * squared).sum(axis=1), (lines * squared).sum(axis=1)
    way = np.where(wide > narrow, wide - narrow, 1.0)
    share = np.clip((widths**2 / 12.0 - narrow) / way, 0.0, 1.0)[:, None]
    mixed = (1.0 - share) * steps + share * lines
    return np.asarray(np.where(open_[:, None], mixed, np.eye(times.size)))


def _under_hats(at: Array, times: Array) -> Array:
    """Return the integral up to `at` (n, 1) of the hat function about each of `times` (m,)."""
    steps = np.diff(times)
    before, behind = np.append(1.0, steps), np.append(steps, 1.0)
    up = np.clip(at - (times - before), 0.0, before)
    down = np.clip(at - times, 0.0, behind)
    return np.asarray(up * up / (2.0 * before) + down - down * down / (2.0 * behind))


def sharpened(
    frames: list[NDArray[Any]], times: Array, exposure: float | Array, begin: int, end: int
) -> list[NDArray[Any]]:
    """Return the light at the times begin..end of `frames` that average it over an exposure.

    `frames` and `times` are those of a block with its margins; the exposure, of all or of each, is
    in their unit.
    """
    matrix = means(times, exposure)
    used = matrix > 0.0
    first = used.argmax(axis=1)
    last = matrix.shape[1] - used[:, ::-1].argmax(axis=1)
    dtype = frames[0].dtype
    weights, norm = matrix.astype(dtype), (1.0 / matrix.sum(axis=0)).astype(dtype)
    variation = np.array([_VARIATION, _SOFT * _SOFT], dtype)
    made = [np.empty_like(frame) for frame in frames[begin:end]]
    pixels = frames[0].size
    for lo in range(0, pixels, _STRIP):
        hi = min(lo + _STRIP, pixels)
        blurred = np.stack([frame.reshape(-1)[lo:hi] for frame in frames])
        np.maximum(blurred, dtype.type(_LEAST_DN), out=blurred)
        light, factor = blurred.copy(), np.empty_like(blurred)
        mean = np.empty(hi - lo, dtype)
        rules = blurred, first, last, weights, norm, _ITERATIONS, variation
        sharpen(*rules, light, mean, factor)
        for frame, row in zip(made, light[begin:end], strict=True):
            frame.reshape(-1)[lo:hi] = row
    return made


class ExposureBlurHooks(Hooks):
    """Puts back what an exposure of `exposure_us` took away, or `each_us` of each frame."""

    stage = "frames"

    def __init__(self, exposure_us: float, each_us: Sequence[float] = ()) -> None:
        super().__init__()
        self._exposure = max([exposure_us, *each_us]) * 1e3
        self._each = np.multiply(each_us, 1e3)
        self._dropped = 0

    def light(self, frames: Frames) -> Frames:
        """Yield the light at the times of the frames, a block at a time."""
        held: list[LightFrame] = []
        done = 0  # of those held: the margin before the block
        for t_ns, light in frames:
            held.append((t_ns, np.ascontiguousarray(light)))
            end = self._block_end(held, done)
            if end:
                yield from self._block(held, done, end)
                keep = self._first_of_margin(held, end)
                del held[:keep]
                self._dropped += keep
                done = end - keep
        yield from self._block(held, done, len(held))

    def _block_end(self, held: list[LightFrame], begin: int) -> int:
        """Return the end of the block that starts at `begin`, 0 while frames are missing."""
        start, newest = held[begin][0] if begin < len(held) else held[-1][0], held[-1][0]
        span = _BLOCK_EXPOSURES * self._exposure
        for end in range(begin + _BLOCK_FRAMES, len(held) - _MARGIN_FRAMES + 1):
            last = held[end - 1][0]
            if last - start >= span:
                enough = newest - last >= _MARGIN_EXPOSURES * self._exposure
                return end if enough else 0
        return 0

    def _first_of_margin(self, held: list[LightFrame], begin: int) -> int:
        """Return the first frame that the block starting at `begin` needs before it."""
        first = max(0, begin - _MARGIN_FRAMES)
        while first > 0 and held[begin][0] - held[first][0] < _MARGIN_EXPOSURES * self._exposure:
            first -= 1
        return first

    def _block(self, held: list[LightFrame], begin: int, end: int) -> Frames:
        if begin == end:
            return
        origin = held[0][0]
        times = np.array([t_ns - origin for t_ns, _ in held], np.float64)
        frames = [light for _, light in held]
        if len(frames) == 1:
            yield held[0]
            return
        each = self._each[self._dropped : self._dropped + len(held)]
        made = sharpened(frames, times, each if each.size else self._exposure, begin, end)
        for (t_ns, _), light in zip(held[begin:end], made, strict=True):
            yield t_ns, light

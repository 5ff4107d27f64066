r"""Passage times in a real recording, as far as its frames tell them.

While a shutter is open a pixel gathers the light before an edge, a, up to its passage, and the
light behind it, b, from then on.  With both from the frames before and after, the mixed value m of
an exposure from :math:`t_0` to :math:`t_1` tells when the edge passed,

.. math:: t = t_1 - \frac{m - a}{b - a}\,(t_1 - t_0),

if a and b are the same all the time: if one sharp edge passes, and nothing else changes.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from real.recording import Real
from writing import table

from adv2e.errors import DataError
from adv2e.events import Events
from experiments.passages.edges import Edges, Values

STEP_DN = 20.0
"""Least change of the light [DN]."""
WHITE_DN = 250.0
"""Values above are clipped [DN]."""
SHARES = (0.1, 0.9)
"""Of an exposure after the passage."""
FEWEST, SPAN_US = 3, 8000.0
"""A sharp edge that passes makes this many events or more within this time [us], all alike."""


class Told(NamedTuple):
    """Passages that frames tell: when [us], polarity, share of the exposure behind the edge."""

    time_us: Values
    polarity: NDArray[np.int64]
    share: Values


def exposures_of(folder: Path, frames: int) -> Values:
    """Return start and end of each exposure [us], from ``exposures.txt``.

    Raises
    ------
    DataError
        There is no such file, or it has not a line for each frame.
    """
    path = folder / "exposures.txt"
    if not path.is_file():
        raise DataError(
            f"{path}: no such file; passages need the exposures, a line a frame: name, start and"
            " end [s]"
        )
    lines = [one.split("#")[0].split() for one in path.read_text("utf-8").splitlines()]
    try:
        found = np.array([[1e6 * float(value) for value in one[1:]] for one in lines if one])
    except ValueError:
        found = np.empty((0, 2))
    if found.shape != (frames, 2) or (found[:, 0] >= found[:, 1]).any():
        raise DataError(f"{path}: must be {frames} lines, one a frame: name, start and end [s]")
    return found


def told_by(before: Values, mixed: Values, after: Values, exposure_us: Values) -> Told:
    """Return what three frames in a row (rows, columns) tell; NaN where nothing."""
    step = after - before
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (mixed - before) / step
    known = (np.abs(step) >= STEP_DN) & (np.maximum(before, after) < WHITE_DN)
    known &= (share >= SHARES[0]) & (share <= SHARES[1])
    start, end = exposure_us
    time = np.where(known, end - share * (end - start), np.nan)
    return Told(time, (step > 0).astype(np.int64), share)


def first_latencies(real: Real, exposures_us: Values) -> tuple[Values, NDArray[np.int64], Values]:
    """Return latencies of first events [us], their polarities, and shares of the exposures.

    Of the pixels whose events between the exposures before and after look like those of one sharp
    edge.
    """
    frames = [np.asarray(frame.image, np.float64) for frame in real.source.frames()]
    found = []
    for k in range(1, len(frames) - 1):
        told = told_by(*frames[k - 1 : k + 2], exposures_us[k])
        start, end = exposures_us[k - 1, 1], exposures_us[k + 1, 0]
        events = real.events[(real.events["t"] >= start) & (real.events["t"] <= end)]
        found.append(_first(events, told))
    latency, polarity, share = (np.concatenate(one) for one in zip(*found, strict=True))
    return latency, polarity, share


def _first(events: Events, told: Told) -> tuple[Values, NDArray[np.int64], Values]:
    events = events[np.isfinite(told.time_us[events["y"], events["x"]])]
    pixel = events["y"].astype(np.int64) * told.share.shape[1] + events["x"]
    order = np.lexsort((events["t"], pixel))
    events, pixel = events[order], pixel[order]
    first = np.flatnonzero(np.diff(pixel, prepend=-1))
    last = np.append(first[1:], len(pixel)) - 1
    alike = events["p"].astype(np.int64) == told.polarity[events["y"], events["x"]]
    count = last - first + 1
    sharp = (count >= FEWEST) & (events["t"][last] - events["t"][first] <= SPAN_US)
    sharp &= np.diff(np.append(0, np.cumsum(alike)[last])) == count
    at = events["y"][first[sharp]], events["x"][first[sharp]]
    return events["t"][first[sharp]] - told.time_us[at], told.polarity[at], told.share[at]


def errors_at_best(exposure_us: float, period_us: float) -> Values:
    """Return errors of passages that such exposures tell of rendered edges [us].

    Between 4 and 45 DN, frames of 8 bits with noise of 1 DN, and nothing else in the picture.
    """
    edges = Edges(pairs=((4.0, 45.0),), stop_s=0.11)
    rows, columns = edges.pixels()
    starts = np.arange(0.0, 1e6 * edges.end_s - exposure_us, period_us)
    noise = np.random.default_rng(7)

    def frame(start: float) -> Values:
        times = 1e-6 * (start + exposure_us * (np.arange(400) + 0.5) / 400)
        light = edges.light(rows, columns, times[:, None]).mean(axis=0)
        return np.rint(light + noise.standard_normal(light.shape)).clip(0, 255)

    frames = [frame(start) for start in starts.tolist()]
    true = edges.passages().time_us.ravel()
    errors = []
    for k in range(1, len(frames) - 1):
        span = np.array([starts[k], starts[k] + exposure_us])
        told = told_by(frames[k - 1], frames[k], frames[k + 1], span)
        # the frame before shows the light before, and the next one that behind the edge
        alone = (true > starts[k - 1] + exposure_us) & (true < starts[k] + period_us)
        errors.append((told.time_us - true)[alone & np.isfinite(told.time_us)])
    return np.concatenate(errors)


def report(real: Real, exposures_us: Values) -> tuple[str, dict[str, object]]:
    """Return what a recording tells, as Markdown and as numbers."""
    latency, polarity, share = first_latencies(real, exposures_us)
    middle = np.median(exposures_us, axis=0)
    period = float(np.median(np.diff(exposures_us[:, 0])))
    best = errors_at_best(float(middle[1] - middle[0]), period)
    groups = {
        f"{name}, {low:.0%} to {high:.0%} of the exposure after it": latency[
            (polarity == sign) & (share >= low) & (share < high)
        ]
        for name, sign in (("ON", 1), ("OFF", 0))
        for low, high in ((0.1, 0.3), (0.3, 0.7), (0.7, 0.9))
    }
    groups["rendered edges, error of the passage alone"] = best
    rows = [
        [name, len(one), *(f"{1e-3 * v:.1f}" for v in np.percentile(one, (10, 50, 90)))]
        for name, one in groups.items() if len(one)
    ]  # fmt: skip
    text = (
        f"## {real.name}: measured\n\nFirst events of pixels whose frames and events look like one"
        " sharp edge, after the passage that its exposure tells [ms].\n\n"
    )
    numbers = {name: np.sort(one).tolist() for name, one in groups.items()}
    return text + table(["", "pixels", "10 %", "median", "90 %"], rows), dict(numbers)

"""Noise as shares of pixels with so many events: three models, fitted and judged on the rest.

Models, each with leak that may follow the light: ``points`` has Poisson events of the same rate in
all pixels (shot noise) and hot pixels of one rate, which is what this program had; ``one pole`` has
photoreceptor noise behind the low-pass alone, thresholds that differ, and hot pixels whose rates
are spread; ``two poles`` has the same behind a second pole, too.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from writing import load_pyplot, table

from adv2e import load_config, simulate
from adv2e.config import Config
from adv2e.diagnosis.fitting.candidates import Candidate
from adv2e.diagnosis.tables.characterise import problem_of
from adv2e.diagnosis.tables.noise_problem import (
    CUTOFF,
    DARK_CUTOFF,
    FOLLOWER,
    HOT_SPREAD,
    LEAK,
    PHOTO_LEAK,
    RMS,
    SHOT,
    NoiseProblem,
)
from adv2e.diagnosis.tables.problem import Settings, read_declared
from adv2e.diagnosis.tables.selection import FittedSet, Selector
from adv2e.diagnosis.tables.table import Table, parse_table
from adv2e.effects.pixel.shot_noise import FALL_AT_WHITE
from real.cradle import FINE_EDGES_DN, Still
from real.iebcs import POLARITIES, Level, interval_bins

MODELS = "points", "one pole", "two poles"
DEAD_TIME = "pixel.refractory.period_us=500"
NUMBERS = 2, 3, 5, 10, 20, 50, 100, 200
"""Events that shares are told of: a pixel with an interval has two."""
FEW = 1, 2, 3
SIDE = 50
SETTLE_S = 10.0
"""Simulated before events count: references forget how they began."""
FAR_ABOVE = 20.0
"""First poles that are faster than so many second ones are simulated as if they were not."""


@dataclass(frozen=True)
class Fit:
    """One model, fitted to a part of a table."""

    model: str
    problem: NoiseProblem
    fitted: FittedSet
    predicted: NDArray[np.float64]
    floor: float

    @property
    def values(self) -> Mapping[str, float]:
        """Fitted values by key."""
        return self.fitted.settings


def share_table(
    name: str, rows: Sequence[Mapping[str, Any]], counts: Sequence[Mapping[str, Any]], numbers: Any
) -> Table:
    """Return a table of shares of pixels with so many events or more.

    Parameters
    ----------
    rows : sequence of mappings
        Columns beside the shares, a row each.
    counts : sequence of mappings of ``on`` and ``off`` to (pixels,)
        Events of the pixels, a row each.
    numbers : sequence of int
        Beyond the first that no pixel has, the others tell nothing more.
    """
    shares = [f"{polarity}_share_{k}" for polarity in POLARITIES for k in numbers]
    lines = [",".join([*rows[0], *shares])]
    for row, count in zip(rows, counts, strict=True):
        cells = [f"{value:.6g}" for value in row.values()]
        for polarity in POLARITIES:
            before = 1.0
            for k in numbers:
                share = float((count[polarity] >= k).mean())
                cells.append(f"{share:.6g}" if before > 0.0 else "")
                before = share
        lines.append(",".join(cells))
    return parse_table("\n".join(lines), name)


def iebcs_shares(levels: list[Level]) -> Table:
    """Return the shares of each light level."""
    rows, counts = [], []
    for level in levels:
        rows.append(
            {
                "illuminance_lux": level.lux,
                "pixels": level.pixels,
                "duration_s": level.duration_s,
            }
        )
        counts.append({p: np.where(n > 0, n + 1, 0) for p, n in level.intervals.items()})
    return share_table("IEBCS noise files", rows, counts, NUMBERS)


def cradle_shares(still: Still) -> Table:
    """Return the shares at each grey value, of both halves of the picture."""
    rows, counts = [], []
    for low, high in itertools.pairwise(FINE_EDGES_DN):
        for half in (0, 1):
            grey = float(still.grey[(still.grey >= low) & (still.grey < high)].mean())
            inside = (still.grey >= low) & (still.grey < high) & (still.half == half)
            row = {"light_dn": grey, "pixels": int(inside.sum()), "duration_s": still.duration_s}
            rows.append({**row, "half": half})
            counts.append({p: number[inside] for p, number in still.counts.items()})
    return share_table("still pixels", rows, counts, FEW)


def fits(measured: Table, judge: str | None, white: float) -> list[Fit]:
    """Fit the three models to the rows that `judge` does not meet, or to all."""
    settings = Settings(white=white, judge=[judge] if judge else [])
    problem = problem_of(measured, read_declared([], [DEAD_TIME]), settings)
    assert isinstance(problem, NoiseProblem)
    selector = Selector(problem, settings)
    known = {one.name: one for one in problem.candidates}
    leak = known["leak"], known["photo_leak"]
    noise, hot = known["photoreceptor_noise"], known["hot_pixels"]
    sets = (
        (*leak, known["shot_noise"], _without(hot, HOT_SPREAD)),
        (*leak, _without(noise, FOLLOWER), hot),
        (*leak, noise, hot),
    )
    floor = float(np.sqrt(selector.floors.mean()))
    found = []
    for model, effects in zip(MODELS, sets, strict=True):
        fitted = selector.fitted(effects) if judge else _fitted_to_all(selector, effects)
        predicted = selector.predicted(fitted.joint, fitted.point)
        found.append(Fit(model, problem, fitted, predicted, floor))
    return found


def _fitted_to_all(selector: Selector, effects: tuple[Candidate, ...]) -> FittedSet:
    """Fit to all rows, without each level held out in turn."""
    joint = Candidate.joined([selector.problem.nuisances, *effects])
    starts = [np.array(joint.scaled(start)) for start in joint.starts]
    point, misfit = selector._fit(joint, np.ones(selector.problem.measured.size, bool), starts)
    gap = selector.problem.measured - selector.predicted(joint, point)
    error = np.average(gap**2, weights=selector.problem.error**-2.0)
    return FittedSet(effects, joint, point, misfit, np.array([error]))


def _without(effect: Candidate, key: str) -> Candidate:
    keep = [k for k, one in enumerate(effect.parameters) if one.key != key]
    starts = tuple(tuple(start[k] for k in keep) for start in effect.starts)
    return replace(effect, parameters=tuple(effect.parameters[k] for k in keep), starts=starts)


def values_of(fit: Fit) -> str:
    """Return the fitted values, in words."""
    return ", ".join(f"{k.split('.', 1)[1]} {v:.3g}" for k, v in fit.values.items())


def three_ways(measured: Table, white: float) -> tuple[str, dict[str, list[Fit]]]:
    """Return a table of errors, each light held out in turn, and the fits by what was held out."""
    rows, found = [], {}
    for lux in [*measured.texts("illuminance_lux"), ""]:
        judge = f"illuminance_lux={lux}" if lux else None
        found[lux] = fits(measured, judge, white)
        errors = [f"{fit.fitted.error:.2f}" for fit in found[lux]]
        misfit = f"{found[lux][-1].fitted.misfit:.0f} in {(~found[lux][0].problem.test).sum()}"
        what = f"{lux} lux" if lux else "(fitted to all)"
        rows.append([what, *errors, f"{found[lux][0].floor:.2f}", misfit])
    head = ["judged at", *MODELS, "floor", "misfit of two poles, in rows fitted"]
    return table(head, rows), found


def config_at(values: Mapping[str, float], light: float) -> Config:
    """Return a pixel that does at one light, a share of white, what the fitted model does there."""

    def of(key: str, neutral: float = 0.0) -> float:
        return float(values.get(key, neutral))

    dark = of(DARK_CUTOFF, 20.0)
    corner, second = dark + (of(CUTOFF, 20.0) - dark) * light, of(FOLLOWER)
    rms = of(RMS)
    if second > 0.0 and corner > FAR_ABOVE * second:
        slower = FAR_ABOVE * second
        rms *= math.sqrt((slower + second) / (corner + second))
        corner = slower
    leak = of(LEAK) + of(PHOTO_LEAK) * light
    shot = of(SHOT) * (1.0 - FALL_AT_WHITE * light) / (1.0 - FALL_AT_WHITE)
    sets = [
        "sampling.L=1",
        DEAD_TIME,
        f"pixel.leak={{rate_hz: {leak:.9f}}}",
        f"pixel.shot_noise.rate_hz={shot:.9f}",
        f"pixel.low_pass={{cutoff_hz: {corner:.6f}, dark_cutoff_hz: {corner:.6f}}}",
        f"pixel.thresholds.mismatch={of('pixel.thresholds.mismatch'):.9f}",
        f"pixel.thresholds.off={of('pixel.thresholds.off', 0.2):.9f}",
    ]
    if rms > 0.0:
        sets.append(f"pixel.photoreceptor_noise={{rms: {rms:.9f}, step: 0.2}}")
    if second > 0.0:
        sets.append(f"pixel.source_follower.cutoff_hz={second:.6f}")
    hot = {key: of(f"pixel.hot_pixels.{key}") for key in ("fraction", "rate_hz", "spread")}
    sets += [f"pixel.hot_pixels.{key}={value:.9f}" for key, value in hot.items()]
    return load_config([], sets)


def simulated_intervals(config: Config, seconds: float, seed: int) -> dict[str, Any]:
    """Return the intervals of each of 50x50 pixels at constant light, by polarity.

    Each is (numbers of a pixel, numbers by frequency).
    """
    config = load_config(config, [f"seed={seed}"])
    times = np.linspace(0.0, SETTLE_S + seconds, 5)
    events = np.concatenate(list(simulate([np.ones((SIDE, SIDE))] * 5, times, config)))
    events = events[events["t"] >= 1e6 * SETTLE_S]
    found = {}
    for polarity, value in (("on", 1), ("off", 0)):
        part = events[events["p"] == value]
        at = part["y"].astype(np.int64) * SIDE + part["x"]
        order = np.lexsort((part["t"], at))
        same = np.diff(at[order]) == 0
        gaps = np.diff(part["t"][order])[same] * 1e-6
        number = np.maximum(np.bincount(at, minlength=SIDE**2) - 1, 0)
        found[polarity] = number, np.histogram(1.0 / np.maximum(gaps, 1e-6), interval_bins())[0]
    return found


def distance(first: Any, second: Any) -> float:
    """Return the largest difference of two cumulative distributions (Kolmogorov)."""
    parts = [np.cumsum(one) / max(np.sum(one), 1) for one in (first, second)]
    return float(np.abs(parts[0] - parts[1]).max())


def compared_intervals(
    levels: list[Level], found: dict[str, list[Fit]], seed: int, picture: Any
) -> str:
    """Return how measured and simulated intervals differ, and draw their distributions.

    Every level is simulated with what was fitted to the other two, and with what was fitted to all.
    """
    pyplot = load_pyplot() if picture else None
    axes: Any = None
    if pyplot:
        figure, axes = pyplot.subplots(3, 2, figsize=(9, 9), sharex=True, layout="constrained")
    rows = []
    white = max(level.lux for level in levels)
    centres = np.sqrt(interval_bins()[1:] * interval_bins()[:-1])
    for k, level in enumerate(levels):
        lux = f"{level.lux:.6g}"
        streams = {"measured": {p: (level.intervals[p], level.by_frequency[p]) for p in POLARITIES}}
        for name, fit in (
            ("points, fitted to the others", found[lux][0]),
            ("two poles, fitted to the others", found[lux][-1]),
            ("two poles, fitted to all", found[""][-1]),
        ):
            config = config_at(fit.values, level.lux / white)
            streams[name] = simulated_intervals(config, level.duration_s, seed)
        again = simulated_intervals(config, level.duration_s, seed + 1)
        for name, stream in streams.items():
            cells = [f"{level.lux:g}", name]
            for polarity in POLARITIES:
                number, histogram = stream[polarity]
                real = streams["measured"][polarity]
                cells += [f"{number.mean():.3g}", f"{np.median(number):.0f}"]
                apart = "" if name == "measured" else f"{distance(histogram, real[1]):.2f}"
                cells.append(apart if real[1].sum() and histogram.sum() else "")
            rows.append(cells)
            if pyplot:
                for j, polarity in enumerate(POLARITIES):
                    histogram = stream[polarity][1] / SIDE**2
                    style = "k-" if name == "measured" else "-"
                    share = np.diff(np.log10(interval_bins()))
                    axes[k, j].loglog(centres, histogram / share, style, label=name)
                    axes[k, j].set_title(f"{level.lux:g} lux, {polarity.upper()}")
        chance = [
            distance(again[p][1], streams["two poles, fitted to all"][p][1]) for p in POLARITIES
        ]
        rows.append([f"{level.lux:g}", "two draws of the last", "", "", f"{chance[0]:.3f}"])
        rows[-1] += ["", "", f"{chance[1]:.3f}"]
    if pyplot:
        axes[0, 0].legend(fontsize=7)
        for axis in axes[-1]:
            axis.set_xlabel("1/interval [Hz]")
        for axis in axes[:, 0]:
            axis.set_ylabel("intervals a pixel and decade")
        for axis in axes.ravel():
            axis.set_ylim(1e-4, None)
        figure.savefig(picture, dpi=90)
    head = ["light [lux]", ""]
    for polarity in ("ON", "OFF"):
        head += [f"{polarity} intervals a pixel", "median", "distance"]
    return table(head, rows)


def two_halves(still: Still) -> tuple[str, str, Fit]:
    """Return errors on the half that was not fitted, rates beside it, and the fit."""
    found = fits(cradle_shares(still), "half=1", 255.0)
    errors = [f"{fit.fitted.error:.2f}" for fit in found]
    judged = table(["judged on", *MODELS, "floor"], [["half 1", *errors, f"{found[0].floor:.2f}"]])
    rows = []
    fit = found[-1]
    for low, high in itertools.pairwise(FINE_EDGES_DN):
        inside = (still.grey >= low) & (still.grey < high) & (still.half == 1)
        light = np.array([still.grey[inside].mean()])
        cells = [f"{light[0]:.1f}", f"{inside.sum()}"]
        for polarity in POLARITIES:
            events = int(still.counts[polarity][inside].sum())
            cells.append(f"{events / inside.sum() / still.duration_s:.4f}")
            for one in (found[0], fit):
                rates = one.problem.rates(one.values, light)
                mean = rates.on_mean if polarity == "on" else rates.off_mean
                cells.append(f"{mean[0]:.4f}")
        rows.append(cells)
    head = ["grey [DN]", "pixels"]
    for polarity in ("ON", "OFF"):
        head += [f"{polarity} [Hz]", "points", "two poles"]
    return judged, table(head, rows), fit

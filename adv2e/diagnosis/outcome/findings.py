"""Findings for the report: fitted effects, rejected ones, statistics, and notes."""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from adv2e import __version__
from adv2e.config import Config
from adv2e.diagnosis.configurations import (
    as_found,
    declared_of,
    defaults_of,
    of_frames_again,
    with_keys,
)
from adv2e.diagnosis.data import splits
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.fitting.candidates import Candidate
from adv2e.diagnosis.fitting.fitted import Fitted
from adv2e.diagnosis.fitting.fitter import thresholds_of
from adv2e.diagnosis.prepare import Prepared
from adv2e.diagnosis.selection.reference import Reference, State
from adv2e.diagnosis.selection.search import Outcome
from adv2e.diagnosis.statistics.summary import BOTH
from adv2e.errors import ConfigError
from adv2e.reports.residual import by_explained
from adv2e.reports.result import Finding, Rejected, Signature

_LITTLE_DOUBT = 0.3
"""Limit of negligible uncertainty by frames, in deviations of chance: it widens them by 4 %."""
_SEEDS = (1, 2)
"""Of the rough simulations by which effects are first compared."""


def finding_of(fit: Fitted, pixels: int, config: Config) -> Finding:
    """Return an effect that was added, with 95 % intervals of what was fitted or read off.

    Of a share of the recording's `pixels`, no more can be known than so many draws tell; `config`,
    the model, tells what was set besides.
    """
    settings = fit.candidate.settings_in(config, fit.point)
    interval: dict[str, Any] = {}
    spread: Any = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0)) if fit.covariance.size else []
    for one, at, sd in zip(fit.candidate.parameters, fit.point, spread, strict=False):
        # on its logarithmic scale
        counted = (one.value_at(at) * pixels) ** -0.5 if one.of_pixels else 0.0
        reach = 1.96 * max(sd, counted)
        low, high = one.value_at(at - reach), one.value_at(at + reach)
        if one.part is None:
            interval[one.key] = low, high
        else:  # parts of a list come in their order
            below, above = interval.get(one.key, ((), ()))
            interval[one.key] = (*below, low), (*above, high)
    for key, sd in fit.candidate.read_off:
        interval[key] = settings[key] - 1.96 * sd, settings[key] + 1.96 * sd
    return Finding(fit.candidate.name, settings, interval)


@dataclass(frozen=True)
class Given:
    """What was given of a camera and its recording, beside which models are told.

    Attributes
    ----------
    declared : Config
        As it was given.
    written, free_thresholds
        As :func:`adv2e.diagnosis.diagnose.diagnose` takes them.
    pixels : int
        Of the recording.
    is_light : bool
        Light is known, so that models are without sections of frames.
    """

    declared: Config
    written: Collection[str] | None
    free_thresholds: bool
    pixels: int
    is_light: bool

    def told(self, config: Config, fits: Sequence[Fitted] = ()) -> dict[str, Any]:
        """Return what a diagnosis says of a model, by the names of its attributes."""
        effects = [finding_of(fit, self.pixels, config) for fit in fits]
        nuisances = thresholds_of(config) if self.free_thresholds else {}
        keys = (key for one in effects for key in one.parameters)
        held = declared_of(self.declared, [*nuisances, *keys])
        return {
            "effects": effects,
            "nuisances": nuisances,
            "declared_values": held,
            "defaults": defaults_of(held, self.written),
            "model": as_found(of_frames_again(config, self.declared) if self.is_light else config),
        }


def facts_of(simulations: int, seed: int, began_s: float) -> dict[str, str]:
    """Return the facts that every diagnosis ends in; `began_s`: by :func:`time.perf_counter`."""
    return {
        "simulations": f"{simulations:,}",
        "seed": str(seed),
        "time taken": f"{time.perf_counter() - began_s:.0f} s",
        "adv2e": __version__,
    }


def rejected_of(
    reference: Reference, outcome: Outcome, kept: State, candidates: Sequence[Candidate]
) -> list[Rejected]:
    """Return the effects that were not added, those that explain most first.

    That is told by rough simulations, most of which their fits have made, on the data for
    validation.
    """
    names = list(dict.fromkeys(candidate.name for candidate in candidates))
    held = dict(outcome.rejected)
    if outcome.state is not kept:
        why = "explains a part, but too much is left to name it"
        if outcome.complete:
            why = "would account for every statistic, but not for where and when events come"
        for fit in outcome.state.fits:
            settings = fit.candidate.settings_in(outcome.state.config, fit.point)
            held[fit.candidate.name] = Rejected(fit.candidate.name, why, settings)
    given = [held[name] for name in names if name in held and name not in kept.names]
    declared = reference.declared
    configs = [_alone(one, declared, candidates) for one in given]
    known = [config for config in configs if config is not None]
    reference.sampler.rough.samples([declared, *known], _SEEDS)  # all at once, then held
    fitter = reference.fitter(splits.VALIDATION, declared, rough=True)
    nothing = fitter.misfit(declared, _SEEDS)
    return by_explained(
        [
            one
            if config is None
            else replace(one, held_out=fitter.misfit(config, _SEEDS) / nothing)
            for one, config in zip(given, configs, strict=True)
        ]
    )


def _alone(one: Rejected, declared: Config, candidates: Sequence[Candidate]) -> Config | None:
    """Return the declared model with an effect as it was tried, None where that is no model.

    Values that were fitted beside another effect may not be allowed without it.
    """
    for candidate in candidates:
        if candidate.name == one.name and candidate.keys <= set(one.parameters):
            try:
                whole = candidate.applied(declared, candidate.scaled(candidate.starts[0]))
                return with_keys(whole, one.parameters)
            except ConfigError:
                return None
    return None


def signatures_of(
    reference: Reference, declared: State, kept: State, view: int = splits.TEST
) -> list[Signature]:
    """Return every statistic of the test data, or of another view: as measured, before, after."""
    statistics, observed = reference.sampler.statistics, reference.observed[view]
    of_models = [state.ensembles[view] for state in (declared, kept)]
    means = [reference.scales[view].values_of(one.mean) for one in of_models]
    z = [one.z(observed) for one in of_models]
    signatures = []
    for k, entry in enumerate(statistics.entries):
        about = entry.name, statistics.titles[k], entry.meaning
        measured, before, after = (entry.plain(float(row[k])) for row in (observed, *means))
        values = measured, before, after, float(z[0][k]), float(z[1][k])
        signatures.append(Signature(*about, *values, entry.unit, statistics.kinds[k]))
    return signatures


def about_frames(prepared: Prepared) -> list[str]:
    """Return notes on the uncertainty of the statistics that interpolation and levels make."""
    reference = prepared.reference
    chance = reference.error.chance(reference.scales[BOTH].sd, BOTH)
    notes: list[str] = []
    if prepared.evidence.stimulus is not None:
        return notes
    if prepared.between_frames is None:
        notes.append(
            "too few frames to leave any out: what the interpolation between them does to the"
            " residual is not known, and may be all of it: record with more frames a second before"
            " you trust an effect that is named here"
        )
    else:
        doubt = prepared.between_frames.doubt(chance, BOTH)
        made_up = "the light between the frames, which is interpolated,"
        notes.append(_uncertain(made_up, doubt, "frames left out"))
    if prepared.between_levels is not None:
        doubt = prepared.between_levels.doubt(chance, BOTH)
        untold = "the light between two levels of the frames' numbers"
        notes.append(_uncertain(untold, doubt, "frames of coarser levels"))
    return notes


def _uncertain(what: str, doubt: float, told_by: str) -> str:
    return (
        f"{what} makes the numbers compared uncertain, {doubt:.2g} times as much as chance does"
        f" (root mean square; found by simulations with {told_by}): {_meaning(doubt)}"
    )


def _meaning(doubt: float) -> str:
    """Return the consequence of the uncertainty that frames leave, in words."""
    if doubt < _LITTLE_DOUBT:
        return "here, that hides next to nothing"
    if doubt <= 1.0:
        return "here, small effects stay hidden behind it"
    return "here, the frames hardly resolve the motion, and only large effects can be found"


def about_drifts(evidence: Evidence, model: Config) -> list[str]:
    """Return a note on the origin of drifts, where it is not the begin of the recording."""
    drifting = {
        "clock_drift_ppm": model.frames.clock_drift_ppm,
        "drift_per_s": model.pixel.thresholds.drift_per_s,
    }
    names = " and ".join(name for name, value in drifting.items() if value)
    if not names or not evidence.run_in.frames:
        return []
    start_s = evidence.simulated.times_s[0]
    counts = f"in model.yaml {names} counts from the first frame simulated, at {start_s:.3f} s"
    return [f"{counts}: for another time, what it has made up to then is to be set besides"]

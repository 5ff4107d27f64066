"""The whole diagnosis: from a recording and a declared model to what the model lacks."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e import __version__
from adv2e.config import Config
from adv2e.cores import default_threads
from adv2e.diagnosis import parts
from adv2e.diagnosis.affordable import affordable
from adv2e.diagnosis.bench import State
from adv2e.diagnosis.candidates import Candidate
from adv2e.diagnosis.detectable import detectable
from adv2e.diagnosis.error import error_rows, of_part
from adv2e.diagnosis.evidence import Evidence
from adv2e.diagnosis.fit import Fit
from adv2e.diagnosis.interpolation import InterpolationError, interpolation_error
from adv2e.diagnosis.keys import as_found, own_of
from adv2e.diagnosis.lamps import lamps_of
from adv2e.diagnosis.library import hints_of, library
from adv2e.diagnosis.light import light_of, quantum_dn
from adv2e.diagnosis.lines import strongest_lines
from adv2e.diagnosis.markers import BOTH, Markers
from adv2e.diagnosis.nuisances import THRESHOLDS, TOLERANCE, fit_thresholds, thresholds_of
from adv2e.diagnosis.picture import Gallery
from adv2e.diagnosis.scene import Placed, Scene
from adv2e.diagnosis.search import Outcome, Search
from adv2e.diagnosis.simulations import Laboratory, Simulator
from adv2e.diagnosis.stream import Stream
from adv2e.diagnosis.verdict import sentence_of, verdict_of
from adv2e.reports.result import Diagnosis, ErrorRow, Finding, Rejected, Signature

Array = NDArray[np.float64]

_PILOT = 16
_MATCHING_SEED = 9_999
_LAMP_SEED = 9_998
_DRAWS = 12


def diagnose(
    evidence: Evidence,
    declared: Config,
    *,
    declared_name: str = "",
    without: Sequence[str] = (),
    free_thresholds: bool = False,
    threads: int | None = None,
    progress: Callable[[int, int], None] = lambda done, likely: None,
    log: Callable[[str], None] = lambda text: None,
) -> Diagnosis:
    """Find what the declared model of a recording lacks.

    Parameters
    ----------
    evidence : Evidence
    declared : Config
        What is known of the camera.  Effects of the user's own, for which it has sections, are
        candidates as the built-in ones are; those that are no knowledge of the camera are off
        (:func:`adv2e.diagnosis.keys.without_user_effects`).
    declared_name : str
        Its file, for the report.
    without : sequence of str
        Effects that the library is to do without.
    free_thresholds : bool
        Whether thresholds are not known: they are fitted first, as a nuisance.
    threads : int, optional
        Simulations at a time; default: all cores.  The result does not depend on it.
    progress : callable
        Called with the number of simulations done, and of those likely to be needed in all.
    log : callable
        Takes lines for people.

    Returns
    -------
    Diagnosis
    """
    began = time.perf_counter()
    evidence = affordable(evidence, declared)
    light = light_of(evidence, declared)
    scene = Scene.of(light, evidence.times_s, quantum_dn(evidence, declared))
    with closing(Simulator(evidence, threads or default_threads(), progress)) as simulator:
        if free_thresholds:
            declared, miss = _with_fitted_thresholds(evidence, declared, simulator, scene)
            log(f"thresholds that match the totals: {thresholds_of(declared)}")
            if miss > TOLERANCE:
                missed = f"no thresholds match the totals of ON and OFF events: off by {miss:.0%}"
                evidence = replace(evidence, notes=[*evidence.notes, missed])
        seeds = range(10_000, 10_000 + _PILOT)
        streams = simulator.map(lambda seed: simulator.stream(declared, seed), seeds)
        pilot = [Placed.of(stream, scene) for stream in streams]
        markers = Markers(scene, pilot)
        error = interpolation_error(
            evidence,
            declared,
            scene,
            markers,
            dict(zip(seeds, streams, strict=True)),
            lambda fewer: Simulator(fewer, threads or default_threads()),
        )
        laboratory = Laboratory(simulator, scene, markers, error.bias if error else None)
        measured = Placed.of(evidence.stream, scene)
        observed = laboratory.markers.measure(measured)

        def to_fit(stream: Stream) -> Stream:
            return of_part(stream, scene.parts, parts.FIT)

        fitted_to = to_fit(evidence.stream)
        lines = strongest_lines(fitted_to, [to_fit(one.stream) for one in pilot], scene)
        lamps = lamps_of(
            lines, fitted_to, declared, lambda lit: to_fit(simulator.stream(lit, _LAMP_SEED))
        )
        hints = hints_of(evidence.stream.t, evidence.seconds, lamps)
        candidates = [one for one in library(declared, hints) if one.name not in without]
        free = THRESHOLDS if free_thresholds else ()
        search = Search(laboratory, observed, declared, candidates, error, log, free)
        outcome = search.run()
        seeds = range(20_000, 20_000 + _DRAWS)

        def drawn(state: State) -> list[Placed]:
            return [Placed.of(simulator.stream(state.config, seed), scene) for seed in seeds]

        def errors(before: Sequence[Placed], after: Sequence[Placed]) -> list[ErrorRow]:
            def last(placed: Placed) -> Stream:
                return of_part(placed.stream, scene.parts, parts.LAST)

            return error_rows(last(measured), list(map(last, before)), list(map(last, after)))

        kept = outcome.state
        before = after = drawn(search.declared)
        if kept is not search.declared:
            after = drawn(kept)
        rows = errors(before, after)
        verdict = verdict_of(outcome, rows[0])
        if verdict in ("consistent", "unexplained") and kept is not search.declared:
            kept, after = search.declared, before
            rows = errors(before, after)
        gallery = Gallery(scene, measured, before, after)
        return Diagnosis(
            verdict=verdict,
            sentence=sentence_of(verdict, kept, outcome),
            recording=evidence.name,
            declared=declared_name,
            effects=[finding_of(fit) for fit in kept.fits],
            alternatives=outcome.alternatives if kept.fits else [],
            nuisances=thresholds_of(kept.config) if free_thresholds else {},
            rejected=_rejected(outcome, kept, candidates),
            errors=rows,
            global_p_before=search.probability(search.declared, parts.LAST),
            global_p_after=search.probability(kept, parts.LAST),
            signatures=_signatures(search, observed, kept, laboratory.markers),
            curves=gallery.curves(),
            maps=gallery.maps(),
            detectable=detectable(search.bench, search.declared, candidates),
            masked=evidence.masked,
            split=scene.parts.text(),
            notes=[*evidence.notes, _about_interpolation(search, error)],
            model=as_found(kept.config),
            facts={
                "sensor": f"{evidence.width}x{evidence.height}",
                "length": f"{evidence.seconds:.3f} s",
                "events": f"{len(evidence.stream):,}",
                "frames": f"{len(evidence.frames):,}",
                "simulations": f"{simulator.done:,}",
                "seed": str(declared.seed),
                "time taken": f"{time.perf_counter() - began:.0f} s",
                "adv2e": __version__,
            },
            own=own_of(declared),
        )


def _about_interpolation(search: Search, error: InterpolationError | None) -> str:
    if error is None:
        return (
            "too few frames to leave any out: what the interpolation between them does to the"
            " residual is not known, and may be all of it"
        )
    size = error.size(search.bench.scales[BOTH].sd, BOTH)
    text = (
        f"interpolation between the frames moves a statistic by {size:.2g} deviations (root mean"
        " square), as simulations with every second frame left out tell; taken off, and counted as"
        " uncertain by as much"
    )
    return text + (": the frames hardly resolve the motion" if size > 1.0 else "")


def _with_fitted_thresholds(
    evidence: Evidence, declared: Config, simulator: Simulator, scene: Scene
) -> tuple[Config, float]:
    def counts(stream: Stream) -> tuple[int, int]:
        fitted_to = of_part(stream, scene.parts, parts.FIT)
        on = int(np.count_nonzero(fitted_to.on))
        return on, len(fitted_to) - on

    return fit_thresholds(
        lambda config: counts(simulator.stream(config, _MATCHING_SEED)),
        declared,
        counts(evidence.stream),
    )


def finding_of(fit: Fit) -> Finding:
    """Return an effect that was added, with 95 % intervals of what was fitted."""
    parameters = fit.candidate.parameters(fit.place)
    interval: dict[str, Any] = {}
    spread: Any = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0)) if fit.covariance.size else []
    for knob, place, sd in zip(fit.candidate.knobs, fit.place, spread, strict=False):
        low, high = knob.outer(place - 1.96 * sd), knob.outer(place + 1.96 * sd)
        if knob.part is None:
            interval[knob.key] = low, high
        else:  # parts of a list come in their order
            below, above = interval.get(knob.key, ((), ()))
            interval[knob.key] = (*below, low), (*above, high)
    return Finding(fit.candidate.name, parameters, interval)


def _rejected(outcome: Outcome, kept: State, candidates: Sequence[Candidate]) -> list[Rejected]:
    """Return the effects that were not added, in the library's order."""
    names = list(dict.fromkeys(candidate.name for candidate in candidates))
    held = dict(outcome.rejected)
    if outcome.state is not kept:
        for fit in outcome.state.fits:
            held[fit.candidate.name] = Rejected(
                fit.candidate.name,
                "explains a part, but too much is left to name it",
                fit.candidate.parameters(fit.place),
            )
    return [held[name] for name in names if name in held and name not in kept.names]


def _signatures(search: Search, observed: Array, kept: State, markers: Markers) -> list[Signature]:
    view = parts.LAST
    before, after = search.declared.models[view], kept.models[view]
    scale = search.bench.scales[view]
    z_before, z_after = before.z(observed[view]), after.z(observed[view])

    def value(mean: Array) -> Array:
        return np.asarray(scale.mean + scale.sd * 3.0 * np.sinh(mean / 3.0))

    means = value(before.mean), value(after.mean)
    return [
        Signature(
            entry.name,
            title,
            entry.meaning,
            entry.plain(float(observed[view][k])),
            entry.plain(float(means[0][k])),
            entry.plain(float(means[1][k])),
            float(z_before[k]),
            float(z_after[k]),
        )
        for k, (entry, title) in enumerate(zip(markers.entries, markers.titles, strict=True))
    ]

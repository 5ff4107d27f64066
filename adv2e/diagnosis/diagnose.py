"""The whole diagnosis: from a recording and a declared model to what the model lacks."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from contextlib import closing

from adv2e import __version__
from adv2e.background import default_threads
from adv2e.config import Config
from adv2e.diagnosis.configurations import (
    as_found,
    declared_of,
    defaults_of,
    of_frames_again,
    of_known_light,
    own_of,
)
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.fitting.fitter import thresholds_of
from adv2e.diagnosis.outcome.findings import (
    about_drifts,
    about_frames,
    finding_of,
    rejected_of,
    signatures_of,
)
from adv2e.diagnosis.outcome.verdict import conclude, detectable, remark_of
from adv2e.diagnosis.prepare import DECLARED, prepare
from adv2e.diagnosis.selection.search import Search
from adv2e.diagnosis.simulation.affordable import affordable
from adv2e.diagnosis.simulation.simulator import Simulator
from adv2e.reports.result import Diagnosis


def diagnose(
    evidence: Evidence,
    declared: Config,
    *,
    declared_name: str = "the configuration given",
    without: Sequence[str] = (),
    written: Collection[str] | None = None,
    free_thresholds: bool = False,
    sizes: bool = True,
    threads: int | None = None,
    progress: Callable[[str, int], None] = lambda stage, simulations: None,
    log: Callable[[str], None] = lambda text: None,
) -> Diagnosis:
    """Find the effects that the declared model of a recording lacks.

    Parameters
    ----------
    declared : Config
        What is known of the camera.  Effects of the user's own, for which it has sections, are
        candidates as the built-in ones are; those that are no knowledge of the camera are off
        (:func:`adv2e.diagnosis.configurations.without_user_effects`).
    declared_name : str
        Its file, for the report.
    without : sequence of str
        Effects that the library is to do without.
    written : collection of str, optional
        Dotted keys that somebody wrote into `declared`, so that the report tells them from the
        program's defaults; default: it does not.
    free_thresholds : bool
        Whether thresholds are not known: they are fitted first, as a nuisance.
    sizes : bool
        Whether to find out which size of each effect would have been seen, which takes some 400
        simulations and changes nothing else.
    threads : int, optional
        Simulations at a time; default: all cores.  The result does not depend on it.
    progress : callable
        Takes the stage and the number of simulations done, at each new stage and after each
        simulation.
    log : callable
        Takes lines for people.

    Raises
    ------
    DataError
        Too few events are left of a recording that would take too long.
    """
    began = time.perf_counter()
    given, known = declared, evidence.stimulus is not None
    if known:
        declared = of_known_light(declared)
    evidence = affordable(evidence, declared)
    with closing(Simulator(evidence, threads or default_threads(), progress)) as simulator:
        simulator.begin(DECLARED)
        prepared = prepare(evidence, declared, simulator, without, free_thresholds, log)
        evidence, reference = prepared.evidence, prepared.reference
        declared = reference.declared
        search = Search(reference, prepared.candidates)
        outcome = search.run()
        found = conclude(prepared, search, outcome)
        kept = found.kept
        effects = [
            finding_of(fit, evidence.width * evidence.height, kept.config) for fit in kept.fits
        ]
        nuisances = thresholds_of(kept.config) if free_thresholds else {}
        held = declared_of(given, [*nuisances, *(key for one in effects for key in one.parameters)])
        return Diagnosis(
            verdict=found.verdict,
            remark=remark_of(found.verdict, outcome),
            recording=evidence.name,
            declared=declared_name,
            effects=effects,
            alternatives=outcome.alternatives if kept.fits else [],
            nuisances=nuisances,
            rejected=rejected_of(reference, outcome, kept, search.candidates),
            errors=found.errors,
            global_p_before=search.overall(search.declared),
            global_p_after=search.overall(kept),
            signatures=signatures_of(reference, search.declared, kept),
            curves=found.curves,
            maps=found.maps,
            totals=found.totals,
            snapshot=found.snapshot,
            detectable=detectable(reference, search.declared, search.candidates) if sizes else [],
            masked=evidence.masked,
            split=prepared.scene.split.text(),
            notes=[*evidence.notes, *about_frames(prepared), *about_drifts(evidence, kept.config)],
            model=as_found(of_frames_again(kept.config, given) if known else kept.config),
            facts={
                "sensor": f"{evidence.width}x{evidence.height}",
                "length": f"{evidence.seconds:.3f} s",
                "events": f"{len(evidence.stream):,}",
                **_light_facts(evidence),
                "simulations": f"{simulator.done:,}",
                "seed": str(declared.seed),
                "time taken": f"{time.perf_counter() - began:.0f} s",
                "adv2e": __version__,
            },
            own=own_of(declared),
            input_checks=evidence.notes,
            declared_values=held,
            defaults=defaults_of(held, written),
        )


def _light_facts(evidence: Evidence) -> dict[str, str]:
    before, known = evidence.run_in, evidence.stimulus
    if known is not None:
        settling = f", from {evidence.before_s:.3g} s before for pixels to settle"
        return {"light": known.name + settling * bool(len(before.times_s))}
    count = len(before.frames)
    settling = f", and {count:,} before for pixels to settle"
    return {"frames": f"{len(evidence.frames):,}" + settling * (count > 0)}

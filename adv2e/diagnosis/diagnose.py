"""The whole diagnosis: from a recording and a declared model to what the model lacks."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Any

from adv2e.background import default_threads
from adv2e.config import Config
from adv2e.diagnosis.configurations import of_known_light, own_of
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.data.scene import Scene
from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.outcome.findings import (
    Given,
    about_drifts,
    about_frames,
    facts_of,
    rejected_of,
    signatures_of,
)
from adv2e.diagnosis.outcome.picture import pictures_of
from adv2e.diagnosis.outcome.verdict import conclude, detectable, drawn
from adv2e.diagnosis.prepare import DECLARED, prepare
from adv2e.diagnosis.selection.reference import State
from adv2e.diagnosis.selection.search import Search
from adv2e.diagnosis.simulation.affordable import affordable
from adv2e.diagnosis.simulation.simulator import Simulator
from adv2e.diagnosis.statistics.summary import BOTH
from adv2e.reports.result import Diagnosis, Rejected


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
    known: Callable[[Diagnosis], None] | None = None,
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
    known : callable, optional
        Takes what is known so far after each stage, as a diagnosis that is not finished.  The
        result does not depend on it.

    Raises
    ------
    DataError
        Too few events are left of a recording that would take too long.
    """
    began = time.perf_counter()
    as_given = declared
    if evidence.stimulus is not None:
        declared = of_known_light(declared, evidence.stimulus.steps)
    evidence = affordable(evidence, declared)
    is_light, pixels = evidence.stimulus is not None, evidence.width * evidence.height
    given = Given(as_given, written, free_thresholds, pixels, is_light)
    with closing(Simulator(evidence, threads or default_threads(), progress)) as simulator:

        def facts() -> dict[str, str]:
            return {
                "sensor": f"{evidence.width}x{evidence.height}",
                "length": f"{evidence.seconds:.3f} s",
                "events": f"{len(evidence.stream):,}",
                **_light_facts(evidence),
                **facts_of(simulator.done, declared.seed, began),
            }

        begun = Diagnosis(
            verdict="unfinished",
            remark=_SO_FAR,
            recording=evidence.name,
            declared=declared_name,
            masked=evidence.masked,
            own=own_of(declared),
            still=DECLARED,
            **given.told(declared),
        )
        so_far = _SoFar(begun, simulator, given, facts, known)
        simulator.begin(DECLARED)
        prepared = prepare(
            evidence, declared, simulator, without, free_thresholds, log, so_far.prepared
        )
        evidence, reference = prepared.evidence, prepared.reference
        reference.begin = so_far.begin
        search = Search(reference, prepared.candidates, so_far.changed)
        outcome = search.run()
        kept, found = conclude(prepared, search, outcome)
        whole = replace(
            begun,
            **given.told(kept.config, kept.fits),
            **found,
            still="",
            alternatives=outcome.alternatives if kept.fits else [],
            rejected=rejected_of(reference, outcome, kept, search.candidates),
            global_p_before=search.overall(search.declared),
            global_p_after=search.overall(kept),
            signatures=signatures_of(reference, search.declared, kept),
            split=prepared.scene.split.text(),
            notes=[*evidence.notes, *about_frames(prepared), *about_drifts(evidence, kept.config)],
            input_checks=evidence.notes,
        )
        so_far.judged(whole)
        seen = detectable(reference, search.declared, search.candidates) if sizes else []
        return replace(whole, detectable=seen, facts=facts())


def _light_facts(evidence: Evidence) -> dict[str, str]:
    before, known = evidence.run_in, evidence.stimulus
    if known is not None:
        settling = f", from {evidence.before_s:.3g} s before for pixels to settle"
        return {"light": known.name + settling * bool(len(before.times_s))}
    count = len(before.frames)
    settling = f", and {count:,} before for pixels to settle"
    return {"frames": f"{len(evidence.frames):,}" + settling * (count > 0)}


# ---- What is known so far, told after each stage.


_SO_FAR = (
    "All of this may still change, most of all on the data held out, which are looked at in the"
    " end. If adv2e runs no more, it was stopped here."
)
_EVERY_S = 20.0
"""Time after which what is known is told anew at the next stage, though no effect was added."""


class _SoFar:
    """Tells what is known of a recording, if anybody is to know, without simulations that count.

    Parameters
    ----------
    begun : Diagnosis
        When nothing is known.
    facts : callable
        Returns the facts of the diagnosis.
    """

    def __init__(
        self,
        begun: Diagnosis,
        simulator: Simulator,
        given: Given,
        facts: Callable[[], dict[str, str]],
        known: Callable[[Diagnosis], None] | None,
    ) -> None:
        self._now, self._simulator, self._known = begun, simulator, known
        self._given, self._facts, self._told_s = given, facts, 0.0

    def _tell(self, **known: Any) -> None:
        if self._known is not None:
            self._now = replace(self._now, **known)
            self._known(replace(self._now, facts=self._facts()))
            self._told_s = time.monotonic()

    def prepared(
        self, evidence: Evidence, declared: Config, scene: Scene, streams: Sequence[Stream]
    ) -> None:
        """Tell of thresholds that match, or of simulations of the declared model."""
        if self._known is None:
            return
        self._scene, self._measured, self._before = scene, evidence.stream, streams
        checks, split = evidence.notes, scene.split.text()
        known = {"notes": checks, "input_checks": checks, "split": split}
        self._tell(**self._given.told(declared), **self._pictures(self._before), **known)

    def _pictures(self, after: Sequence[Stream]) -> dict[str, Any]:
        if not after:
            return {}
        return pictures_of(self._scene, self._measured, self._before, after)

    def changed(self, search: Search, state: State) -> None:
        """Tell of a model that takes the place of the one before."""
        if self._known is None:
            return
        after: list[Stream] = []
        if state is not search.declared:
            after = drawn(self._simulator.aside(), state.config)
        self._rejections = search.reference.rejections
        self._tell(
            **self._given.told(state.config, state.fits),
            **self._pictures(after),
            still="searching for what is missing",
            alternatives=state.rivals,
            rejected=self._rejected(state.names),
            global_p_before=search.probability(search.declared),
            global_p_after=search.probability(state),
            signatures=signatures_of(search.reference, search.declared, state, BOTH),
        )

    def _rejected(self, names: Sequence[str]) -> list[Rejected]:
        return [why for name, why in self._rejections.held.items() if name not in names]

    def begin(self, stage: str) -> None:
        """Begin a stage of the search, and tell of it if nothing was told for a while."""
        self._simulator.begin(stage)
        if self._known is not None and time.monotonic() - self._told_s > _EVERY_S:
            names = [one.name for one in self._now.effects]
            self._tell(still=stage, rejected=self._rejected(names))

    def judged(self, whole: Diagnosis) -> None:
        """Tell of all but the sizes that would have been seen."""
        self._now = whole
        self._tell(
            verdict="unfinished",
            still="finding what could have been seen",
            remark=f"The verdict will be '{whole.verdict.replace('_', ' ')}'. {whole.remark}",
        )

"""Diagnosis of recordings of known films: the view is fitted, then what the camera lacks is found.

Of many recordings before pictures, half are fitted to and half judge (:mod:`.selection`).  Of one
recording of a video, the view is fitted, and the ordinary search looks at what is left, with the
film's light in the place of frames.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.configurations import of_known_light, own_of
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.data.scene import Scene
from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.diagnose import diagnose
from adv2e.diagnosis.film.fitting import FilmFitter, Place, first_point
from adv2e.diagnosis.film.nearness import DISTANCES, distances
from adv2e.diagnosis.film.recordings import FilmRecordings, split
from adv2e.diagnosis.film.registration import first_delays, first_view, rests
from adv2e.diagnosis.film.selection import FilmSearch, Step
from adv2e.diagnosis.film.view import UNKNOWNS, Films, View
from adv2e.diagnosis.fitting.candidates import NOTHING
from adv2e.diagnosis.fitting.fitter import threshold_nuisance
from adv2e.diagnosis.fitting.library import OF_FRAMES, library
from adv2e.diagnosis.hints.collect import Hints
from adv2e.diagnosis.hints.stamps import double_reads
from adv2e.diagnosis.outcome.findings import Given, facts_of
from adv2e.diagnosis.outcome.picture import pictures_of
from adv2e.diagnosis.simulation.simulator import Progress
from adv2e.effects import label_of
from adv2e.reports.result import Diagnosis, ErrorRow, Estimate, SceneNumber, Verdict

_NOT_TRIED = {
    *OF_FRAMES, "clock_offset", "clock_drift", "initial_reference", "readout", "timestamp_tick",
}  # fmt: skip
"""Effects that the view stands for, or that recordings side by side cannot show."""
_DRAWS = 6
_ROUNDS = 25
_FIRST_DRAW = 100
_PARTLY, _SURE = 0.8, 0.01
_WHITE_DN = 255.0

MISFIT = (
    "misfit of the numbers of events in small parts of space and time, and of the times between"
    " them, over that of chance"
)


def diagnose_films(
    recordings: FilmRecordings, name: str, declared: Config, **options: Any
) -> Diagnosis:
    """Find the effects that a camera's declared model lacks, by what it saw.

    `options` as of :func:`adv2e.diagnosis.diagnose.diagnose`; `name` is that of the recordings.

    Raises
    ------
    ConfigError
        The low-pass is not solved, but stepped from instant to instant.
    """
    if recordings.films.moves:
        return _before_pictures(recordings, name, declared, **options)
    return _before_a_video(recordings, name, declared, **options)


def _before_a_video(
    recordings: FilmRecordings,
    name: str,
    declared: Config,
    *,
    free_thresholds: bool,
    threads: int,
    progress: Callable[[str, int], None],
    **options: Any,
) -> Diagnosis:
    """Fit the view of a video, and search as with frames."""
    telling = Progress(progress)
    keys = threshold_nuisance(declared) if free_thresholds else NOTHING
    fitter = FilmFitter(recordings.films, recordings.stream, threads, telling.count)
    telling.begin("fitting the view of the film")
    base = of_known_light(declared)
    start = first_view(recordings.films, fitter.measured)
    place, _ = fitter.fitted(Place(start, base, keys, first_point(keys)), _ROUNDS)
    evidence = evidence_of(recordings.films, place.view, fitter.measured, name)
    notes = [*recordings.notes, "the view of the film was fitted to all events of the recording"]
    found = diagnose(
        replace(evidence, notes=notes),
        replace(declared, frames=place.config.frames, pixel=place.config.pixel),
        free_thresholds=free_thresholds,
        threads=threads,
        progress=progress,
        **options,
    )
    return replace(found, view=list(_fitted_view(place.view, recordings.films)))


def _before_pictures(
    recordings: FilmRecordings,
    name: str,
    declared: Config,
    *,
    declared_name: str,
    without: Sequence[str],
    written: Collection[str] | None,
    free_thresholds: bool,
    threads: int,
    progress: Callable[[str, int], None],
    log: Callable[[str], None],
    known: Callable[[Diagnosis], None] | None,
) -> Diagnosis:
    """Fit views and effects to half of the recordings, and judge them by the others."""
    began = time.perf_counter()
    telling = Progress(progress)
    given, declared = declared, of_known_light(declared)
    fitter, judge = halves_of(recordings, threads, telling.count)
    pixels = judge.measured.width * judge.measured.height
    known_before = Given(given, written, free_thresholds, pixels, is_light=True)
    nuisances = threshold_nuisance(declared) if free_thresholds else NOTHING
    search = FilmSearch(fitter, judge, nuisances, threads, log, telling.begin)
    telling.begin("finding where the camera looked")
    first = search.start(first_view(fitter.films, fitter.measured), declared)
    hints = Hints(1.0, (), 1, double_read=double_reads(recordings.stream))
    candidates = [
        one
        for one in library(declared, hints)
        if one.name not in {*without, *_NOT_TRIED} and not nuisances.keys & one.keys
    ]

    def facts() -> dict[str, str]:
        return {
            "sensor": str(recordings.films.size),
            "recordings": f"{len(recordings.events):,}",
            "events": f"{sum(map(len, recordings.events)):,}",
            **facts_of(telling.done, declared.seed, began),
        }

    def told(steps: Sequence[Step]) -> Diagnosis:
        """Return what is found so far, and tell of it."""
        found = _diagnosis(
            steps,
            search,
            judge,
            late_us=_interleaved(fitter.delays_us, judge.delays_us),
            recording=name,
            declared=declared_name,
            given=known_before,
            notes=[*recordings.notes, _about(recordings)],
        )
        if known is not None:
            known(
                replace(
                    found,
                    verdict="unfinished",
                    remark=f"So far: {found.remark} All of this may still change.",
                    still="searching for what is missing",
                    facts=facts(),
                )
            )
        return found

    found = told([first])
    for steps in search.steps(first, candidates):
        found = told(steps)
    return replace(found, rejected=list(search.rejected.values()), facts=facts())


def halves_of(
    recordings: FilmRecordings, threads: int, count: Callable[[], None] = lambda: None
) -> tuple[FilmFitter, FilmFitter]:
    """Return fitters of the recordings that are fitted to and of those that judge, on one clock."""
    stream, number = recordings.stream, len(recordings.events)
    delays_us = first_delays(stream, number)
    rests_us = rests(stream, number, delays_us)
    late_us = np.tile(delays_us[:, None], len(rests_us) + 1)
    fitters = []
    for k in (0, 1):
        half = recordings.every_second(k)
        fitter = FilmFitter(half.films, half.stream, threads, count, rests_us)
        fitter.shift_us(late_us[k::2])
        fitters.append(fitter)
    return fitters[0], fitters[1]


def _about(recordings: FilmRecordings) -> str:
    count = len(recordings.events)
    return (
        f"{count - count // 2} of {count} recordings were fitted to, the others judge; what is"
        " fitted of the view is no knowledge: black and grey curve go together with the thresholds"
    )


def _diagnosis(
    steps: Sequence[Step],
    search: FilmSearch,
    judge: FilmFitter,
    *,
    late_us: NDArray[np.float64],
    given: Given,
    **about: Any,
) -> Diagnosis:
    first, last = steps[0], steps[-1]
    verdict, remark = _verdict(first, last)
    config, films = last.place.config, judge.films
    streams = [
        judge.streams(step.place.view, step.place.config, range(_FIRST_DRAW, _FIRST_DRAW + _DRAWS))
        for step in (first, last)
    ]
    evidence = evidence_of(films, last.place.view, judge.measured, "")
    scene = Scene.of_evidence(evidence, config)
    return Diagnosis(
        verdict=verdict,
        remark=remark,
        **given.told(config, search.fits(last)),
        rejected=list(search.rejected.values()),
        errors=_errors(first, last, streams, judge),
        global_p_before=first.probability,
        global_p_after=last.probability,
        split="every second recording is fitted to, from the first; the others judge",
        own=own_of(config),
        view=[*_fitted_view(last.place.view, films), _late(late_us)],
        **pictures_of(scene, evidence.stream, *streams),
        **about,
    )


def _verdict(first: Step, last: Step) -> tuple[Verdict, str]:
    if not last.effects:
        if first.probability >= _SURE:
            return "consistent", "The recordings are what the declared model makes."
        return (
            "unexplained",
            "No effect of the library brings the simulation nearer to recordings that were not"
            " fitted to: the rest may be the view, or an effect that is not in the library.",
        )
    share = 1.0 - last.error / first.error
    if last.probability >= _SURE:
        return "explained", "With this change nothing is left that these recordings show."
    names = " and ".join(label_of(one.name) for one in last.effects)
    if share >= _PARTLY:
        return (
            "partly_explained",
            f"This explains {share:.0%} of the difference; something is left, which may be the"
            " view: use the model found, but know what still differs.",
        )
    return (
        "unexplained",
        f"{names[:1].upper()}{names[1:]} brings the simulation nearer to recordings that were not"
        f" fitted to, and explains {share:.0%} of the difference: too little to be all. The rest"
        " may be the view, or an effect that is not in the library.",
    )


def _errors(
    first: Step, last: Step, streams: Sequence[Sequence[Stream]], judge: FilmFitter
) -> list[ErrorRow]:
    films = judge.films
    size, span, count = films.size, films.span_us, len(films.pictures)
    inside = split(judge.measured, count)
    made = [[split(stream, count) for stream in side] for side in streams]
    found = [[distances(inside, one, size, span) for one in side] for side in made]
    floor = [distances(a, b, size, span) for a, b in zip(made[1][:-1], made[1][1:], strict=True)]
    chance = Estimate(1.0)
    rows = [ErrorRow(MISFIT, Estimate(first.error + 1.0), Estimate(last.error + 1.0), chance)]
    for name in DISTANCES:
        before, after, between = (
            Estimate.of_draws([one[name] for one in side]) for side in (*found, floor)
        )
        rows.append(ErrorRow(name, before, after, between))
    return rows


def evidence_of(films: Films, view: View, stream: Stream, name: str) -> Evidence:
    """Return recordings of films with the light that a view gives them, as frames."""
    times_s = films.times_ns * 1e-9
    light: NDArray[np.float32] = films.light(view)
    return Evidence(
        name=name,
        frames=list(light),
        times_s=np.asarray(times_s, np.float64),
        stream=stream.between(times_s[0] * 1e6, times_s[-1] * 1e6),
        width=light.shape[2],
        height=light.shape[1],
        white=_WHITE_DN,
    )


def _interleaved(even: NDArray[np.float64], odd: NDArray[np.float64]) -> NDArray[np.float64]:
    every = np.empty((len(even) + len(odd), even.shape[1]))
    every[::2], every[1::2] = even, odd
    return every


def _late(late_us: NDArray[np.float64]) -> SceneNumber:
    meaning = "by how much each motion of each recording began later than the path says"
    return SceneNumber("late_ms", (late_us * 1e-3).round(2).tolist(), "ms", meaning, None)


def _fitted_view(view: View, films: Films) -> Iterator[SceneNumber]:
    yield SceneNumber("inverted", view.inverted, "", "what is bright in the film was dark", None)
    for one in UNKNOWNS:
        value = getattr(view, one.name)
        yield SceneNumber(one.name, value, one.unit, one.meaning, (one.low, one.high))
    reach = films.reach_px
    times_ms = films.times_ns * 1e-6
    path = films.positions(view)
    every = slice(None, None, max(1, math.ceil(len(path) / 40)) if films.moves else len(path))
    rows = np.column_stack([times_ms, path])[every].round(3).tolist()
    meaning = "time [ms], then columns and rows from the film's middle to what the sensor's sees"
    yield SceneNumber("path", rows, "px", meaning, (-reach, reach))

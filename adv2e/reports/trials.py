"""Sections of the page on effects that are not in the model: those as good, those rejected."""

from __future__ import annotations

import math
from collections.abc import Sequence

from adv2e.reports.keys import summary_of, unit_of
from adv2e.reports.markup import SHOWN, Column, Markup, join, table, tag
from adv2e.reports.quantities import NOTHING, unit_text, value_text
from adv2e.reports.result import Diagnosis, Finding, Rejected

SEPARATIONS = {
    "thresholds": "a scene that returns to where it began, at two contrasts: signed steps then sum"
    " to zero only with the right thresholds, at every speed and brightness",
    "threshold_mismatch": "two different textures: what stays at the same pixels is the sensor,"
    " what moves with the texture is the scene",
    "threshold_drift": "the same motion early and late in a long recording",
    "low_pass": "the same motion in bright and dim light: its lag falls with the light, and so"
    " does the tail after the motion stops",
    "dark_current": "lag over more than one and a half decades of light: it levels off in the dark",
    "source_follower": "fast and slow edges in bright light: it delays and weakens fast changes at"
    " every brightness, while a clock offset shifts slow ones as much",
    "slew_limit": "steps of several sizes (more than a factor of e) at the same light: latency"
    " grows with the size of the step",
    "refractory": "fast, high-contrast edges: no two events of a pixel are nearer than a fixed"
    " time, at every brightness, and more is lost the steeper the edge",
    "reset_overshoot": "edges of different steepness: the first event after a reset comes late or"
    " early by the same contrast, whatever the steepness",
    "leak": "a scene at rest: regular ON events at every brightness, also in the dark",
    "photo_leak": "a scene at rest with bright and dark parts: regular ON events whose rate is"
    " proportional to the light",
    "shot_noise": "a scene at rest: ON and OFF events without order, fewer in bright light",
    "photoreceptor_noise": "a scene at rest: ON and OFF events that alternate, at a rate that falls"
    " steeply with the threshold",
    "hot_pixels": "a scene at rest, or a closed lens: few pixels hold most events",
    "dead_pixels": "a texture moved across the whole sensor: some pixels stay silent",
    "flicker": "the same scene by daylight or direct current: the line in the rate disappears",
    "frame_coupling": "a scene at rest at two frame rates: the bursts stay with the frames",
    "readout": "strong motion of the whole picture: delays grow with the rate of all pixels, and"
    " events come row by row",
    "event_loss": "motion of a small and of a large part of the picture: a share that is lost"
    " everywhere does not depend on the rate",
    "timestamp_tick": "none needed: all times are multiples of the tick",
    "frame_encoding": "one motion over dark and bright parts: the ratio of events between them",
    "black_level": "one motion over very dark parts: contrast is lost there and nowhere else",
    "exposure_blur": "small, fast features at two exposure times",
    "clock_offset": "fast and slow motion: the delay is the same for all pixels, speeds and light",
    "clock_drift": "a long recording: the delay between frames and events grows steadily",
    "misregistration": "motion in two opposite directions: a shift stays, a delay turns round",
}
"""For each effect, by its name in a diagnosis: the recording that would single it out."""


def alternatives(diagnosis: Diagnosis) -> Markup:
    """Return the table of alternatives: effects that fit as well, and how to tell them apart."""
    if not diagnosis.alternatives:
        return Markup()
    names = [finding.name for finding in diagnosis.effects] + diagnosis.alternatives
    paths = _paths(diagnosis)
    rows = []
    for name in dict.fromkeys(names):
        role = "fits as well" if name in diagnosis.alternatives else "in the model found"
        heading = join(name, tag("span", role, class_="meaning"))
        summary = summary_of(name, paths.get(name, []), diagnosis.own)
        rows.append((heading, summary, SEPARATIONS.get(name, "not known")))
    columns = [Column("effect"), Column("what it is"), Column("what would show it")]
    lead = (
        "These data do not tell the following effects apart; recordings of the kind in the last"
        " column would."
    )
    caption = "Effects that fit these data as well, and the recordings that would tell them apart"
    return join(tag("p", lead), table(caption, columns, rows))


def _paths(diagnosis: Diagnosis) -> dict[str, list[str]]:
    """Return the keys of each effect, as far as the diagnosis names them."""
    paths = {one.name: [one.key] for one in diagnosis.detectable}
    trials: list[Rejected | Finding] = [*diagnosis.rejected, *diagnosis.effects]
    for trial in trials:
        paths.setdefault(trial.name, []).extend(trial.parameters)
    return paths


def rejected(diagnosis: Diagnosis) -> Markup:
    """Return the table of rejected effects, with the reasons."""
    given = by_explained(diagnosis.rejected)
    if not given:
        return Markup()
    columns = [
        Column("effect, and the values it was tried with"),
        Column("explains", number=True),
        Column("why not"),
    ]
    caption = (
        "Effects tried and not added, those that explain most first. Explains:"
        f" {diagnosis.wording.explained}; below 0: it adds to it; {NOTHING}: not known"
    )
    rows = []
    for one in given:
        tried = [
            f"{path} = {value_text(value)} {unit_text(unit_of(path, diagnosis.own))}".rstrip()
            for path, value in one.parameters.items()
        ]
        lines = [tag("span", text, class_="meaning") for text in tried]
        rows.append((join(one.name, *lines), _explained(one), one.reason))
    return table(caption, columns, rows, folded_from=SHOWN)


def by_explained(given: Sequence[Rejected]) -> list[Rejected]:
    """Return effects sorted by what they explain, most first; unknown shares come last."""
    return sorted(given, key=lambda one: math.inf if _is_unknown(one) else one.held_out or 0.0)


def _is_unknown(one: Rejected) -> bool:
    return one.held_out is None or math.isnan(one.held_out)


def _explained(one: Rejected) -> str:
    if one.held_out is None or not math.isfinite(one.held_out):
        return NOTHING
    return f"{round(100.0 * (1.0 - one.held_out), 1) + 0.0:,.1f} %"

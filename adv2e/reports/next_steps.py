"""Next steps after a diagnosis: use the model, check the recording, record more."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path

from adv2e.reports.labels import label_of
from adv2e.reports.result import Diagnosis
from adv2e.reports.standing_out import of_each_kind
from adv2e.reports.trials import SEPARATIONS
from adv2e.reports.wording import OF_TABLES

_OWN_EFFECT = "adv2e diagnose RECORDING -c DECLARED.yaml --effect my_effect.py"
_WHAT_FOR = {
    "consistent": "The declared model is good as it is. Make events from another video with it:",
    "explained": "Make events from another video with the model found:",
    "partly_explained": "Make events from another video with the model found, as far as it goes:",
    "not_identifiable": "Make events from another video with the best of these models:",
}


@dataclass(frozen=True)
class Step:
    """Next step: advice, and a command line to copy, if there is one."""

    text: str
    line: str = ""


def next_steps(found: Diagnosis, folder: str | Path) -> list[Step]:
    """Return the next steps, the most useful first; `folder`: of the report."""
    if found.verdict == "unexplained":
        return [*_checks(found), _own_effect(found)]
    steps = [Step(_WHAT_FOR[found.verdict], convert_line(found, folder))]
    if found.verdict == "not_identifiable":
        steps.append(_separate(found))
    if found.verdict == "partly_explained":
        steps.append(_own_effect(found))
    return steps


def convert_line(found: Diagnosis, folder: str | Path) -> str:
    """Return the command that makes events with the model found."""
    line = f"adv2e convert -c {shlex.quote(str(Path(folder) / 'model.yaml'))}"
    own = found.model.get("user") or {}
    for name in own:
        line += f" --effect {shlex.quote(found.own.files.get(name, f'{name}.py'))}"
    return f"{line} VIDEO"


def _checks(found: Diagnosis) -> list[Step]:
    """Return the check of the recording to do first: mistakes are likelier than unknown effects."""
    return [Step(f"First check the recording: {note}.") for note in found.input_checks[:1]]


def _own_effect(found: Diagnosis) -> Step:
    if found.wording is OF_TABLES:  # no own effects compete there
        text = "Check whether the errors of the rows are larger than stated, for example 10 %:"
        return Step(text, "adv2e characterise TABLE -c DECLARED.yaml --error 0.1")
    groups = [one.group for one in of_each_kind(found.signatures) if one.after]
    why = f" It has to change what differs here: {', '.join(groups)}." if groups else ""
    text = "Write the effect that you suspect as a class of your own, and let it compete."
    return Step(f"{text}{why}", _OWN_EFFECT)


def _separate(found: Diagnosis) -> Step:
    names = [one.name for one in found.effects[-1:]] + found.alternatives
    known = [f"{label_of(name)}: {SEPARATIONS[name]}" for name in names if name in SEPARATIONS]
    if not known:
        return Step("Record a scene in which these effects differ.")
    return Step(f"Record what tells them apart. For {known[0]}.")

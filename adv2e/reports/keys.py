"""Names, units and meanings of keys and effects, as reports write them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from adv2e.config import Config, all_keys
from adv2e.effects import EFFECTS, label_of
from adv2e.parameters import Parameter


@dataclass(frozen=True)
class Own:
    """Declarations of user effects.

    Attributes
    ----------
    keys : mapping of str to Parameter
        Their keys, by path.
    summaries : mapping of str to str
        What each effect is, by name.
    files : mapping of str to str
        Where each effect is written, by name.
    """

    keys: Mapping[str, Parameter] = field(default_factory=dict)
    summaries: Mapping[str, str] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)


NO_OWN = Own()


def known_keys(section: type[Config] = Config) -> Mapping[str, Parameter]:
    """Return the declaration of each key, by its path."""
    return {key.path: key.about for key in all_keys(section)}


BUILT_IN = known_keys()


def _about(path: str, own: Own) -> Parameter | None:
    return BUILT_IN.get(path, own.keys.get(path))


def unit_of(path: str, own: Own = NO_OWN) -> str:
    """Return the unit of the key `path`, empty where it has none or is not known."""
    about = _about(path, own)
    return about.unit if about is not None and about.unit != "-" else ""


def meaning_of(path: str, own: Own = NO_OWN) -> str:
    """Return the meaning of the key `path`, "" where it is not known."""
    about = _about(path, own)
    return about.meaning if about is not None else ""


def summary_of(name: str, paths: Sequence[str] = (), own: Own = NO_OWN) -> str:
    """Return in a line what the effect `name` is; if no module is called that, by its keys."""
    if name in own.summaries:
        return own.summaries[name]
    for effect in EFFECTS:
        if effect.name == name:
            return effect.summary()
    for effect in EFFECTS:
        sections = tuple(f"{section}." for section in effect.paths)
        if any(f"{path}.".startswith(sections) for path in paths):
            return effect.summary()
    return ""


# ---- Names of effects and their keys in sentences for people.


_UNIT = re.compile("_(us|ns|hz|rad|dn|px|ppm|per_s)$")


def heading_of(effect: str) -> str:
    """Return the same as a heading, with the effect's name where that is another."""
    label = label_of(effect)
    heading = f"{label[:1].upper()}{label[1:]}"
    return heading if label == effect.replace("_", " ") else f"{heading} ({effect})"


def part_of(path: str, *, alone: bool) -> str:
    """Return the name of a key beside its effect, "" if it is the only key, and clear."""
    label = BUILT_IN[path].label if path in BUILT_IN else ""
    if label or alone:
        return label
    return _UNIT.sub("", path.rpartition(".")[2]).replace("_", " ")

"""What keys and effects are, as declared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType

from adv2e.config import Key, all_keys
from adv2e.effects import EFFECTS
from adv2e.parameters import Parameter
from adv2e.reports.result import NO_OWN, Own


@lru_cache(maxsize=1)
def _declared() -> Mapping[str, Key]:
    return MappingProxyType({key.path: key for key in all_keys()})


def key_named(path: str) -> Key | None:
    """Return the declaration of the key `path`, or None for a key of a user's own effect."""
    return _declared().get(path)


def _about(path: str, own: Own) -> Parameter | None:
    key = key_named(path)
    return own.keys.get(path) if key is None else key.about


def unit_of(path: str, own: Own = NO_OWN) -> str:
    """Return the unit of the key `path`, empty where it has none or is not known."""
    about = _about(path, own)
    return about.unit if about is not None and about.unit != "-" else ""


def meaning_of(path: str, own: Own = NO_OWN) -> str:
    """Return what the key `path` means, empty where that is not known."""
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
        if any(_below(path, section) for path in paths for section in effect.paths):
            return effect.summary()
    return ""


def _below(path: str, section: str) -> bool:
    return path == section or path.startswith(f"{section}.")

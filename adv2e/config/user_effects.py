"""Sections for effects of the user's own.

A configuration that knows them is of a class made for them: that of all configurations with one
more section, ``user``, and in it a section for each effect, named after it.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Mapping, Sequence
from dataclasses import MISSING
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from adv2e.config.model import Config
from adv2e.errors import ConfigError
from adv2e.parameters import Section, subsection

if TYPE_CHECKING:
    from adv2e.effects.hooks import Hooks


def config_class(effects: Sequence[type[Hooks]]) -> type[Config]:
    """Return the class of configurations with a section ``user.<name>`` for each of `effects`.

    An effect is on, with the defaults of its parameters, unless the configuration says otherwise.

    Raises
    ------
    ConfigError
        Two of them have the same name.
    """
    return _config_class(tuple(effects))


@lru_cache(maxsize=64)
def _config_class(effects: tuple[type[Hooks], ...]) -> type[Config]:
    if not effects:
        return Config
    by_name: dict[str, type[Hooks]] = {}
    for effect in effects:
        if effect.name in by_name:
            raise ConfigError(f"user.{effect.name}: two effects have this name: rename one")
        by_name[effect.name] = effect
    fields = [
        (name, effect.Parameters | None, _declared(effect)) for name, effect in by_name.items()
    ]
    user = dataclasses.make_dataclass(
        "User", fields, bases=(Section,), frozen=True, kw_only=True, namespace={"effects": by_name}
    )
    needed = any(field.default_factory is MISSING for _, _, field in fields)
    declared = subsection(MISSING if needed else user, meaning="effects of your own")
    return dataclasses.make_dataclass(
        "Config", [("user", user, declared)], bases=(Config,), frozen=True, kw_only=True
    )


def _declared(effect: type[Hooks]) -> Any:
    section = effect.Parameters
    needed = any(
        item.default is MISSING and item.default_factory is MISSING
        for item in dataclasses.fields(section)
    )
    meaning = (inspect.getdoc(effect) or effect.name).partition("\n")[0]
    return subsection(MISSING if needed else section, meaning=meaning)


def user_effects(config: Config) -> Mapping[str, type[Hooks]]:
    """Return the effects of the user's own that a configuration has sections for, by name."""
    user = getattr(config, "user", None)
    return {} if user is None else type(user).effects

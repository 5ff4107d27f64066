"""A configuration as dotted keys, and the effects of the user's own that it has sections for."""

from __future__ import annotations

import inspect
from collections.abc import Collection, Mapping
from typing import Any

from adv2e.config import Config, from_dict, to_dict
from adv2e.config.build import all_keys
from adv2e.config.paths import set_key
from adv2e.effects.hooks import Hooks
from adv2e.parameters import Parameter
from adv2e.reports.result import Own


def with_keys(config: Config, keys: Mapping[str, Any]) -> Config:
    """Return `config` with other values of some keys, given by their paths."""
    values = to_dict(config)
    for key, value in keys.items():
        set_key(values, key, value)
    return from_values(values, ", ".join(keys), config)


def from_values(values: dict[str, Any], name: str, like: Config) -> Config:
    """Return the configuration of nested mappings, with the sections of `like`.

    Parameters
    ----------
    values : dict
    name : str
        What a mistake is put down to.
    like : Config
    """
    return from_dict(values, name, list(user_effects(like).values()))


def known_keys(section: type[Config]) -> dict[str, Parameter]:
    """Return what is declared of each key, by its path."""
    return {key.path: key.about for key in all_keys(section)}


def about_key(config: Config, key: str) -> Parameter:
    """Return what is declared of a key of a configuration."""
    return known_keys(type(config))[key]


def user_effects(config: Config) -> Mapping[str, type[Hooks]]:
    """Return the effects of the user's own that a configuration has sections for, by name."""
    user = getattr(config, "user", None)
    return {} if user is None else type(user).effects


def own_of(config: Config) -> Own:
    """Return what is declared of the effects of the user's own that a configuration knows."""
    effects = user_effects(config)
    about = known_keys(type(config)) if effects else {}
    return Own(
        {path: one for path, one in about.items() if path.startswith("user.")},
        {
            name: (inspect.getdoc(effect) or "").partition("\n")[0]
            for name, effect in effects.items()
        },
    )


def as_found(config: Config) -> dict[str, Any]:
    """Return a configuration as nested mappings, without effects of the user's own that are off.

    Where none of them is on, it can be used without their files.
    """
    values = to_dict(config)
    on = {name: keys for name, keys in values.pop("user", {}).items() if keys is not None}
    return {**values, "user": on} if on else values


def without_user_effects(config: Config, written: Collection[str] = ()) -> Config:
    """Return the configuration with effects of the user's own switched off.

    Parameters
    ----------
    config : Config
    written : collection of str
        Dotted keys that somebody wrote; effects with a section among them stay as they are.
    """
    effects = user_effects(config)
    off = [
        name
        for name in effects
        if not any(f"{key}.".startswith(f"user.{name}.") for key in written)
    ]
    if not off:
        return config
    values = to_dict(config)
    values["user"] |= dict.fromkeys(off)
    return from_values(values, "user", config)

"""A configuration as dotted keys."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from adv2e.config import Config, from_dict, to_dict
from adv2e.config.build import all_keys
from adv2e.config.own import user_effects
from adv2e.config.paths import set_key
from adv2e.parameters import Parameter


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

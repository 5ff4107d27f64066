"""Effects of the user's own in a diagnosis: on or off, and what the report says of them."""

from __future__ import annotations

import inspect
from collections.abc import Collection
from typing import Any

from adv2e.config import Config, to_dict
from adv2e.config.own import user_effects
from adv2e.diagnosis.fitting.keys import from_values, known_keys
from adv2e.reports.result import Own


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

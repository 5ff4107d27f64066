"""What a diagnosis does with configurations: sets keys by their paths, and takes effects away."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from typing import Any

from adv2e.config import Config, from_dict, to_dict
from adv2e.config.model import Frames, Sampling
from adv2e.config.paths import get_key, set_key
from adv2e.config.user_effects import user_effects
from adv2e.effects.readout.frame_coupling import FrameCoupling
from adv2e.errors import ConfigError
from adv2e.reports.keys import Own, known_keys


def with_keys(config: Config, keys: Mapping[str, Any]) -> Config:
    """Return `config` with other values of some keys, given by their paths."""
    values = to_dict(config)
    for key, value in keys.items():
        set_key(values, key, value)
    return from_values(values, ", ".join(keys), config)


def from_values(values: dict[str, Any], name: str, like: Config) -> Config:
    """Return the configuration of nested mappings, with the sections of `like`.

    A mistake is put down to `name`.
    """
    return from_dict(values, name, list(user_effects(like).values()))


def coupling_of(config: Config) -> FrameCoupling | None:
    """Return what the readout of frames does to the pixels, if anything."""
    return None if config.readout is None else config.readout.frame_coupling


def without_coupling(config: Config) -> Config:
    """Return `config` without what the readout of frames does to the pixels.

    Frames that are left out of a simulation, to see what is made up between others, were read out
    all the same: with it both were to be compared without.
    """
    if config.readout is None or coupling_of(config) is None:
        return config
    return replace(config, readout=replace(config.readout, frame_coupling=None))


def of_known_light(config: Config) -> Config:
    """Return `config` for light that is known: nothing is between it and the pixels but its clock.

    Raises
    ------
    ConfigError
        Its low-pass is not solved, but stepped from instant to instant.
    """
    low_pass = config.pixel.low_pass
    if low_pass is not None and low_pass.update != "exact":
        raise ConfigError(
            f"pixel.low_pass.update: must be exact where the light is known, got {low_pass.update}"
        )
    clock = config.frames
    frames = Frames(
        encoding="linear",
        clock_offset_us=clock.clock_offset_us,
        clock_drift_ppm=clock.clock_drift_ppm,
    )
    return replace(without_coupling(config), frames=frames, sampling=Sampling(L=1))


def of_frames_again(config: Config, given: Config) -> Config:
    """Return what :func:`of_known_light` made of `given`, and changed, with what it took away."""
    found = config.frames
    frames = replace(
        given.frames, clock_offset_us=found.clock_offset_us, clock_drift_ppm=found.clock_drift_ppm
    )
    readout = config.readout
    if readout is not None:
        readout = replace(readout, frame_coupling=coupling_of(given))
    return replace(config, frames=frames, sampling=given.sampling, readout=readout or given.readout)


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
        {name: path for name, effect in effects.items() if (path := _file_of(effect))},
    )


def _file_of(effect: type) -> str:
    """Return where an effect is written, as it was named; nothing where that is no file."""
    return str(getattr(sys.modules.get(effect.__module__), "__file__", None) or "")


def declared_of(config: Config, keys: Iterable[str]) -> dict[str, Any]:
    """Return what a configuration holds of some keys, by path; None where their section is off."""
    values = to_dict(config)
    return {key: get_key(values, key) for key in keys}


def defaults_of(held: Mapping[str, Any], written: Collection[str] | None) -> list[str]:
    """Return those keys that nobody wrote, as far as `written` tells: it does not name lists."""
    if written is None:
        return []
    return [
        key
        for key, value in held.items()
        if key not in written and value is not None and not isinstance(value, (list, tuple))
    ]


def as_found(config: Config) -> dict[str, Any]:
    """Return a configuration as nested mappings, without effects of the user's own that are off.

    Where none of them is on, it can be used without their files.
    """
    values = to_dict(config)
    on = {name: keys for name, keys in values.pop("user", {}).items() if keys is not None}
    return {**values, "user": on} if on else values


def without_user_effects(config: Config, written: Collection[str] = ()) -> Config:
    """Return the configuration with effects of the user's own switched off.

    Those with a section among the dotted keys `written`, by somebody, stay as they are.
    """
    off = {
        f"user.{name}": None
        for name in user_effects(config)
        if not any(f"{key}.".startswith(f"user.{name}.") for key in written)
    }
    return with_keys(config, off) if off else config

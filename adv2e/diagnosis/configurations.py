"""Configurations in a diagnosis: keys set by their paths, effects switched off."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from typing import Any

from adv2e.config import Config, from_dict, to_dict
from adv2e.config.model import Frames, Sampling
from adv2e.config.tree import get_key, set_key
from adv2e.config.user_effects import user_effects
from adv2e.effects.readout.frame_coupling import FrameCoupling
from adv2e.errors import ConfigError
from adv2e.reports.markup import Own, known_keys


def with_keys(config: Config, keys: Mapping[str, Any]) -> Config:
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
    return None if config.readout is None else config.readout.frame_coupling


def without_coupling(config: Config) -> Config:
    """Return `config` without the coupling of the frame readout to the pixels.

    Leaving out frames measures the error of interpolation.  The camera read those frames out all
    the same, so simulations with and without them are compared without this coupling.
    """
    if config.readout is None or coupling_of(config) is None:
        return config
    return replace(config, readout=replace(config.readout, frame_coupling=None))


def of_known_light(config: Config, steps: int = 1) -> Config:
    """Return `config` for light that is known: nothing is between it and the pixels but its clock.

    `steps` in which they follow it from one instant to the next.

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
    return replace(without_coupling(config), frames=frames, sampling=Sampling(L=steps))


def of_frames_again(config: Config, given: Config) -> Config:
    """Undo :func:`of_known_light`: sections of frames as in `given`, but the clock as fitted."""
    found = config.frames
    frames = replace(
        given.frames, clock_offset_us=found.clock_offset_us, clock_drift_ppm=found.clock_drift_ppm
    )
    readout = config.readout
    if readout is not None:
        readout = replace(readout, frame_coupling=coupling_of(given))
    return replace(config, frames=frames, sampling=given.sampling, readout=readout or given.readout)


def own_of(config: Config) -> Own:
    """Return the declarations of the user effects of a configuration: keys, meanings, files."""
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
    return str(getattr(sys.modules.get(effect.__module__), "__file__", None) or "")


def declared_of(config: Config, keys: Iterable[str]) -> dict[str, Any]:
    """Return the values of some keys by path; None where their section is off."""
    values = to_dict(config)
    return {key: get_key(values, key) for key in keys}


def defaults_of(held: Mapping[str, Any], written: Collection[str] | None) -> list[str]:
    """Return the keys with default values: not in `written`, which does not name lists."""
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

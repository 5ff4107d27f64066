"""The effects, one module each, by stage and in signal order.

A stage is a subpackage: what happens to the frames before the pixel sees them, what happens inside
the pixel, and what happens to events on their way out.  This table is the one place that says
which effects there are.  All else stands in the module of each: physics, equation and sources in
its docstring; its keys with unit, range and where a fit begins; ``LABELS``, its name in a sentence;
and ``SEPARATED_BY``, the recording that tells it from others.
"""

from __future__ import annotations

import importlib
import inspect
from dataclasses import dataclass
from types import ModuleType

STAGES = {
    "frames": "on the frames, before the pixel",
    "pixel": "inside the pixel",
    "readout": "between the pixel and the file",
}
"""The stages in signal order, each with what it means."""


@dataclass(frozen=True)
class Effect:
    """One effect: where its module is and which keys of the configuration are its own.

    Module and section are named as the effect, unless it says otherwise.
    """

    stage: str
    name: str
    own_paths: tuple[str, ...] = ()
    own_module: str = ""
    told_as: tuple[str, ...] = ()
    """Names under which a diagnosis finds a part of it."""

    @property
    def paths(self) -> tuple[str, ...]:
        """Paths of its keys: one section named after it, or single keys."""
        return self.own_paths or (f"{self.stage}.{self.name}",)

    @property
    def module(self) -> ModuleType:
        name = self.own_module or self.name
        return importlib.import_module(f"adv2e.effects.{self.stage}.{name}")

    def text(self) -> str:
        """Return the docstring of its module: physics, equation, references."""
        return inspect.getdoc(self.module) or ""

    def summary(self) -> str:
        return self.text().partition("\n")[0]


EFFECTS = (
    Effect(
        "frames", "encoding", ("frames.encoding", "frames.full_scale"), told_as=("frame_encoding",)
    ),
    Effect("frames", "clock_drift", ("frames.clock_drift_ppm",)),
    Effect("frames", "clock_offset", ("frames.clock_offset_us",)),
    Effect("frames", "black_level", ("frames.black_level_dn", "frames.black_depth_dn")),
    Effect("frames", "exposure_blur", ("frames.exposure_us",)),
    Effect("frames", "misregistration", ("frames.shift_px",)),
    Effect("frames", "flicker"),
    Effect("pixel", "dark_current"),
    Effect("pixel", "log_response"),
    Effect("pixel", "photoreceptor_noise"),
    Effect("pixel", "low_pass"),
    Effect("pixel", "slew_limit"),
    Effect("pixel", "source_follower"),
    Effect("pixel", "high_pass"),
    Effect("pixel", "initial_reference", ("pixel.initial_reference",)),
    Effect("pixel", "thresholds", told_as=("threshold_mismatch",)),
    Effect("pixel", "threshold_drift", ("pixel.thresholds.drift_per_s",)),
    Effect("pixel", "refractory"),
    Effect("pixel", "reset_overshoot"),
    Effect("pixel", "leak", told_as=("photo_leak",)),
    Effect("pixel", "shot_noise"),
    Effect("pixel", "hot_pixels"),
    Effect("pixel", "dead_pixels"),
    Effect("readout", "frame_coupling"),
    Effect("readout", "readout", ("readout.arbiter",), "arbiter"),
    Effect("readout", "double_read"),
    Effect("readout", "event_loss", ("readout.loss",)),
    Effect("readout", "timestamp_tick", ("readout.tick_us",)),
)
"""All effects, in signal order."""


def label_of(name: str) -> str:
    """Return the name of an effect in a sentence: ``LABELS`` of its module, or as it is called."""
    return _declared(name, "LABELS") or name.replace("_", " ")


def separated_by(name: str) -> str:
    """Return the recording that singles an effect out: ``SEPARATED_BY`` of its module, or ""."""
    return _declared(name, "SEPARATED_BY")


def _declared(name: str, table: str) -> str:
    effect = named().get(name)
    found: str = getattr(effect.module, table, {}).get(name, "") if effect else ""
    return found


def named() -> dict[str, Effect]:
    return {name: effect for effect in EFFECTS for name in (effect.name, *effect.told_as)}

"""Keys of the camera: those of the package's configuration, and those of effects it does not have.

Settings are nested mappings as in a YAML file.  A section that is absent or None is switched off.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from copy import deepcopy
from typing import Any

Settings = Mapping[str, Any]

_NAMES = {
    "": ("seed",),
    "sampling": ("L", "K", "interpolation"),
    "frames": (
        "encoding",
        "full_scale",
        "black_level_dn",
        "exposure_us",
        "clock_offset_us",
        "clock_drift_ppm",
        "shift_px",
    ),
    "frames.flicker": ("frequency_hz", "depth", "in_frames"),
    "pixel": ("initial_reference",),
    "pixel.log_response": ("linear_below", "floor"),
    "pixel.low_pass": ("cutoff_hz", "dark_cutoff_hz", "update"),
    "pixel.dark_current": ("dn",),
    "pixel.source_follower": ("cutoff_hz",),
    "pixel.high_pass": ("cutoff_hz",),
    "pixel.slew_limit": ("per_s",),
    "pixel.thresholds": ("on", "off", "mismatch", "drift_per_s"),
    "pixel.refractory": ("period_us",),
    "pixel.reset_overshoot": ("fraction",),
    "pixel.leak": ("rate_hz", "photo_rate_hz", "jitter"),
    "pixel.shot_noise": ("rate_hz",),
    "pixel.photoreceptor_noise": ("rms",),
    "pixel.hot_pixels": ("fraction", "rate_hz"),
    "pixel.dead_pixels": ("fraction",),
    "readout.frame_coupling": ("amplitude", "tau_us", "delay_us", "width_us", "period_us"),
    "readout.arbiter": ("event_ns", "row_ns"),
    "readout.double_read": ("on", "off", "polarity"),
    "readout.loss": ("fraction",),
    "readout": ("tick_us",),
    "outside.surround": ("share", "sigma_px"),
    "outside.adaptation": ("share", "corner_hz"),
    "outside.image_lag": ("share", "tau_us"),
    "outside.column_gain": ("rms",),
    "outside.corner_ramp": ("per_s",),
    "outside.threshold_vignette": ("rise",),
    "outside.threshold_wobble": ("depth", "frequency_hz"),
    "outside.off_dead_time": ("factor",),
    "outside.echo": ("share", "delay_us"),
    "outside.sign_flips": ("share",),
}

KEYS = [f"{path}.{name}".lstrip(".") for path, names in _NAMES.items() for name in names]
"""Every key, by its path.  Those below ``outside`` are effects that the package does not have."""

SECTIONS = {key.rpartition(".")[0] for key in KEYS} | {key.partition(".")[0] for key in KEYS}

BENCH: dict[str, Any] = {
    "seed": 0,
    "frames": {"encoding": "linear", "full_scale": 65535},
    "sampling": {"L": 1, "K": 10, "interpolation": "linear"},
    "pixel": {
        "initial_reference": "settled",
        "log_response": {"linear_below": 0},
        "low_pass": {"cutoff_hz": 300.0, "dark_cutoff_hz": 20.0, "update": "exact"},
        "source_follower": None,
        "thresholds": {"on": 0.2, "off": 0.2, "mismatch": 0.02},
        "refractory": {"period_us": 500.0},
        "leak": {"rate_hz": 0.2, "photo_rate_hz": 0.0, "jitter": 0.0},
        "shot_noise": {"rate_hz": 1.0},
        "hot_pixels": None,
    },
}
"""A camera as a bench test describes it; the usual declared part."""


def merged(base: Settings, *others: Settings) -> dict[str, Any]:
    """Return `base` with `others` over it, mapping by mapping; later ones win."""
    result = deepcopy(dict(base))
    for other in others:
        for key, value in other.items():
            below = result.get(key)
            if isinstance(value, Mapping):
                result[key] = merged(below if isinstance(below, Mapping) else {}, value)
            else:
                result[key] = deepcopy(value)
    return result


def paths(settings: Settings, above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield (dotted path, value) of everything that is not a mapping."""
    for key, value in settings.items():
        path = f"{above}{key}"
        if isinstance(value, Mapping):
            yield from paths(value, f"{path}.")
        else:
            yield path, value


def check(settings: Settings) -> None:
    """Raise KeyError for a key that the camera does not know."""
    for path, value in paths(settings):
        if path in KEYS or (value is None and path in SECTIONS):
            continue
        near = difflib.get_close_matches(path, KEYS, 1)
        raise KeyError(f"{path}: unknown key" + (f", did you mean {near[0]!r}?" if near else ""))


def section(settings: Settings, path: str) -> Settings | None:
    """Return the section at a dotted `path`, None if it is absent or switched off."""
    value = find(settings, path, None)
    assert value is None or isinstance(value, Mapping), f"{path}: must be a section"
    return value


def find(settings: Settings, path: str, default: Any) -> Any:
    """Return the value at a dotted `path`; `default` if it or anything above it is absent."""
    value: Any = settings
    for name in path.split("."):
        if not isinstance(value, Mapping) or value.get(name) is None:
            return default
        value = value[name]
    return value

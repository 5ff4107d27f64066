"""Every effect in three sizes: what a study of diagnosis records.

The middle size of each effect shows beside the noise and mismatch of a camera as ``BENCH`` declares
it: in the events, or, for effects on the frames, in what the frames make of them.  Most raise the
distance to the declared model; leak by light, arbiter, ticks and a wobble hardly do, and show in
still parts, in the spacing of stamps and as a line in the rate.  The large size is as much as real
cameras show, or more; the small one may be too small to be found.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from camera.settings import BENCH, Settings, merged

SIZES = ("small", "middle", "large")


@dataclass(frozen=True)
class Case:
    """One effect in one size: what to give to the camera as ``hidden``."""

    name: str
    size: str
    hidden: Settings
    in_library: bool = True


def _keys(values: dict[str, Any]) -> dict[str, Any]:
    """Return dotted keys as nested mappings."""
    result: dict[str, Any] = {}
    for path, value in values.items():
        for name in reversed(path.split(".")):
            value = {name: value}  # noqa: PLW2901 - wrapped from the inside out
        result = merged(result, value)
    return result


_LIBRARY: dict[str, dict[str, tuple[Any, Any, Any]]] = {
    "thresholds": {"pixel.thresholds.on": (0.215, 0.24, 0.30)},
    "threshold_mismatch": {"pixel.thresholds.mismatch": (0.03, 0.05, 0.08)},
    "threshold_drift": {"pixel.thresholds.drift_per_s": (0.08, 0.25, 0.60)},
    "low_pass": {"pixel.low_pass.cutoff_hz": (200.0, 120.0, 60.0)},
    "dark_current": {"pixel.dark_current.dn": (1.0, 3.0, 10.0)},
    "source_follower": {"pixel.source_follower.cutoff_hz": (150.0, 60.0, 25.0)},
    "slew_limit": {"pixel.slew_limit.per_s": (80.0, 40.0, 20.0)},
    "high_pass": {"pixel.high_pass.cutoff_hz": (0.3, 1.0, 4.0)},
    "refractory": {"pixel.refractory.period_us": (1500.0, 4000.0, 10000.0)},
    "reset_overshoot": {"pixel.reset_overshoot.fraction": (0.05, 0.15, 0.30)},
    "leak": {"pixel.leak.rate_hz": (0.5, 2.0, 6.0)},
    "photo_leak": {"pixel.leak.photo_rate_hz": (1.5, 5.0, 15.0)},
    "shot_noise": {"pixel.shot_noise.rate_hz": (1.7, 4.0, 10.0)},
    "photoreceptor_noise": {"pixel.photoreceptor_noise.rms": (0.03, 0.045, 0.06)},
    "hot_pixels": {
        "pixel.hot_pixels.fraction": (0.002, 0.005, 0.01),
        "pixel.hot_pixels.rate_hz": (50.0, 100.0, 200.0),
    },
    "dead_pixels": {"pixel.dead_pixels.fraction": (0.005, 0.015, 0.04)},
    "flicker": {
        "frames.flicker.frequency_hz": (100.0, 100.0, 120.0),
        "frames.flicker.depth": (0.06, 0.15, 0.35),
    },
    "frame_coupling": {
        "readout.frame_coupling.amplitude": (0.02, 0.05, 0.12),
        "readout.frame_coupling.tau_us": (300.0, 300.0, 300.0),
    },
    "readout": {
        "readout.arbiter.event_ns": (500.0, 2000.0, 4000.0),
        "readout.arbiter.row_ns": (4000.0, 10000.0, 20000.0),
    },
    "event_loss": {"readout.loss.fraction": (0.06, 0.20, 0.45)},
    "double_read": {
        "readout.double_read.on": (0.002, 0.01, 0.05),
        "readout.double_read.off": (0.004, 0.02, 0.1),
    },
    "timestamp_tick": {"readout.tick_us": (50.0, 500.0, 2000.0)},
    "frame_encoding": {"frames.encoding": ("gamma:1.08", "gamma:1.25", "gamma:1.6")},
    "black_level": {"frames.black_level_dn": (0.5, 1.5, 2.8)},
    "exposure_blur": {"frames.exposure_us": (5000.0, 15000.0, 30000.0)},
    "clock_offset": {"frames.clock_offset_us": (300.0, 1500.0, 6000.0)},
    "clock_drift": {"frames.clock_drift_ppm": (500.0, 3000.0, 8000.0)},
    "misregistration": {"frames.shift_px": ([0.12, 0.06], [0.35, 0.20], [0.9, -0.6])},
}

_OUTSIDE: dict[str, dict[str, tuple[Any, Any, Any]]] = {
    "surround": {
        "outside.surround.share": (0.10, 0.30, 0.60),
        "outside.surround.sigma_px": (1.5, 1.5, 2.0),
    },
    "adaptation": {
        "outside.adaptation.share": (0.3, 0.6, 0.9),
        "outside.adaptation.corner_hz": (1.0, 2.0, 4.0),
    },
    "image_lag": {
        "outside.image_lag.share": (0.10, 0.25, 0.50),
        "outside.image_lag.tau_us": (10000.0, 20000.0, 30000.0),
    },
    "column_gain": {"outside.column_gain.rms": (0.05, 0.12, 0.25)},
    "corner_ramp": {"outside.corner_ramp.per_s": (-0.5, -1.5, -3.0)},
    "threshold_vignette": {"outside.threshold_vignette.rise": (0.15, 0.40, 1.0)},
    "threshold_wobble": {
        "outside.threshold_wobble.depth": (0.06, 0.20, 0.45),
        "outside.threshold_wobble.frequency_hz": (37.0, 37.0, 37.0),
    },
    "off_dead_time": {"outside.off_dead_time.factor": (4.0, 10.0, 25.0)},
    "echo": {
        "outside.echo.share": (0.03, 0.10, 0.30),
        "outside.echo.delay_us": (7000.0, 7000.0, 7000.0),
    },
    "sign_flips": {"outside.sign_flips.share": (0.02, 0.06, 0.15)},
}

_OWN_PERIOD: dict[str, dict[str, tuple[Any, Any, Any]]] = {
    "frame_coupling": {
        "readout.frame_coupling.amplitude": (0.02, 0.05, -0.12),
        "readout.frame_coupling.tau_us": (300.0, 300.0, 300.0),
        "readout.frame_coupling.period_us": (40_000.0, 33_333.3, 50_000.0),
        "readout.frame_coupling.delay_us": (13_310.0, 7100.0, 31_900.0),
    },
}

LIBRARY, OUTSIDE = tuple(_LIBRARY), tuple(_OUTSIDE)
"""Names of the effects that the package's library has, and of those that it does not have."""

NOTHING = Case("nothing", "none", {})
"""A camera that is just as declared."""


OWN_PERIOD = tuple(_OWN_PERIOD)
"""Names of the effects that may keep time with frames which are not those of the recording."""


def with_own_period(name: str, size: str) -> Case:
    """Return the case of an effect with a period of its own."""
    values = _OWN_PERIOD[name]
    return Case(name, size, _keys({path: of[SIZES.index(size)] for path, of in values.items()}))


def cases(*names: str, size: str | None = None) -> Iterator[Case]:
    """Yield the cases of the effects named (all if none is), in one size or in all three."""
    for table, in_library in ((_LIBRARY, True), (_OUTSIDE, False)):
        for name, values in table.items():
            if names and name not in names:
                continue
            for number, this in enumerate(SIZES):
                if size in (None, this):
                    hidden = _keys({path: sizes[number] for path, sizes in values.items()})
                    yield Case(name, this, hidden, in_library)


__all__ = [
    "BENCH",
    "LIBRARY",
    "NOTHING",
    "OUTSIDE",
    "OWN_PERIOD",
    "SIZES",
    "Case",
    "cases",
    "with_own_period",
]

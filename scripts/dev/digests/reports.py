"""Reports of ``adv2e diagnose`` on two small recordings that ``adv2e convert`` made.

Few effects compete, for all take minutes.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from dev.digests.running import Holds, done, short
from dev.digests.simulations import LINEAR, scene

ROWS, COLUMNS, COUNT, RATE_HZ = 12, 16, 60, 300

HIDDEN: Mapping[str, tuple[str, ...]] = {
    "nothing": (),
    "dead time": ("--set", "pixel.refractory.period_us=20000"),
}
"""What a recording holds and nobody declares."""

WITHOUT = """
thresholds initial_reference threshold_mismatch threshold_drift low_pass dark_current
source_follower slew_limit photoreceptor_noise reset_overshoot leak photo_leak shot_noise
hot_pixels dead_pixels frame_coupling readout timestamp_tick black_level exposure_blur
clock_offset clock_drift misregistration flicker frame_encoding
"""
"""All effects but refractory and event_loss."""

DECLARED = ("--set", LINEAR, "--set", "sampling.L=1")


def reported(hidden: tuple[str, ...], threads: int, folder: Path) -> Holds:
    """Return the report of a recording, in its short form, without the time that it took."""
    light = scene(ROWS, COLUMNS, COUNT)
    np.save(folder / "clip.npy", np.round(65535 * light).astype(np.uint16))
    made = ("-o", "recording.zip", "--fps", str(RATE_HZ), "--seed", "5", "-q")
    done(folder, "convert", "clip.npy", *made, *DECLARED, *hidden)
    without = [word for name in WITHOUT.split() for word in ("--without", name)]
    words = ("-o", "report", "--threads", str(threads), "-q")
    done(folder, "diagnose", "recording.zip", *words, *DECLARED, *without)
    found = json.loads((folder / "report" / "report.json").read_text())
    del found["facts"]["time taken"]
    return short(found)


def cases() -> dict[str, Callable[[int, Path], Holds]]:
    """Return what reports of each recording, by name."""
    return {
        f"report {name}": lambda threads, folder, hidden=hidden: reported(hidden, threads, folder)
        for name, hidden in HIDDEN.items()
    }

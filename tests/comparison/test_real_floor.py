"""Floors of DAVIS recordings, on the second half of each; known values pin the definitions."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from adv2e.comparison.compare import half_split
from adv2e.comparison.windows import Windows, frame_windows, span_of
from adv2e.formats.reading import read_events

FOLDER = os.environ.get("ADV2E_REAL_DATA")


@pytest.mark.skipif(not FOLDER, reason="ADV2E_REAL_DATA does not name a folder of recordings")
@pytest.mark.parametrize(
    ("name", "intervals", "known"),
    [
        ("davis346-emlb-cradle", 6, (0.71, 0.30, 0.27)),
        ("davis240c-slider-depth-chunk", 2, (0.90, 0.49, 0.36)),
    ],
)
def test_the_floor_of_a_recording_is_the_known_one(name, intervals, known):
    recording = read_events(Path(FOLDER) / name)
    every = frame_windows(recording.frame_times_ns, [span_of(recording.events)])
    windows = Windows(every.kind, every.used[-intervals:], every.total)
    found = half_split(recording.events, windows, recording.width, recording.height)
    measures = ("relative_5_bins", "relative_5_bins_smoothed", "relative_1_bin_smoothed")
    assert [found[measure] for measure in measures] == pytest.approx(known, abs=0.012)

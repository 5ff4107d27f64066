"""Bursts of events at the readout of frames, in what is told of a real recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from real.bursts import bursts
from real.model import Bench
from real.recording import halves, read
from real.search import Search
from real.tried import of_the_camera
from written_recordings import write_recording

from adv2e import simulate
from adv2e.config import load_config
from adv2e.diagnosis.configurations import without_coupling

WIDTH, HEIGHT, FRAMES = 32, 24, 13
TIMES = 0.04 * np.arange(FRAMES)
PIXEL = [
    "pixel.thresholds.on=0.2",
    "pixel.thresholds.off=0.15",
    "pixel.log_response.linear_below=0",
    "pixel.log_response.floor=0.5",
]
COUPLING = (
    "readout.frame_coupling={amplitude: 0.07, tau_us: 20000, delay_us: -2000, width_us: 1500}"
)


def bench_of(folder, sets):
    """Return the bench of waves that an ideal pixel sees, which drift slowly."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    phases = 2 * np.pi * (x / 11 + y / 17 - 2.3 * TIMES[:, None, None])
    frames = np.rint(80 + 60 * np.sin(phases)).astype(np.uint8)
    config = load_config(["ideal"], ["frames.encoding=linear", *PIXEL, *sets])
    events = np.concatenate(list(simulate(frames, TIMES, config, threads=1)))
    return Bench(read(str(write_recording(folder, TIMES, frames, events))), 1)


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    return bench_of(tmp_path_factory.mktemp("real") / "pulsed", [COUPLING])


def test_frame_coupling_is_tried_where_there_are_bursts(bench, tmp_path):
    def names(pulse):
        return {one.name for one in of_the_camera(load_config(), 0.24, (), pulse)}

    assert bench.pulse is not None
    assert names(bench.pulse) - names(None) == {"frame_coupling"}
    quiet = bench_of(tmp_path / "quiet", [])
    assert quiet.pulse is None
    assert bursts(quiet, load_config(), quiet.real.windows, 1) == ""


def test_the_half_to_judge_by_tells_nothing_of_the_pulse(bench):
    first, _ = halves(bench.real.windows)
    real = bench.real
    beyond = Bench(replace(real, events=real.events[real.events["t"] < first.stop]), 1)
    assert beyond.pulse == bench.pulse is not None


def test_a_declared_pulse_stays_where_it_is(bench):
    first, _ = halves(bench.real.windows)
    declared = load_config(["ideal"], [*PIXEL, COUPLING.replace("-2000", "5000")])
    held = Bench(bench.real, 1, declared).matched(declared, first)
    assert held.readout.frame_coupling == declared.readout.frame_coupling
    # what is found is put where the bursts are
    moved = bench.matched(declared, first).readout.frame_coupling
    assert moved.delay_us == pytest.approx(-2000.0, abs=150.0)


def test_the_search_finds_the_pulse_that_made_the_bursts(bench, monkeypatch):
    monkeypatch.setattr("real.search.OWN", ())
    first, second = halves(bench.real.windows)
    declared = load_config(["ideal"], PIXEL)
    steps = list(Search(bench, first, lambda text: None).run(declared, ["frame_coupling"]))
    assert [step.candidate.name for step in steps[:2]] == ["thresholds", "frame_coupling"]
    found = steps[-1].config
    coupling = found.readout.frame_coupling
    assert steps[-1].score < 0.6 * steps[0].score
    # a pulse upwards, or nearly the same: one downwards for the rest of the interval
    assert abs(coupling.amplitude) == pytest.approx(0.07, rel=0.3)
    assert coupling.width_us % 37_000.0 == pytest.approx(1500.0, abs=200.0)

    text = bursts(bench, found, second, 1)
    assert "as if their readout disturbed the pixels" in text
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")]
    assert [row[0] for row in rows[2:]] == [
        "measured", "as found, without frame coupling", "as found",
    ]  # fmt: skip
    measured, without, with_it = (
        np.array([float(cell.rstrip("%")) for cell in row[1:]]) for row in rows[2:]
    )
    assert np.all(measured > 2.0 * without)
    assert with_it == pytest.approx(measured, rel=0.25)
    assert without_coupling(found).readout.frame_coupling is None

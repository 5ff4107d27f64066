"""The script that tells bursts at the readout of frames, in both halves of recordings."""

import re

import numpy as np
import pytest
from click.testing import CliRunner
from real.readout_bursts import main
from written_recordings import write_recording

from adv2e.events import EVENT_DTYPE

INTERVAL_S, FRAMES = 0.04, 30
TIMES = 2.0 + INTERVAL_S * np.arange(FRAMES)


def pulsed(bursts):
    """Return events at any time, and some 3 ms (ON) and 10.5 ms (OFF) after each frame."""
    draw = np.random.default_rng(5)
    t = [draw.uniform(TIMES[0], TIMES[-1], 8000)]
    p = [draw.integers(0, 2, 8000)]
    for polarity, delay_s in ((1, 0.003), (0, 0.0105)):
        t.append((TIMES[:-1, None] + delay_s + 1e-4 * draw.random(bursts)).ravel())
        p.append(np.full(t[-1].size, polarity))
    events = np.zeros(sum(map(len, t)), EVENT_DTYPE)
    events["t"], events["p"] = np.rint(1e6 * np.concatenate(t)), np.concatenate(p)
    events["x"], events["y"] = draw.integers(0, 32, events.size), draw.integers(0, 24, events.size)
    return np.sort(events, order=["t", "y", "x", "p"])


@pytest.fixture
def run():
    def called(*arguments):
        return CliRunner().invoke(main, list(map(str, arguments)))

    return called


def rows(text):
    return [re.split(r" \| ", line.strip("| ")) for line in text.splitlines()[2:]]


def test_both_halves_of_a_recording_tell_the_same(run, tmp_path):
    frames = np.full((FRAMES, 24, 32), 90, np.uint8)
    folder = write_recording(tmp_path / "pulsed", TIMES, frames, pulsed(40))
    result = run(folder)
    assert result.exit_code == 0, result.output
    found = rows(result.output)
    assert [row[0] for row in found] == ["pulsed, first half", "pulsed, second half"]
    for row in found:
        assert float(row[2]) == 40.0
        assert float(row[3].strip("%")) == pytest.approx(100 * 40 * 29 / (4000 + 40 * 29), abs=3)
        assert float(row[5]) == pytest.approx(7.5, abs=0.15)


def test_events_alone_with_the_interval_of_their_frames(run, tmp_path):
    events = pulsed(40)
    path = tmp_path / "alone.txt"
    np.savetxt(path, [(e["t"] / 1e6, e["x"], e["y"], e["p"]) for e in events], "%.6f %d %d %d")
    result = run(path, "--interval-ms", 40.3)  # near it: the events tell it better
    assert result.exit_code == 0, result.output
    for row in rows(result.output):
        assert float(row[2]) == pytest.approx(40.0, abs=0.02)
        assert float(row[5]) == pytest.approx(7.5, abs=0.25)
    result = run(path)
    assert result.exit_code == 1
    assert "alone.txt: has no frames; --interval-ms must say" in result.output


def test_no_bursts(run, tmp_path):
    frames = np.full((FRAMES, 24, 32), 90, np.uint8)
    result = run(write_recording(tmp_path / "quiet", TIMES, frames, pulsed(0)))
    assert [row[2] for row in rows(result.output)] == ["none", "none"]

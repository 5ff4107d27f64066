"""The script that tells bursts of a blinking LED, of events without pixels."""

import numpy as np
import pytest
from click.testing import CliRunner
from real.beacon import main

SWITCHES, APART_US = 60, 4000


@pytest.fixture
def led(tmp_path):
    """Return a file of an LED: 100 ON events within 200 us, then 40 OFF ones within 1 ms."""
    path, begins = tmp_path / "led.npz", APART_US * np.arange(SWITCHES)[:, None]
    on = begins + np.linspace(0, 200, 101).astype(int)
    off = begins + APART_US // 2 + np.linspace(0, 1000, 41).astype(int)
    stray = 10_000 * np.arange(1, 20) + 3500
    t = np.concatenate([on.ravel(), stray, off.ravel()])
    p = np.concatenate([np.ones(on.size + stray.size), np.zeros(off.size)])
    np.savez(path, t_us=t.astype(np.uint32), p=p.astype(np.uint8))
    return path


def test_bursts_their_delays_and_the_most_at_a_time_are_told(led):
    result = CliRunner().invoke(main, [str(led)])
    assert result.exit_code == 0, result.output
    lines = [line.strip("| ").split(" | ") for line in result.output.splitlines()[2:]]
    assert lines == [
        ["led", "ON", str(SWITCHES), "101", "20, 100, 180", "50"],
        ["led", "OFF", str(SWITCHES), "41", "100, 500, 900", "50"],
    ]


def test_another_file_is_refused_in_a_line(tmp_path):
    np.savez(tmp_path / "a.npz", x=1)
    result = CliRunner().invoke(main, [str(tmp_path / "a.npz")])
    assert result.exit_code == 1
    assert "a.npz: must be an .npz with t_us and p" in result.output

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from real import compare
from real.model import Bench
from real.recording import read, still_pixels, still_rate
from written_recordings import write_recording

from adv2e import simulate
from adv2e.comparison.distances import distances
from adv2e.config import load_config
from adv2e.events import make_events

WIDTH, HEIGHT, FRAMES = 16, 12, 7
TIMES = np.arange(FRAMES) * 0.02
ON, OFF = 0.3, 0.15


def moving_waves():
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    phases = 2 * np.pi * (x / 11 + y / 17 - 12 * TIMES[:, None, None])
    return np.rint(130 + 100 * np.sin(phases)).astype(np.uint8)


def ideal_events(frames, on=ON, off=OFF):
    sets = [f"pixel.thresholds.on={on}", f"pixel.thresholds.off={off}"]
    return np.concatenate(list(simulate(frames, TIMES, load_config(["ideal"], sets), threads=1)))


@pytest.fixture
def recording(tmp_path):
    frames = moving_waves()
    return write_recording(tmp_path / "waves", TIMES, frames, ideal_events(frames))


def tables(text):
    """Return heading -> rows of cells, for every table."""
    found = {}
    for line in text.splitlines():
        if line.startswith("## "):
            heading = line[3:]
        elif line.startswith("| "):
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            found.setdefault(heading, []).append(cells)
    return found


def run(command, *arguments):
    result = CliRunner().invoke(command.main, [*map(str, arguments), "--threads", "1"])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def test_a_table_has_a_row_for_each_configuration_and_the_two_marks(recording):
    result = run(compare, recording, "--configs", "adv2e,ideal")
    assert result.exit_code == 0
    assert result.stdout.startswith("Configurations named after a tool are that tool's parameters")
    (heading, (names, rule, *rows)) = next(iter(tables(result.stdout).items()))
    assert heading == "waves: thresholds as shipped"
    assert names[:4] == ["simulator", "events", "ON share", "shared window"]
    assert rule == ["---", *["---:"] * (len(names) - 1)]
    labels = [row[0] for row in rows]
    assert labels == ["adv2e", "ideal †", "half split (Poisson)", "no events at all"]
    assert {len(row) for row in rows} == {len(names)}
    # without noise and mismatch two seeds differ only because the floor starts at random
    for row in rows[:2]:
        floors = [float(cell.partition("(")[2].rstrip(")")) for cell in row[3:10]]
        assert min(floors) > 0
    assert rows[-1][6:10] == ["1.00"] * 4


def test_every_distance_in_the_table_is_defined_below_it(recording):
    text = run(compare, recording, "--configs", "ideal").stdout
    names = next(iter(tables(text).values()))[0]
    for name in names[3:-1]:
        assert f"\n- {name}: " in text


def test_identical_events_are_at_distance_zero(recording):
    real = read(str(recording))
    sets = [f"pixel.thresholds.on={ON}", f"pixel.thresholds.off={OFF}"]
    case = compare.Case("same", load_config(["ideal"], sets))
    label, row = compare.judged(Bench(real, 1), case, real.windows, 2)
    assert label == "same †"
    assert set(row.values.values()) == {0.0}
    assert min(row.floor.values()) > 0
    inside = (real.events["t"] >= 20_000) & (real.events["t"] < real.windows.stop)
    assert row.made.events == inside.sum() > 100


def test_the_floor_is_the_distance_between_seeds_relative_to_the_measured_events(recording):
    real = read(str(recording))
    config = load_config(["adv2e"], seed=3)
    _, row = compare.judged(Bench(real, 1), compare.Case("a", config), real.windows, 2)
    frames = moving_waves()
    a, b = (
        np.concatenate(list(simulate(frames, TIMES, replace(config, seed=s), threads=1)))
        for s in (3, 4)
    )
    assert row.floor == distances(a, b, real.windows, WIDTH, HEIGHT, whole=real.events).values


def test_matching_totals_finds_the_thresholds_the_events_were_made_with(recording):
    result = run(compare, recording, "--configs", "ideal", "--match-totals")
    (_, rows), (heading, (_, _, row, *_)) = tables(result.stdout).items()
    assert len(rows) == 5
    assert heading == "waves: totals matched before"
    label, on, off = row[0].split(" ")[0], *(float(row[0].split(" ")[n]) for n in (2, 4))
    assert label == "ideal,"
    assert on == pytest.approx(ON, rel=0.03)
    assert off == pytest.approx(OFF, rel=0.03)
    assert "(!)" not in row[0]
    # the measured events begin in the first of six intervals and end in the last
    assert "4 of 6 frame intervals, 0.02 to 0.1 s" in result.stdout
    assert "2 of 6 frame intervals, 0.06 to 0.1 s" in result.stdout
    assert "match from 0.02 to 0.06 s" in result.stdout


def test_events_that_no_threshold_gives_are_marked_in_the_table(tmp_path):
    quiet = np.full((FRAMES, HEIGHT, WIDTH), 90, np.uint8)
    folder = write_recording(tmp_path / "quiet", TIMES, quiet, ideal_events(moving_waves()))
    result = run(compare, folder, "--configs", "ideal", "--match-totals")
    first, second = (rows[2] for rows in tables(result.stdout).values())
    assert first[1].startswith("0 / ")
    assert first[2].startswith("- / 0.")
    assert second[0].endswith("(!) †")


def test_still_pixels_keep_away_from_those_that_change():
    frames = np.full((5, HEIGHT, WIDTH), 100.0, np.float32)
    frames[1::2, 3, 2] = 110
    frames[:, 9, 14] += np.arange(5)  # a standard deviation of 1.4
    still = still_pixels(iter(frames))
    expected = np.ones((HEIGHT, WIDTH), bool)
    expected[:8, :7] = False
    assert np.array_equal(still, expected)
    events = make_events([1, 2, 3], [2, 14, 15], [3, 9, 11], [1, 0, 1])
    assert still_rate(events, still, 0.5) == 2 / (136 * 0.5)


def test_an_interpolation_goes_for_all_configurations(recording):
    result = run(compare, recording, "--configs", "ideal", "--interpolation", "linear")
    assert "| ideal, linear † |" in result.stdout


def test_tables_go_to_a_file_too_and_progress_to_stderr(recording, tmp_path):
    out = tmp_path / "table.md"
    result = run(compare, recording, "--configs", "ideal", "--output", out)
    assert out.read_text() == result.stdout
    assert "waves: ideal" in result.stderr
    assert len(tables(result.stdout)) == 1


def test_a_folder_without_events_fails_with_one_line_and_leaves_no_file(tmp_path):
    folder = write_recording(tmp_path / "empty", TIMES, moving_waves(), [])
    out = tmp_path / "table.md"
    result = run(compare, folder, "--output", out)
    assert result.exit_code == 1
    assert result.stderr.splitlines() == [f"Error: {folder}: holds no events to compare with"]
    assert not out.exists()

"""The direct comparison of simulators with a recording, and its page."""

from __future__ import annotations

import base64
import json
import re

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from experiments import direct
from experiments.recordings import read
from experiments.simulators import ByFile, Pixel
from written_recordings import write_recording

from adv2e import load_config, simulate, write_events
from adv2e.comparison.distances import distances
from adv2e.events import make_events

WIDTH, HEIGHT, FRAMES = 16, 12, 7
TIMES = np.arange(FRAMES) * 0.02
ON, OFF = 0.3, 0.15
LIGHT = "frames.encoding=linear"
TRUTH = load_config(["ideal"], [LIGHT, f"pixel.thresholds.on={ON}", f"pixel.thresholds.off={OFF}"])


def moving_waves():
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    phases = 2 * np.pi * (x / 11 + y / 17 - 12 * TIMES[:, None, None])
    return np.rint(130 + 100 * np.sin(phases)).astype(np.uint8)


def events_of(config):
    return np.concatenate(list(simulate(moving_waves(), TIMES, config, threads=1)))


@pytest.fixture
def recording(tmp_path):
    return write_recording(tmp_path / "waves", TIMES, moving_waves(), events_of(TRUTH))


@pytest.fixture
def measured(recording):
    return read(str(recording))


def tables(text):
    """Return heading -> rows of cells, for every table."""
    found = {}
    heading = ""
    for line in text.splitlines():
        if line.startswith("## "):
            heading = line[3:]
        elif line.startswith("| "):
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            found.setdefault(heading, []).append(cells)
    return found


def run(*arguments):
    result = CliRunner().invoke(direct.main, [*map(str, arguments), "--threads", "1"])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def trial(measured, *simulators):
    return direct.Trial(
        measured, {one.name: one for one in simulators}, measured.windows, "as shipped"
    )


def test_a_table_has_a_row_for_each_simulator_and_the_two_marks(recording):
    result = run(recording, "--simulators", "adv2e,ideal,v2e,dvs-voltmeter")
    assert result.exit_code == 0, result.stderr
    found = tables(result.stdout)
    natures = dict(found.pop(""))
    assert natures["v2e"] == "its parameters in the pixel of adv2e, not the tool"
    (heading, (names, rule, *rows)) = next(iter(found.items()))
    assert heading == "waves: thresholds as shipped"
    assert names[:4] == ["simulator", "events", "ON share", "shared window"]
    assert rule == ["---", *["---:"] * (len(names) - 1)]
    labels = [row[0] for row in rows]
    simulators = ["adv2e", "ideal †", "v2e", "dvs-voltmeter"]
    assert labels == [*simulators, "half split (Poisson)", "no events at all"]
    assert {len(row) for row in rows} == {len(names)}
    # without noise and mismatch two seeds differ only because the floor starts at random
    for row in rows[:4]:
        floors = [float(cell.partition("(")[2].rstrip(")")) for cell in row[3:10]]
        assert min(floors) > 0
    assert rows[-1][6:10] == ["1.00"] * 4


def test_every_distance_in_the_table_is_defined_below_it(recording):
    text = run(recording, "--simulators", "ideal").stdout
    for name in tables(text)["waves: thresholds as shipped"][0][3:-1]:
        assert f"\n- {name}: " in text


def test_identical_events_are_at_distance_zero(measured):
    simulator = Pixel("same", "", TRUTH, 1)
    row = trial(measured, simulator).judge(simulator, 2)
    assert row.repeats
    assert set(row.judged.values.values()) == {0.0}
    assert min(row.judged.floor.values()) > 0
    events, windows = measured.events, measured.windows
    inside = (events["t"] >= 20_000) & (events["t"] < windows.stop)
    assert row.judged.made.events == inside.sum() > 100


def test_the_floor_is_the_distance_between_seeds_relative_to_the_measured_events(measured):
    simulator = Pixel("adv2e", "", load_config(["adv2e"]), 1)
    row = trial(measured, simulator).judge(simulator, 2)
    a, b = (events_of(load_config("adv2e", LIGHT, seed)) for seed in (0, 1))
    windows, events = measured.windows, measured.events
    assert row.judged.floor == distances(a, b, windows, WIDTH, HEIGHT, whole=events).values


def test_matching_totals_finds_the_thresholds_the_events_were_made_with(recording):
    result = run(recording, "--simulators", "ideal", "--match-totals")
    found = tables(result.stdout)
    assert len(found["waves: thresholds as shipped"]) == 5
    label = found["waves: totals matched before"][2][0].split(" ")
    assert label[0] == "ideal,"
    assert float(label[2]) == pytest.approx(ON, rel=0.03)
    assert float(label[4]) == pytest.approx(OFF, rel=0.03)
    assert "(!)" not in label
    # the measured events begin in the first of six intervals and end in the last
    assert "4 of 6 frame intervals, 0.02 to 0.1 s" in result.stdout
    assert "2 of 6 frame intervals, 0.06 to 0.1 s" in result.stdout
    assert "match from 0.02 to 0.06 s" in result.stdout


def test_events_that_no_threshold_gives_are_marked_in_the_table(tmp_path):
    quiet = np.full((FRAMES, HEIGHT, WIDTH), 90, np.uint8)
    folder = write_recording(tmp_path / "quiet", TIMES, quiet, events_of(TRUTH))
    result = run(folder, "--simulators", "ideal", "--match-totals")
    found = tables(result.stdout)
    first, second = (found[f"quiet: {title}"][2] for title in _TITLES)
    assert first[1].startswith("0 / ")
    assert first[2].startswith("- / 0.")
    assert second[0].endswith("(!) †")


_TITLES = ("thresholds as shipped", "totals matched before")


def test_other_simulators_come_by_file_and_have_no_floor(recording, tmp_path):
    made = tmp_path / "theirs.h5"
    write_events(made, events_of(TRUTH), (WIDTH, HEIGHT))
    result = run(
        recording, "--simulators", "", "--events", f"theirs={made}", "-o", tmp_path / "out.md"
    )
    assert result.exit_code == 0, result.stderr
    row = tables(result.stdout)["waves: thresholds as shipped"][2]
    assert row[0] == "theirs †"
    assert row[3:10] == ["0.00 (-)"] * 7
    numbers = json.loads((tmp_path / "out.json").read_text())
    assert numbers["simulators"] == {"theirs": "events that it wrote, theirs.h5"}
    assert numbers["waves: thresholds as shipped"]["theirs †"]["distances"]["error"] == 0.0


@pytest.mark.thorough
def test_what_was_not_recorded_is_not_compared(tmp_path):
    events = events_of(TRUTH)
    events = events[(events["t"] < 45_000) | (events["t"] >= 70_000)]
    events = np.concatenate([events] * 40)  # so that a gap cannot be by chance
    events = events[np.argsort(events["t"], kind="stable")]
    measured = read(str(write_recording(tmp_path / "gap", TIMES, moving_waves(), events)))
    ((start, stop),) = measured.silences
    assert 44_000 < start < 45_000
    assert 70_000 <= stop < 71_000
    (made,) = measured.made(Pixel("same", "", TRUTH, 1), measured.windows, [0])
    assert len(made) == len(np.unique(measured.seen(measured.events, measured.windows)))


def test_frames_by_a_curve_are_brought_to_light(tmp_path, measured):
    assert measured.clip.frames.dtype == np.uint8
    assert (measured.clip.frames == moving_waves()).all()


def test_a_page_shows_frames_and_events_and_loads_nothing(recording, tmp_path):
    run(recording, "--simulators", "ideal,vid2e", "--page", tmp_path / "pages")
    text = (tmp_path / "pages" / "waves-thresholds-as-shipped.html").read_text()
    assert "http" not in re.sub(r"http-equiv", "", text)
    rows = re.findall("<tr>(.*?)</tr>", text)
    assert len(rows) == 1 + 4
    assert [re.sub("<.*", "", one) for one in re.findall("<th>(.*?)</th>", rows[0])] == [
        "frame", "measured", "ideal †", "vid2e †",
    ]  # fmt: skip
    pictures = [decoded(one) for one in re.findall('src="data:image/png;base64,([^"]*)"', rows[1])]
    assert len(pictures) == 4
    np.testing.assert_array_equal(pictures[0][..., 0], moving_waves()[1])
    truth = events_of(TRUTH)
    inside = truth[(truth["t"] >= 20_000) & (truth["t"] < 40_000)]
    fired = np.zeros((HEIGHT, WIDTH), np.bool_)
    fired[inside["y"], inside["x"]] = True
    np.testing.assert_array_equal((pictures[1] != 255).any(axis=2), fired)
    assert f"{len(inside):,} events" in rows[1]


def decoded(text):
    return cv2.imdecode(np.frombuffer(base64.b64decode(text), np.uint8), cv2.IMREAD_COLOR)


def test_progress_goes_to_stderr_and_tables_to_a_file_too(recording, tmp_path):
    out = tmp_path / "table.md"
    result = run(recording, "--simulators", "ideal", "--output", out)
    assert out.read_text() == result.stdout
    assert "waves: ideal" in result.stderr


def test_a_folder_without_events_fails_with_one_line_and_leaves_no_file(tmp_path):
    folder = write_recording(tmp_path / "empty", TIMES, moving_waves(), [])
    out = tmp_path / "table.md"
    result = run(folder, "--output", out)
    assert result.exit_code == 1
    assert result.stderr.splitlines() == [f"Error: {folder}: holds no events to compare with"]
    assert not out.exists()


def test_events_of_a_simulator_by_file_are_cut_to_the_windows(measured, tmp_path):
    made = tmp_path / "made.h5"
    write_events(made, make_events([1, 50_000, 119_000], [1, 2, 3], [1, 2, 3], [1, 0, 1]), (16, 12))
    (events,) = measured.made(ByFile("one", made), measured.windows, [0])
    assert events["t"].tolist() == [50_000]


def test_each_frame_interval_is_judged_by_thresholds_of_the_others(recording):
    result = run(recording, "--simulators", "ideal", "--leave-one-out")
    assert result.exit_code == 0, result.stderr
    found = tables(result.stdout)
    titles = [title for title in found if "outside" in title]
    assert titles == [
        f"waves: totals matched outside 0.0{k} to 0.{end} s"
        for k, end in ((2, "04"), (4, "06"), (6, "08"), (8, "1"))
    ]
    events = read(str(recording)).events
    for k, title in enumerate(titles, start=1):
        label, cell = found[title][2][:2]
        words = label.split(" ")
        assert float(words[2]) == pytest.approx(ON, rel=0.05)
        assert float(words[4]) == pytest.approx(OFF, rel=0.05)
        inside = (events["t"] >= 20_000 * k) & (events["t"] < 20_000 * (k + 1))
        assert f"/ {inside.sum():,} (" in cell


def test_the_interval_that_is_judged_has_no_part_in_its_thresholds(tmp_path):
    events = events_of(TRUTH)
    # twice as many events in one interval, which the thresholds of the others must not see
    more = events[(events["t"] >= 40_000) & (events["t"] < 60_000)].copy()
    more["t"] += 1
    both = np.sort(np.concatenate((events, more)), order="t", kind="stable")
    folder = write_recording(tmp_path / "waves", TIMES, moving_waves(), both)
    found = tables(run(folder, "--simulators", "ideal", "--leave-one-out").stdout)
    on = {title: float(rows[2][0].split(" ")[2]) for title, rows in found.items() if "out" in title}
    alone = on.pop("waves: totals matched outside 0.04 to 0.06 s")
    assert alone == pytest.approx(ON, rel=0.05)
    assert max(on.values()) < 0.9 * ON


def test_one_interval_cannot_be_left_out_of_one(tmp_path):
    events = events_of(TRUTH)
    part = events[(events["t"] > 19_000) & (events["t"] < 41_000)]
    folder = write_recording(tmp_path / "short", TIMES, moving_waves(), part)
    result = run(folder, "--simulators", "ideal", "--leave-one-out")
    assert result.exit_code == 1
    assert "two frame intervals or more that events cover are needed" in result.stderr


def test_interpolations_give_each_configuration_a_row_as_a_conversion_has_it(tmp_path):
    y, x = np.mgrid[:48, :64]
    bumps = np.sin(x / 3.1 + y / 7.7) + np.cos(y / 2.7 - x / 9.3)
    frames = np.stack([np.roll(120 + 50 * bumps, 2 * k, 1) for k in range(FRAMES)])
    frames = np.rint(frames).astype(np.uint8)
    made = {
        way: np.concatenate(list(simulate(frames, TIMES, config, threads=1)))
        for way in ("linear", "flow")
        for config in [load_config(["ideal"], [LIGHT, f"sampling.interpolation={way}"])]
    }
    folder = write_recording(tmp_path / "bumps", TIMES, frames, made["flow"])
    words = ("--simulators", "ideal,dvs-voltmeter")
    result = run(folder, *words, "--interpolation", "linear", "--interpolation", "flow")
    assert result.exit_code == 0, result.stderr
    rows = tables(result.stdout)["bumps: thresholds as shipped"][2:]
    assert [row[0] for row in rows[:3]] == ["ideal linear †", "ideal flow †", "dvs-voltmeter"]
    measured = read(str(folder))
    start, stop = measured.windows.start, measured.windows.stop
    for row, way in zip(rows, ("linear", "flow"), strict=False):
        inside = (made[way]["t"] >= start) & (made[way]["t"] < stop)
        assert row[1].startswith(f"{inside.sum():,} / ")
    # twice, the second time from what is remembered: the same events to the last bit
    assert rows[1][3].startswith("0.00 (")
    assert not rows[0][3].startswith("0.00 (")

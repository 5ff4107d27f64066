"""The parts of scripts/benchmarks/speed.py: processes, ratios, time errors, tables."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from benchmarks import (
    accuracy,
    clips,
    conversion,
    end_to_end,
    figures,
    processes,
    settings,
    speed,
    worker,
)
from benchmarks import report as reports
from click.testing import CliRunner
from reference.dense_ode import Truth

SCRIPTS = Path(__file__).resolve().parents[3] / "scripts"


def ideal_job(clip, *sets, **fields):
    options = {"sets": [*settings.IDEAL, *sets], "threads": 1}
    return processes.Job(**{"name": "a job", "clip": clip, "options": options, **fields})


def measured(walls, cpus=None, **report):
    """Return a measurement with these times, one a round."""
    rounds = [
        processes.Round({"wall_s": wall, "cpu_s": cpu, "peak_mib": 80.0, **report}, wall, 0.0)
        for wall, cpu in zip(walls, cpus or walls, strict=True)
    ]
    return processes.Measured(processes.Job(name="clip: setting"), rounds)


# Clips --------------------------------------------------------------------------------------------


def test_a_recipe_gives_the_same_frames_every_time():
    recipe = clips.Clip(width=40, height=30, frames=4)
    first, again = (np.stack(list(recipe.render())) for _ in range(2))
    assert np.array_equal(first, again)
    assert len(np.unique(first)) > 30
    other = np.stack(list(replace(recipe, seed=1).render()))
    assert not np.array_equal(first, other)


def test_every_recipe_has_a_file_of_its_own():
    base = clips.Clip(width=40, height=30, frames=4)
    changed = [
        replace(base, **change)
        for change in (
            {"width": 41},
            {"height": 31},
            {"frames": 5},
            {"fps": 30.0},
            {"seed": 1},
            {"speed": 2.0},
            {"contrast": 0.1},
            {"moving": 0.1},
        )
    ]
    assert len({clip.name for clip in [base, *changed]}) == 9


def test_only_a_band_of_the_rows_moves():
    recipe = clips.Clip(width=60, height=50, frames=6, moving=0.2, speed=10.0)
    frames = np.stack(list(recipe.render())).astype(int)
    changed = np.abs(np.diff(frames, axis=0)).max(axis=(0, 2)) > 0
    assert np.array_equal(np.flatnonzero(changed), np.arange(20, 30))


def test_faster_clips_change_more_and_still_ones_not_at_all():
    def change(speed):
        recipe = clips.Clip(width=60, height=50, frames=3, speed=speed)
        frames = np.stack(list(recipe.render())).astype(int)
        return np.abs(np.diff(frames, axis=0)).mean()

    assert change(0.0) == 0.0
    assert change(1.0) < change(4.0)


def test_a_stored_clip_is_not_made_again(tmp_path):
    recipe = clips.Clip(width=20, height=10, frames=3)
    path = clips.stored(recipe, tmp_path)
    np.save(path, np.zeros((3, 10, 20), np.uint8))
    assert clips.stored(recipe, tmp_path) == path
    assert not np.load(path).any()
    assert [p.suffix for p in tmp_path.iterdir() if p.suffix not in (".npy", ".json")] == []


# Processes ----------------------------------------------------------------------------------------


def test_a_process_reports_what_it_ran(small, tmp_path):
    probe = {"pixels": [0, 5, 700], "path": str(tmp_path / "probe.npz")}
    job = ideal_job(small, probe=probe, digest=True, frames=9)
    report = processes.run_job(job).report
    assert report["frames"] == 9
    assert report["pixels"] == 32 * 24
    assert report["events"] > 0
    assert report["wall_s"] > 0
    assert Path(report["versions"]["from"]) == SCRIPTS.parent / "adv2e"
    with np.load(probe["path"]) as stored:
        assert set(stored["pixel"]) <= {0, 1, 2}
    again = worker.simulate(vars(job))
    assert again["digest"] == report["digest"]
    other = ideal_job(small, "pixel.thresholds.on=0.21", digest=True, frames=9)
    assert worker.simulate(vars(other))["digest"] != report["digest"]


def test_a_process_that_fails_is_told_in_one_line(small):
    job = ideal_job(small, "pixel.leek=null")
    with pytest.raises(processes.JobError, match=r"^a job: .*pixel.leek: unknown key.*$"):
        processes.run_job(job)


def test_rounds_are_interleaved_and_go_on_past_a_failure(monkeypatch):
    ran, told = [], []

    def run(job):
        ran.append(job.name)
        if job.name == "bad":
            raise processes.JobError("bad: broken")
        return processes.Round({"wall_s": 1.0, "cpu_s": 1.0}, 1.0, None)

    monkeypatch.setattr(processes, "run_job", run)
    jobs = [processes.Job(name=name) for name in ("a", "bad", "b")]
    log = processes.Log(told.append)
    found = processes.run_rounds(jobs, 2, log, warm=jobs[:1])
    assert ran[:4] == ["a", "a", "bad", "b"]
    assert sorted(ran[4:]) == ["a", "b"]
    assert [one.job.name for one in found] == ["a", "b"]
    assert all(len(one.rounds) == 2 for one in found)
    assert log.failures == ["bad: broken"]


def test_ratios_are_paired_by_round():
    slow = measured([2.0, 20.0, 6.0])
    fast = measured([1.0, 10.0, 2.0])
    ratio = slow.ratio(fast)
    assert (ratio.median, ratio.least, ratio.most) == (2.0, 2.0, 3.0)


def test_a_rate_is_the_inverse_of_a_time():
    rate = processes.Spread.of([1.0, 2.0, 4.0]).inverse(8.0)
    assert (rate.median, rate.least, rate.most) == (4.0, 2.0, 8.0)
    assert str(rate) == "4.00 (2.00..8.00)"
    assert str(processes.Spread.of([0.5])) == "0.50"


# Time errors --------------------------------------------------------------------------------------


def true(*events, ties=()):
    return Truth(np.array(events, np.float64).reshape(-1, 2), list(ties))


def compare(made, truth):
    """Compare events given as (time [us], polarity), of one pixel."""
    t, p = np.array(made, np.float64).reshape(-1, 2).T
    return accuracy.compare([(t, p > 0)], [truth])


def test_events_of_a_polarity_are_compared_in_order():
    truth = true((1e-3, 1), (2e-3, -1), (3e-3, 1))
    error = compare([(1010, 1), (2000, -1), (2940, 1)], truth)
    assert error.median == pytest.approx(10)
    assert error.mean == pytest.approx(70 / 3)
    assert error.worst == pytest.approx(60)
    assert (error.ratio, error.sequences, error.left_out) == (1.0, 1.0, 0.0)


def test_a_superfluous_event_puts_the_rest_off():
    truth = true((1e-3, 1), (3e-3, 1))
    error = compare([(1000, 1), (2000, 1), (3000, 1)], truth)
    assert error.worst == pytest.approx(1000)
    assert error.ratio == 1.5
    assert error.sequences == 0.0


def test_what_comes_after_a_tie_is_left_out():
    truth = true((1e-3, 1), (3e-3, 1), (4e-3, 1), ties=[2e-3])
    error = compare([(1001, 1), (9000, 1)], truth)
    assert error.worst == pytest.approx(1)
    assert error.ratio == 1.0
    assert error.left_out == pytest.approx(2 / 3)


def test_no_events_have_no_error():
    error = compare([], true())
    assert math.isnan(error.median)
    assert math.isnan(error.ratio)
    assert error.sequences == 1.0


def test_exact_form_is_within_the_tick_and_a_coarse_one_is_not(small, tmp_path):
    pixels = accuracy.chosen_pixels(32 * 24, 40)
    truth = accuracy.Truth(small, 25, 240.0, pixels)
    errors = []
    for number, sets in enumerate([(), ("pixel.low_pass.update=euler", "sampling.K=1")]):
        probe = {"pixels": pixels, "path": str(tmp_path / f"{number}.npz")}
        worker.simulate(vars(ideal_job(small, *sets, probe=probe)))
        errors.append(accuracy.time_error(Path(probe["path"]), truth.of("adv2e")))
    exact, coarse = errors
    assert exact.worst <= 1.0
    assert exact.ratio == exact.sequences == 1.0
    assert coarse.median > 100


def test_truth_is_of_the_circuit_that_the_tool_states():
    assert accuracy._circuit("evlib").cutoff_hz is None
    assert accuracy._circuit("eventcv").dark_cutoff_hz == pytest.approx(30.0)
    assert accuracy._circuit("adv2e").dark_cutoff_hz == pytest.approx(21.8)


# Settings and report ------------------------------------------------------------------------------


def test_every_setting_is_a_valid_configuration_with_a_name_of_its_own():
    from adv2e import load_config

    found = list(settings.settings())
    assert len({(one.clip, one.name) for one in found}) == len(found)
    for one in found:
        config = load_config([], [*settings.IDEAL, *one.sets])
        assert config.pixel.thresholds.on == config.pixel.thresholds.off == 0.2
        white_hz = 2200.0 if "as measured" in one.name else 300.0
        assert config.pixel.low_pass.cutoff_hz == white_hz
    off = load_config([], list(settings.IDEAL)).pixel
    assert off.refractory is off.leak is off.shot_noise is off.photoreceptor_noise is None
    every = load_config([], list(settings.EVERYTHING)).pixel
    for name in ("leak", "shot_noise", "hot_pixels", "photoreceptor_noise", "refractory"):
        assert getattr(every, name) is not None


def test_frames_count_as_the_pixel_sees_them():
    assert reports.seen_frames(48, ["sampling.L=1"]) == 48
    assert reports.seen_frames(48, ["sampling.L=1", "sampling.L=10"]) == 471


def test_speed_table_counts_a_pixel_frame():
    first = measured([0.5], [1.0], pixels=10_000, frames=100, events=50_000)
    longer = measured([2.0], [2.0], pixels=10_000, frames=200, events=50_000)
    rows = reports.speed_tables([first, longer]).splitlines()[-2:]
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]
    assert cells[0] == ["setting", "2.00", "1.00", "1,000", "1.00", "100", "0.05", "0.10", "80"]
    assert cells[1][:5] == ["setting", "1.00", "1.00", "1,000", "2.00"]


def test_the_slowest_part_decides():
    walls = {"the start": 0.9, "decoding": 0.2, "the pixel": 0.1, "writing": 0.3}
    parts = []
    for part, wall in walls.items():
        one = measured([wall])
        name = end_to_end.PART + end_to_end._DECIDING[part]
        parts.append(processes.Measured(replace(one.job, name=name), one.rounds))
    text = end_to_end.decides(parts)
    assert "writing decides" in text
    assert "0.30 s, one after the other 0.60 s" in text
    assert "not known" in end_to_end.decides(parts[:-1])


def test_parts_of_a_conversion_run(small, tmp_path):
    video = str(clips.encoded(Path(small), 240.0))
    options = {"video": video, "sets": ["sampling.L=1"], "threads": 1, "scratch": str(tmp_path)}
    assert conversion.decode({"options": options})["frames"] == 25
    events = conversion.pixel({"options": options})["events"]
    assert events > 0
    for suffix in (".h5", ".txt"):
        written = conversion.write({"options": {**options, "suffix": suffix}})
        assert written["events"] == events
        assert written["bytes"] > events


def test_times_have_the_unit_that_suits_them():
    assert [figures.duration(value) for value in (0.1, 100, 1e3, 2e6)] == [
        "0.1 µs",
        "100 µs",
        "1 ms",
        "2 s",
    ]


def test_unknown_settings_are_an_error_and_known_ones_make_a_report(tmp_path, monkeypatch):
    monkeypatch.setattr(speed, "find_peers", lambda *_: SimpleNamespace(tools=(), v2e=None))
    monkeypatch.setattr(settings, "stored", lambda clip, folder: folder)
    report = {"wall_s": 1.0, "cpu_s": 2.0, "events": 5, "pixels": 4, "frames": 3}
    monkeypatch.setattr(
        processes, "run_job", lambda job: processes.Round({**report, "versions": {}}, 1.0, None)
    )
    common = ["--quick", "--no-frontier", "--clips", str(tmp_path)]
    wrong = CliRunner().invoke(speed.main, [*common, "--only", "nothing"])
    assert wrong.exit_code == 1
    assert "--only nothing: no setting has such a name" in wrong.output
    out = tmp_path / "out" / "b.md"
    right = CliRunner().invoke(speed.main, [*common, "--only", "346x260: *", "-o", str(out)])
    assert right.exit_code == 0, right.output
    assert "| exact, noise off |" in out.read_text()
    raw = json.loads(out.with_suffix(".json").read_text())
    assert raw["speed"][0]["rounds"][0]["report"]["events"] == 5

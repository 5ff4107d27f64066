"""The parts of scripts/benchmarks/speed.py: processes, ratios, time errors, tables."""

from __future__ import annotations

import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from benchmarks import clips, measure, speed, worker
from click.testing import CliRunner

SCRIPTS = Path(__file__).resolve().parents[3] / "scripts"


def ideal_job(clip, *sets, **fields):
    options = {"sets": [*measure.IDEAL, *sets]}
    return measure.Job(
        **{"name": "a job", "clip": clip, "options": options, "threads": 1, **fields}
    )


def measured(walls, cpus=None, **report):
    """Return a measurement with these times, one a round."""
    rounds = [
        measure.Round({"wall_s": wall, "cpu_s": cpu, "peak_mib": 80.0, **report}, wall, 0.0)
        for wall, cpu in zip(walls, cpus or walls, strict=True)
    ]
    return measure.Measured(measure.Job(name="clip: setting"), rounds)


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
            {"moving": 0.1},
        )
    ]
    assert len({clip.name for clip in [base, *changed]}) == 7


def test_a_fifth_of_the_pixels_of_the_dense_clip_have_an_event_from_frame_to_frame(tmp_path):
    dense = replace(speed.CAMERAS[speed.DENSE], frames=9)
    job = measure.Plan(tmp_path, quick=False, threads=1).job("dense", dense, ())
    report = worker.simulate(vars(job))
    assert report["events"] / (8 * report["pixels"]) == pytest.approx(0.22, abs=0.06)
    assert clips.as_srgb(dense, tmp_path) == Path(job.clip)  # its values are codes already


def test_only_a_band_of_the_rows_moves():
    recipe = clips.Clip(width=60, height=50, frames=6, moving=0.2, fps=24)
    frames = np.stack(list(recipe.render())).astype(int)
    changed = np.abs(np.diff(frames, axis=0)).max(axis=(0, 2)) > 0
    assert np.array_equal(np.flatnonzero(changed), np.arange(20, 30))


def test_a_stored_clip_is_not_made_again(tmp_path):
    recipe = clips.Clip(width=20, height=10, frames=3)
    path = clips.stored(recipe, tmp_path)
    np.save(path, np.zeros((3, 10, 20), np.uint8))
    assert clips.stored(recipe, tmp_path) == path
    assert not np.load(path).any()
    assert [p.suffix for p in tmp_path.iterdir() if p.suffix not in (".npy", ".json")] == []


def test_files_hold_the_light_of_the_frames_in_memory(tmp_path, monkeypatch):
    small = {
        name: replace(clip, width=32, height=24, frames=5) for name, clip in speed.CAMERAS.items()
    }
    monkeypatch.setattr(speed, "CAMERAS", small)
    plan = measure.Plan(tmp_path, quick=False, threads=1)
    notes = []
    jobs = {job.name: job for job in speed.file_jobs(plan, sys.executable, tmp_path, notes)}
    for camera in (speed.SMALL, speed.DENSE):
        ours = jobs[f"{camera}: adv2e to HDF5, noise off, L = 1"].options["command"]
        codes = clips.as_srgb(small[camera], tmp_path)
        assert str(codes.with_suffix(".mp4")) in ours
        encodings = [word for word in ours if word.startswith("frames.encoding=")]
        assert encodings[-1] == "frames.encoding=srgb"
        for steps in ("off", "10"):
            theirs = jobs[f"{camera}: EventCV to HDF5, sub-steps {steps}, noise off"]
            assert str(codes.with_suffix(".mp4")) in theirs.options["command"]
    has_ffmpeg = bool(shutil.which("ffmpeg") and shutil.which("ffprobe"))
    assert has_ffmpeg or "here OpenCV decodes" in notes[0]


# Processes ----------------------------------------------------------------------------------------


@pytest.mark.thorough
def test_a_process_reports_what_it_ran(small):
    job = ideal_job(small, frames=9)
    report = measure.run_job(job).report
    assert report["frames"] == 9
    assert report["pixels"] == 32 * 24
    assert report["events"] > 0
    assert report["wall_s"] > 0
    assert Path(report["versions"]["from"]) == SCRIPTS.parent / "adv2e"
    again = worker.simulate(vars(job))
    assert again["digest"] == report["digest"]
    other = ideal_job(small, "pixel.thresholds.on=0.21", frames=9)
    assert worker.simulate(vars(other))["digest"] != report["digest"]


def test_a_process_that_fails_is_told_in_one_line(small):
    job = ideal_job(small, "pixel.leek=null")
    with pytest.raises(measure.JobError, match=r"^a job: .*pixel.leek: unknown key.*$"):
        measure.run_job(job)


def test_rounds_are_interleaved_and_go_on_past_a_failure(monkeypatch):
    ran, told = [], []

    def run(job):
        ran.append(job.name)
        if job.name == "bad":
            raise measure.JobError("bad: broken")
        return measure.Round({"wall_s": 1.0, "cpu_s": 1.0}, 1.0, None)

    monkeypatch.setattr(measure, "run_job", run)
    jobs = [measure.Job(name=name) for name in ("a", "bad", "b")]
    log = measure.Log(told.append)
    found = measure.run_rounds(jobs, 2, log, warm=jobs[:1])
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
    rate = measure.Spread.of([1.0, 2.0, 4.0]).inverse(8.0)
    assert (rate.median, rate.least, rate.most) == (4.0, 2.0, 8.0)
    assert str(rate) == "4.00 (2.00..8.00)"
    assert str(measure.Spread.of([0.5])) == "0.50"


def test_eventcv_columns_are_taken_by_name(monkeypatch):
    table = np.array([[7, 5, 1000, 1], [6, 4, 2000, 0]], np.uint64)
    stream = SimpleNamespace(
        numpy=lambda: table, columns=("x", "y", "t", "p"), timestamp_scale_ms=0.001
    )
    made = ModuleType("eventcv")
    made.simulate = lambda frames, fps, cutoff_hz: stream
    monkeypatch.setitem(sys.modules, "eventcv", made)
    eventcv = worker.TOOLS["eventcv"]
    events = eventcv.simulator({"arguments": {"cutoff_hz": 300.0}}, None)(
        np.zeros((2, 8, 8)), 240.0
    )
    assert [list(column) for column in eventcv.columns(events)] == [
        [1000, 2000],
        [7, 6],
        [5, 4],
        [1, 0],
    ]


def test_a_python_without_eventcv_is_noted(tmp_path):
    python = tmp_path / "python"
    python.write_text("#!/bin/sh\necho 'ModuleNotFoundError: eventcv' >&2\nexit 1\n")
    python.chmod(0o755)
    notes = []
    assert speed.peer_of(str(python), notes) is None
    assert notes == ["EventCV took no part: ModuleNotFoundError: eventcv."]


# Settings and report ------------------------------------------------------------------------------


def test_every_setting_is_a_valid_configuration_with_a_name_of_its_own():
    from adv2e import load_config

    found = list(speed.settings())
    assert len({(one.clip, one.name) for one in found}) == len(found)
    for one in found:
        if one.config is not None:
            assert load_config(one.config, one.sets).sampling.L == 1  # as the table counts frames
            continue
        config = load_config([], [*measure.IDEAL, *one.sets])
        assert config.pixel.thresholds.on == config.pixel.thresholds.off == 0.2
        white_hz = 2200.0 if "as measured" in one.name else 300.0
        assert config.pixel.low_pass.cutoff_hz == white_hz
    off = load_config([], list(measure.IDEAL)).pixel
    assert off.refractory is off.leak is off.shot_noise is off.photoreceptor_noise is None
    every = load_config([], list(measure.EVERYTHING)).pixel
    for name in ("leak", "shot_noise", "hot_pixels", "photoreceptor_noise", "refractory"):
        assert getattr(every, name) is not None


def test_frames_count_as_the_pixel_sees_them():
    one = measured([1.0], frames=48)
    assert speed.seen_frames(one) == 48
    one.job.options["sets"] = ["sampling.L=1", "sampling.L=10"]
    assert speed.seen_frames(one) == 471


def test_other_tools_are_told_relative_to_the_same_effects():
    walls = {"exact, noise off": 1.0, "all effects, shot 5 Hz": 2.0}
    walls |= {"EventCV, sub-steps off, noise off": 3.0, "EventCV, sub-steps 10, all effects": 8.0}
    found = []
    for name, wall in walls.items():
        one = measured([wall], pixels=100, frames=10)
        found.append(measure.Measured(replace(one.job, name=f"346x260: {name}"), one.rounds))
    rows = speed.relative_table(found).splitlines()[2:]
    assert rows == [
        "| EventCV, sub-steps off, noise off | 3.00 | - | - |",
        "| EventCV, sub-steps 10, all effects | 4.00 | - | - |",
    ]
    assert speed.relative_table(found[:2]) == ""


def test_speed_table_counts_a_pixel_frame():
    first = measured([0.5], [1.0], pixels=10_000, frames=100, events=50_000)
    longer = measured([2.0], [2.0], pixels=10_000, frames=200, events=50_000)
    rows = speed.speed_tables([first, longer]).splitlines()[-2:]
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]
    assert cells[0] == [
        *("setting", "2.00", "1.00", "1,000", "20,000", "1.00", "100", "0.05", "0.10", "80")
    ]
    assert cells[1][:6] == ["setting", "1.00", "1.00", "1,000", "40,000", "2.00"]
    silent = measured([1.0], pixels=10_000, frames=100, events=0)
    assert "| - |" in speed.speed_tables([silent]).splitlines()[-1]


def test_unknown_settings_are_an_error_and_known_ones_make_a_report(tmp_path, monkeypatch):
    monkeypatch.setattr(speed, "peer_of", lambda *_: None)
    monkeypatch.setattr(measure, "stored", lambda clip, folder: folder)
    report = {"wall_s": 1.0, "cpu_s": 2.0, "events": 5, "pixels": 4, "frames": 3}
    monkeypatch.setattr(
        measure, "run_job", lambda job: measure.Round({**report, "versions": {}}, 1.0, None)
    )
    common = ["--quick", "--clips", str(tmp_path)]
    wrong = CliRunner().invoke(speed.main, [*common, "--only", "nothing"])
    assert wrong.exit_code == 1
    assert "--only nothing: no setting has such a name" in wrong.output
    out = tmp_path / "out" / "b.md"
    right = CliRunner().invoke(speed.main, [*common, "--only", "346x260: *", "-o", str(out)])
    assert right.exit_code == 0, right.output
    assert "| exact, noise off |" in out.read_text()
    raw = json.loads(out.with_suffix(".json").read_text())
    assert raw["measured"][0]["rounds"][0]["report"]["events"] == 5

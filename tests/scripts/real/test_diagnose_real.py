"""Real recordings, diagnosed: the script, and what it asks of a recording."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from narrow_candidates import BLACK_LEVEL
from real import diagnose
from real.model import BEYOND_US, SCORE, Bench, Judged
from real.recording import halves, read
from real.search import Search
from real.stability import MOST, compare_halved
from real.tried import UNSEEN, Added, tried_names
from written_recordings import write_recording

from adv2e import simulate
from adv2e.comparison.windows import Windows
from adv2e.config import load_config
from adv2e.diagnosis.fitting.library import names as library_names
from adv2e.events import cut, empty_events, make_events

REAL = os.environ.get("ADV2E_REAL_DATA")
WIDTH, HEIGHT, FRAMES = 24, 16, 9
TIMES = np.arange(FRAMES) * 0.02


def moving_waves():
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    phases = 2 * np.pi * (x / 11 + y / 17 - 9 * TIMES[:, None, None])
    return np.rint(60 + 50 * np.sin(phases)).astype(np.uint8)


@pytest.fixture
def recording(tmp_path):
    """Waves seen by an ideal pixel with a black level of 20 DN, ON 0.2, OFF 0.15."""
    frames = moving_waves()
    sets = [
        "frames.encoding=linear",
        "frames.black_level_dn=20",
        "pixel.thresholds.on=0.2",
        "pixel.thresholds.off=0.15",
        "pixel.log_response.linear_below=0",
        "pixel.log_response.floor=0.5",
    ]
    config = load_config(["ideal"], sets)
    events = np.concatenate(list(simulate(frames, TIMES, config, threads=1)))
    return write_recording(tmp_path / "waves", TIMES, frames, events)


@pytest.fixture
def declared(tmp_path):
    path = tmp_path / "declared.yaml"
    path.write_text(
        "pixel: {log_response: {linear_below: 0, floor: 0.5}, low_pass: null, refractory: null,"
        " leak: null, shot_noise: null, thresholds: {on: 0.3, off: 0.3, mismatch: 0}}\n"
    )
    return path


@pytest.mark.parametrize(("which", "span"), [("second", (0.0, 0.05)), ("first", (0.11, 0.16))])
def test_a_half_without_events_is_told(recording, declared, which, span):
    """The first and the last event stay, between which all intervals lie."""
    path = recording / "events.txt"
    first, *lines, last = path.read_text().splitlines(keepends=True)
    kept = [line for line in lines if span[0] <= float(line.split()[0]) < span[1]]
    path.write_text("".join([first, *kept, last]))
    result = CliRunner().invoke(
        diagnose.main, [str(recording), "--declared", str(declared), "--output", "-"]
    )
    assert result.exit_code == 1
    told = f"no events in the {which} half of its frame intervals"
    assert told in result.output


def test_the_search_finds_the_black_level_that_made_the_events(recording, declared, monkeypatch):
    bench = Bench(read(str(recording)), 1)
    first, _ = halves(bench.real.windows)
    said = []
    monkeypatch.setattr("real.search.OWN", ())
    monkeypatch.setattr("real.search.of_the_camera", lambda *_: [BLACK_LEVEL])
    steps = list(Search(bench, first, said.append).run(load_config([declared])))
    assert [step.candidate.name for step in steps] == ["thresholds", "black_level"]
    before, best = steps
    assert best.score < 0.5 * before.score
    assert any("without black_level" in line for line in said)
    assert best.values[0] == pytest.approx(20.0, rel=0.25)
    assert best.config.pixel.thresholds.on == pytest.approx(0.2, rel=0.1)
    assert best.config.pixel.thresholds.off == pytest.approx(0.15, rel=0.1)
    assert best.text() == f"black_level (black_level_dn {best.values[0]:.4g})"


@pytest.mark.parametrize("sets", [[], ["frames.clock_offset_us=-3000", "frames.black_level_dn=4"]])
def test_in_between_frames_made_once_give_nearly_the_events_of_a_conversion(
    recording, declared, sets
):
    bench = Bench(read(str(recording)), 1)
    windows = bench.real.windows
    config = load_config([declared], ["sampling.interpolation=flow", *sets])
    quick = bench.quick(config, windows, 3)
    whole = bench.real.simulator(config, windows.stop + BEYOND_US, 1)(3)
    whole = cut(whole, windows.start, windows.stop)
    assert len(whole) > 1000
    assert len(quick) == pytest.approx(len(whole), rel=0.01)


def test_noise_in_still_pixels_is_no_explanation():
    before = Added.plain("before", load_config(), 0.8, still_hz=0.1)
    assert Added.plain("leak", load_config(), 0.7, still_hz=1.0).noisier(before, 0.2)
    assert not Added.plain("leak", load_config(), 0.7, still_hz=0.2).noisier(before, 0.2)
    assert not Added.plain("leak", load_config(), 0.7).noisier(before, None)
    assert not Added.plain("black_level", load_config(), 0.7, still_hz=1.0).noisier(before, 0.2)


def test_the_chance_of_the_simulation_is_taken_off():
    judged = Judged({"a": 0.5, "b": 0.1, "c": None}, {"a": 0.4, "b": 0.4, "c": None}, 1.0, 0.5)
    assert judged.without_chance("a") == pytest.approx(np.sqrt(0.25 - 0.08))
    assert judged.without_chance("b") == 0.0
    assert judged.without_chance("c") is None


def test_every_second_frame_and_the_ends_stay(recording):
    thin = read(str(recording)).thinned()
    assert np.flatnonzero(thin.used).tolist() == [0, 2, 4, 6, 8]
    assert len(list(thin.frames())) == 5


def noisy(rng, x, count, on):
    t = np.sort(rng.integers(0, 40_000, count))
    return make_events(t, x + rng.integers(0, 8, count), np.full(count, 3), np.full(count, on))


def test_tiles_that_change_are_unstable_and_chance_is_not():
    rng = np.random.default_rng(1)
    windows = Windows("frame intervals", ((0, 40_000),), 1)

    def stream(second_on):
        parts = [noisy(rng, 0, 2000, 1), noisy(rng, 16, 2000, second_on)]
        if not second_on:
            parts.append(noisy(rng, 32, 200, 1))  # where there was nothing
        both = np.concatenate(parts)
        return both[np.argsort(both["t"], kind="stable")]

    whole, halved = (stream(1), stream(1)), (stream(0), stream(0))
    measured = stream(1)
    found = compare_halved(whole, halved, windows, 40, 8)
    assert (found.tiles[0, 3, :8] < 0.1).all()
    assert np.isinf(found.tiles[0, 3, 32:]).all()
    assert found.tiles[0, 3, 16:24] == pytest.approx(2.0, rel=0.05)
    assert found.change == pytest.approx(np.sqrt(2.0), rel=0.1)
    alone = found.alone(measured, MOST)
    assert len(alone) == 2000
    assert len(alone) / len(measured) == pytest.approx(0.5)
    assert np.all(alone["x"] < 8)
    assert len(found.alone(measured, 2.2)) == 4000
    assert len(found.alone(empty_events(), MOST)) == 0


def run_script(recording, declared, out, *more):
    arguments = [
        str(recording),
        "--declared",
        str(declared),
        "--threads",
        "1",
        "--output",
        str(out),
    ]
    arguments += map(str, more)
    return CliRunner().invoke(diagnose.main, arguments)


def rows_of(text):
    return [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")]


@pytest.mark.parametrize("steps", [0, 2])
def test_an_interrupted_search_leaves_what_it_found(
    recording, declared, tmp_path, monkeypatch, steps
):
    class Interrupted:
        def __init__(self, *_):
            pass

        def run(self, config, only):
            for name in ("first", "second")[:steps]:
                yield Added.plain(name, config)
            raise KeyboardInterrupt

    monkeypatch.setattr(diagnose, "Search", Interrupted)
    result = run_script(recording, declared, tmp_path / "table.md")
    if not steps:
        assert result.exit_code == 1
        assert not (tmp_path / "table.md").exists()
        return
    assert result.exit_code == 0, result.output
    text = (tmp_path / "table.md").read_text(encoding="utf-8")
    assert [row[0] for row in rows_of(text)][2:5] == ["as declared", "first", "second"]
    assert "The search was interrupted: there may be more to find." in text


def test_tables_before_and_after_each_effect(recording, declared, tmp_path, monkeypatch):
    monkeypatch.setattr("real.search.OWN", ())
    monkeypatch.setattr("real.search.of_the_camera", lambda *_: [BLACK_LEVEL])
    out = tmp_path / "table.md"
    result = run_script(recording, declared, out)
    assert result.exit_code == 0, result.output
    text = out.read_text(encoding="utf-8")
    assert "interrupted" not in text
    rows = rows_of(text)
    labels = [row[0] for row in rows]
    assert labels[2:4] == ["as declared", "thresholds"]
    assert labels[4].startswith("black_level")
    chance = ["half split (Poisson)", "no events at all"]
    assert labels[5:7] == chance
    assert labels[7] == "change below"
    assert rows[-1][:2] == ["any", "100%"]
    of_all = float(rows[-1][5].split(" ")[0])
    assert of_all == pytest.approx(float(rows[4][5].split(" ")[0]), abs=0.02)
    smoothed = [float(row[5].split(" ")[0]) for row in rows[2:7]]
    assert smoothed[2] < smoothed[1]
    assert smoothed[4] == 1.0
    assert "hold 0% of the measured events" in text  # the waves are too fast for that
    (missed,) = re.findall(r"match the totals of the first to (\d+\.\d)%", text)
    assert float(missed) <= 3.0
    assert "Camera effects tried: all of the library but" in text
    assert "No other tools were run on this recording." in text


def test_where_all_is_stable_its_table_is_that_of_all(recording, declared, tmp_path, monkeypatch):
    monkeypatch.setattr("real.where_stable.MOST", 10.0)
    monkeypatch.setattr("real.search.OWN", ())
    monkeypatch.setattr("real.search.of_the_camera", lambda *_: [])
    out = tmp_path / "table.md"
    result = run_script(recording, declared, out)
    assert result.exit_code == 0, result.output
    text = out.read_text(encoding="utf-8")
    assert "hold 100% of the measured events" in text
    rows = rows_of(text)
    assert rows[:6] == rows[6:12]
    assert rows[12][0] == "change below"


def test_a_model_that_was_kept_is_judged_again(recording, declared, tmp_path, monkeypatch):
    monkeypatch.setattr("real.search.OWN", ())
    monkeypatch.setattr("real.search.of_the_camera", lambda *_: [BLACK_LEVEL])
    outs, models = [tmp_path / "first.md", tmp_path / "again.md"], tmp_path / "models"
    for out in outs:
        result = run_script(recording, declared, out, "--models", models)
        assert result.exit_code == 0, result.output
    kept = load_config([models / "waves.yaml"])
    assert kept.frames.black_level_dn == pytest.approx(20, abs=3)
    sought, judged = (rows_of(out.read_text(encoding="utf-8")) for out in outs)
    assert judged[4][0] == "as found, waves.yaml"
    assert [row[1:] for row in judged[:5]] == [row[1:] for row in sought[:5]]
    assert judged[5:] == sought[5:]


def test_a_folder_for_models_that_cannot_be_made_is_told_at_once(recording, declared, tmp_path):
    (tmp_path / "file").write_text("")
    out = tmp_path / "table.md"
    result = run_script(recording, declared, out, "--models", tmp_path / "file" / "models")
    assert result.exit_code == 1
    assert "models: Not a directory" in result.output


@pytest.mark.parametrize(
    ("names", "told"),
    [
        ("black_level,flikker", "flikker: must be one of clipped_black, "),
        ("hot_pixels", "hot_pixels is not tried: a few pixels do not move this score"),
    ],
)
def test_effects_that_cannot_be_tried_are_told(recording, names, told):
    result = CliRunner().invoke(diagnose.main, [str(recording), "--effects", names])
    assert result.exit_code == 2
    assert told in result.output


def test_every_effect_of_the_library_is_tried_or_said_not_to_be():
    assert {*tried_names(), *UNSEEN} == {"clipped_black", *library_names()}
    assert not set(tried_names()) & set(UNSEEN)


@pytest.mark.skipif(not REAL, reason="ADV2E_REAL_DATA does not name a folder of recordings")
def test_flow_and_an_offset_come_nearer_to_the_slider_than_the_best_tool():
    bench = Bench(read(str(Path(str(REAL)) / "davis240c-slider-depth-chunk")), None)
    first, second = halves(bench.real.windows)
    sets = [
        "sampling.interpolation=flow",
        "frames.clock_offset_us=3000",
        "frames.black_level_dn=8",
        "pixel.log_response.linear_below=0",
        "pixel.log_response.floor=0.5",
        "pixel.initial_reference=random",
    ]
    config = bench.matched(load_config(["ideal"], sets), first, tolerance=0.01)
    judged = bench.judge(config, second, (1, 2))
    assert judged.values[SCORE] < 0.65
    assert judged.events_ratio == pytest.approx(1.0, abs=0.15)

from __future__ import annotations

import os
from pathlib import Path

import cv2
import diagnose_real
import numpy as np
import pytest
from click.testing import CliRunner
from real.fit import Fit, Model, enough_seeds
from real.model import BEYOND_US, SCORE, Bench, Judged
from real.recording import halves, read
from real.search import Search
from real.stability import compare_halved, stable_score
from real.tried import CLIPPED_BLACK, Added

from adv2e import simulate
from adv2e.comparison.windows import Windows, cut
from adv2e.config import load_config
from adv2e.diagnosis.candidates import Candidate, Knob
from adv2e.events import empty_events, make_events

REAL = os.environ.get("ADV2E_REAL_DATA")
WIDTH, HEIGHT, FRAMES = 24, 16, 9
TIMES = np.arange(FRAMES) * 0.02
BLACK_LEVEL = Candidate(
    "black_level", (Knob("frames.black_level_dn", 0.02, 100.0),), ((2.0,), (14.0,))
)


def moving_waves():
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    phases = 2 * np.pi * (x / 11 + y / 17 - 9 * TIMES[:, None, None])
    return np.rint(60 + 50 * np.sin(phases)).astype(np.uint8)


@pytest.fixture
def recording(tmp_path):
    """Waves seen by an ideal pixel with a black level of 20 DN, ON 0.2, OFF 0.15."""
    folder = tmp_path / "waves"
    (folder / "images").mkdir(parents=True)
    frames = moving_waves()
    sets = [
        "frames.black_level_dn=20",
        "pixel.thresholds.on=0.2",
        "pixel.thresholds.off=0.15",
        "pixel.log_response.linear_below=0",
        "pixel.log_response.floor=0.5",
    ]
    config = load_config(["ideal"], sets)
    events = np.concatenate(list(simulate(frames, TIMES, config, threads=1)))
    names = [f"images/frame_{number:08d}.png" for number in range(FRAMES)]
    for name, frame in zip(names, frames, strict=True):
        assert cv2.imwrite(str(folder / name), frame)
    stamps = [f"{t:.9f} {name}\n" for t, name in zip(TIMES, names, strict=True)]
    (folder / "images.txt").write_text("".join(stamps))
    lines = [f"{e['t'] / 1e6:.9f} {e['x']} {e['y']} {e['p']}\n" for e in events]
    (folder / "events.txt").write_text("".join(lines))
    return folder


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
        diagnose_real.main, [str(recording), "--declared", str(declared), "--out", "-"]
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


OFFSET = Candidate("clock_offset", (Knob("frames.clock_offset_us", -1e6, 1e6, False, 1e3),), ())


EVERYTHING = Windows("frame intervals", ((0, 100_000),), 1)


class Valley:
    """A bench whose score is least at 14 DN, 5 DN and 2 ms, along a valley that no key follows.

    Chance adds `chance` times a number that depends on the seed.
    """

    def __init__(self, chance=0.0):
        self.tried, self.chance = 0, chance

    def still_hz(self, windows):
        return None

    def matched(self, config, windows):
        return config

    def score(self, config, windows, seeds):
        self.tried += 1
        frames = config.frames
        level, depth = np.log([frames.black_level_dn / 14.0, frames.black_depth_dn / 5.0])
        late = frames.clock_offset_us / 1000.0 - 2.0
        luck = self.chance * np.mean([(-1.0) ** seed for seed in seeds])
        hills = (level - depth) ** 2 + 0.1 * (level + depth) ** 2 + 0.02 * late**2
        return 0.5 + hills + luck, None


def fitted(bench, seeds=(0,)):
    fit = Fit(bench, None)
    fit.seeds = seeds
    return fit


def model_of(found, sets=(), base=()):
    """A model in the valley."""
    config = load_config([], sets)
    score, _ = Valley().score(config, None, (0,))
    return Model(load_config([], base), found, Added.plain("last", config, score))


def test_the_last_search_moves_all_keys_together():
    bench = Valley()
    start = model_of({CLIPPED_BLACK: (7.0, 3.5), OFFSET: (600.0,)}, [
        "frames.black_level_dn=7", "frames.black_depth_dn=3.5", "frames.clock_offset_us=600",
    ])  # fmt: skip
    best = fitted(bench).settled(start)
    values = best.found[CLIPPED_BLACK] + best.found[OFFSET]
    assert values == pytest.approx((14.0, 5.0, 2000.0), rel=0.1)
    assert best.here.config.frames.black_level_dn == values[0]
    assert best.here.score == pytest.approx(0.5, abs=3e-3)
    assert bench.tried < 120
    assert best.here.text() == "all keys together"


def test_what_is_no_longer_needed_is_dropped():
    needless = Candidate("leak", (Knob("pixel.leak.rate_hz", 0.01, 10.0),), ())
    search = Search(Valley(), EVERYTHING, print)
    search._fit.seeds = (0,)
    found = {CLIPPED_BLACK: (14.0, 5.0), needless: (0.5,), OFFSET: (2000.0,)}
    sets = [
        "frames.black_level_dn=14", "frames.black_depth_dn=5", "frames.clock_offset_us=2000",
        "pixel.leak.rate_hz=0.5",
    ]  # fmt: skip
    base = ["frames.black_level_dn=5", "frames.black_depth_dn=5"]
    left = list(search._removals(model_of(found, sets, base)))
    assert [model.here.text() for model in left] == ["without leak"]
    assert list(left[0].found) == [CLIPPED_BLACK, OFFSET]
    config = left[0].here.config
    assert config.pixel.leak == load_config().pixel.leak
    assert config.frames.clock_offset_us == 2000.0


def test_a_wider_effect_takes_the_place_of_a_narrower_one():
    sets = ["frames.black_level_dn=14", "frames.black_depth_dn=5"]
    start = model_of({BLACK_LEVEL: (7.0,)}, sets)
    every = [BLACK_LEVEL, CLIPPED_BLACK, OFFSET]
    assert [one for one in every if start.lacks(one)] == [CLIPPED_BLACK, OFFSET]
    added = Added(CLIPPED_BLACK, (14.0, 5.0), load_config([], sets), 0.5, None)
    wider = fitted(Valley()).kept(start, added)
    assert list(wider.found) == [CLIPPED_BLACK]
    assert [one for one in every if wider.lacks(one)] == [OFFSET]


class Pass(Valley):
    """Two valleys: that of a clock offset is met first, that of the black level is deeper."""

    def score(self, config, windows, seeds):
        self.tried += 1
        frames = config.frames
        level, depth = np.log([frames.black_level_dn / 14.0, frames.black_depth_dn / 5.0])
        late = frames.clock_offset_us / 1000.0 - 2.0
        first = 0.05 + 0.1 * late**2
        deeper = 0.02 * level**2 + 0.02 * depth**2
        return 0.5 + min(first, deeper), None


def test_what_was_found_first_is_replaced_by_what_is_nearer(monkeypatch):
    level, depth = (
        Candidate(name, (Knob(f"frames.{name}_dn", 0.02, 100.0),), ((start,),))
        for name, start in (("black_level", 12.0), ("black_depth", 4.0))
    )
    offset = Candidate("clock_offset", OFFSET.knobs, ((2000.0,),))
    monkeypatch.setattr("real.search.OWN", ())
    monkeypatch.setattr("real.search.of_the_camera", lambda *_: [level, depth, offset])
    declared = load_config(["ideal"], ["frames.black_level_dn=1", "frames.black_depth_dn=1"])
    steps = list(Search(Pass(), EVERYTHING, print).run(declared))
    names = [step.candidate.name for step in steps]
    assert names[:2] == ["thresholds", "clock_offset"]
    assert any(" in place of clock_offset" in name for name in names)
    frames = steps[-1].config.frames
    assert frames.black_level_dn == pytest.approx(14.0, rel=0.1)
    assert frames.black_depth_dn == pytest.approx(5.0, rel=0.1)
    assert frames.clock_offset_us == 0.0
    assert steps[-1].score == pytest.approx(0.5, abs=3e-3)


IN_THE_VALLEY = load_config(["ideal"], ["frames.black_level_dn=14", "frames.black_depth_dn=5"])


class Seen(Valley):
    """A valley that notes with how many seeds each late clock is scored; leak makes noise."""

    def __init__(self):
        super().__init__()
        self.seen = []

    def still_hz(self, windows):
        return 0.1

    def score(self, config, windows, seeds):
        self.seen.append((config.frames.clock_offset_us / 1000.0, len(seeds)))
        leak = config.pixel.leak
        return super().score(config, windows, seeds)[0], 5.0 if leak else 0.1


def test_only_what_leads_with_one_seed_is_tried_with_all():
    bench = Seen()
    probes = [(OFFSET, (1000.0 * late,)) for late in range(9)]
    tried = fitted(bench, (0, 1, 2)).ranked(probes, IN_THE_VALLEY)
    assert bench.seen[:9] == [(late, 1) for late in range(9)]
    assert sorted(bench.seen[9:]) == [(late, 3) for late in (0, 1, 2, 3, 4, 5)]
    assert [one.values[0] for one in tried[:3]] == [2000.0, 1000.0, 3000.0]
    assert len(tried) == 9


def test_what_made_noise_of_its_own_is_not_tried_again():
    bench = Seen()
    search = Search(bench, EVERYTHING, print)
    search._fit.seeds = (0,)
    leak = Candidate("leak", (Knob("pixel.leak.rate_hz", 0.01, 10.0),), ((2.0,),))
    late = Candidate("clock_offset", OFFSET.knobs, ((2000.0,),))
    here = Added.plain("here", IN_THE_VALLEY, 1.0, still_hz=0.1)
    for count in (2, 1):
        bench.seen.clear()
        assert [one.candidate for one in search._probed([leak, late], here)] == [late]
        assert len(bench.seen) == count


@pytest.mark.parametrize(("chance", "count"), [(0.0, 1), (1e-4, 1), (1e-3, 2), (0.1, 4)])
def test_seeds_are_as_many_as_chance_asks_for(chance, count):
    config = load_config([], ["frames.black_level_dn=14", "frames.black_depth_dn=5"])
    assert enough_seeds(Valley(chance), config, None, 7) == tuple(range(7, 7 + count))


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
        both = np.concatenate(parts)
        return both[np.argsort(both["t"], kind="stable")]

    whole, halved = (stream(1), stream(1)), (stream(0), stream(0))
    measured = stream(1)
    found = compare_halved(whole, halved, measured, windows, 24, 8)
    assert found.stable[0, 3, :8].all()
    assert not found.stable[0, 3, 16:].any()
    assert found.kept == pytest.approx(0.5)
    assert found.change == pytest.approx(np.sqrt(2.0), rel=0.1)
    assert stable_score(measured, whole[0], windows, found) < 0.3
    assert stable_score(measured, empty_events(), windows, found) == pytest.approx(1.0)


def run_script(recording, declared, out):
    arguments = [str(recording), "--declared", str(declared), "--threads", "1", "--out", str(out)]
    return CliRunner().invoke(diagnose_real.main, arguments)


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

    monkeypatch.setattr(diagnose_real, "Search", Interrupted)
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
    assert labels[5:] == ["half split (Poisson)", "no events at all"]
    smoothed = [float(row[5].split(" ")[0]) for row in rows[2:]]
    assert smoothed[2] < smoothed[1]
    assert smoothed[4] == 1.0
    assert "Dropping every second frame" in text
    assert "Camera effects tried: all of the library but" in text
    assert "No other tools were run on this recording." in text


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

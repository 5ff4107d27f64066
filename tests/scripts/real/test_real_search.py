"""The search for effects of real recordings, on benches with a known valley."""

from __future__ import annotations

import numpy as np
import pytest
from narrow_candidates import BLACK_LEVEL
from real.fit import MOST_SEEDS, PRECISION, Fitter, Model, enough_seeds
from real.search import Search
from real.tried import CLIPPED_BLACK, Added

from adv2e.comparison.windows import Windows
from adv2e.config import load_config
from adv2e.diagnosis.fitting.candidates import Candidate, FitParameter

OFFSET = Candidate(
    "clock_offset", (FitParameter("frames.clock_offset_us", -1e6, 1e6, False, 1e3),), ()
)


EVERYTHING = Windows("frame intervals", ((0, 100_000),), 1)


class Valley:
    """A bench whose score is least at 14 DN, 5 DN and 2 ms, along a valley that no key follows.

    Chance adds `chance` times a number that depends on the seed.
    """

    def __init__(self, chance=0.0):
        self.tried, self.chance, self.pulse = 0, chance, None

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
    fit = Fitter(bench, None)
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
    needless = Candidate("leak", (FitParameter("pixel.leak.rate_hz", 0.01, 10.0),), ())
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
        Candidate(name, (FitParameter(f"frames.{name}_dn", 0.02, 100.0),), ((start,),))
        for name, start in (("black_level", 12.0), ("black_depth", 4.0))
    )
    offset = Candidate("clock_offset", OFFSET.parameters, ((2000.0,),))
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
    starts = [(OFFSET, (1000.0 * late,)) for late in range(9)]
    tried = fitted(bench, (0, 1, 2)).ranked(starts, IN_THE_VALLEY)
    assert bench.seen[:9] == [(late, 1) for late in range(9)]
    assert sorted(bench.seen[9:]) == [(late, 3) for late in (0, 1, 2, 3, 4, 5)]
    assert [one.values[0] for one in tried[:3]] == [2000.0, 1000.0, 3000.0]
    assert len(tried) == 9


def test_what_made_noise_of_its_own_is_not_tried_again():
    bench = Seen()
    search = Search(bench, EVERYTHING, print)
    search._fit.seeds = (0,)
    leak = Candidate("leak", (FitParameter("pixel.leak.rate_hz", 0.01, 10.0),), ((2.0,),))
    late = Candidate("clock_offset", OFFSET.parameters, ((2000.0,),))
    here = Added.plain("here", IN_THE_VALLEY, 1.0, still_hz=0.1)
    for count in (2, 1):
        bench.seen.clear()
        assert [one.candidate for one in search._probed([leak, late], here)] == [late]
        assert len(bench.seen) == count


@pytest.mark.parametrize(("chance", "count"), [(0.0, 1), (1e-4, 1), (1e-3, 2), (0.1, 4)])
def test_seeds_are_as_many_as_chance_asks_for(chance, count):
    config = load_config([], ["frames.black_level_dn=14", "frames.black_depth_dn=5"])
    seeds, known_to = enough_seeds(Valley(chance), config, None, 7)
    assert seeds == tuple(range(7, 7 + count))
    assert (known_to <= PRECISION) == (count < MOST_SEEDS)

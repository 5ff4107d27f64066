"""Tables of shares of pixels, drawn from the model with a known cause."""

from __future__ import annotations

import numpy as np
import pytest

from adv2e.diagnosis.tables.characterise import characterise, problem_of
from adv2e.diagnosis.tables.noise import NoisySources, noise_rates
from adv2e.diagnosis.tables.problem import Settings, read_declared
from adv2e.diagnosis.tables.selection import Selector
from adv2e.diagnosis.tables.table import parse_table

LIGHT = np.array([1.0, 10.0, 40.0, 120.0, 255.0])
PIXELS, SECONDS = 5000, 5.0
NUMBERS = 1, 2, 4, 8
KNOWN = [
    "pixel.low_pass.cutoff_hz=600",
    "pixel.low_pass.dark_cutoff_hz=10",
    "pixel.thresholds.off=0.23",
    "pixel.refractory.period_us=500",
    "pixel.leak.rate_hz=0.1",
    "pixel.leak.photo_rate_hz=0.0",
]
TRUTH = NoisySources(
    rms=0.06, cutoff_hz=600, dark_cutoff_hz=10, follower_hz=120, off=0.23, mismatch=0.04,
    dead_time_s=5e-4, leak_hz=0.1, noise_step=0.1,
)  # fmt: skip


def table(sources, light=LIGHT):
    rates, seconds = noise_rates(sources, light / 255.0), np.full(light.size, SECONDS)
    rng = np.random.default_rng(3)
    columns = {"light_dn": light}
    for polarity in ("on", "off"):
        for number in NUMBERS:
            share = rates.share_having(number, seconds, polarity == "on")
            columns[f"{polarity}_share_{number}"] = rng.binomial(PIXELS, share) / PIXELS
    columns["pixels"], columns["duration_s"] = [PIXELS] * light.size, seconds
    lines = [",".join(columns)]
    lines += [",".join(map(str, row)) for row in zip(*columns.values(), strict=True)]
    return parse_table("\n".join(lines), "noise.csv")


@pytest.mark.thorough
def test_noise_behind_a_second_pole_is_found_and_predicts_light_held_out():
    measured, declared = table(TRUTH), read_declared([], KNOWN)
    settings = Settings(white=255.0, judge=["light_dn=40"])
    selector = Selector(problem_of(measured, declared, settings), settings)
    by_name = {one.name: one for one in selector.problem.candidates}
    fitted = selector.fitted((by_name["photoreceptor_noise"],))
    found = fitted.settings
    assert found["pixel.photoreceptor_noise.rms"] == pytest.approx(0.06, rel=0.1)
    assert found["pixel.source_follower.cutoff_hz"] == pytest.approx(120.0, rel=0.2)
    assert found["pixel.thresholds.mismatch"] == pytest.approx(0.04, rel=0.2)
    floor = float(np.sqrt(selector.floors.mean()))
    assert fitted.error < 1.5 * floor
    for name in ("shot_noise", "photo_leak", "hot_pixels"):
        assert selector.fitted((by_name[name],)).error > 5.0 * floor


@pytest.mark.thorough
def test_hot_pixels_that_are_spread_are_named():
    known = [*KNOWN, "pixel.photoreceptor_noise=null", "pixel.shot_noise.rate_hz=0.2"]
    sources = NoisySources(
        leak_hz=0.1, shot_hz=0.2, dead_time_s=5e-4, hot_fraction=0.05, hot_hz=2.0, hot_spread=0.7
    )
    settings = Settings(white=255.0, draws=20)
    problem = problem_of(table(sources), read_declared([], known), settings)
    problem.candidates = [one for one in problem.candidates if one.name in ("leak", "hot_pixels")]
    chosen = Selector(problem, settings).select()
    assert chosen.after.names == ("hot_pixels",)
    assert chosen.after.settings["pixel.hot_pixels.spread"] == pytest.approx(0.7, rel=0.3)
    assert chosen.after.settings["pixel.hot_pixels.fraction"] == pytest.approx(0.05, rel=0.2)


@pytest.mark.parametrize("shot_hz", [0.3, 0.0])
@pytest.mark.thorough
def test_three_lights_are_met_by_all_that_is_needed_and_no_more(shot_hz):
    """No effect, nor two or three, meet them; and none is a pile of half of the pixels, all hot."""
    light = np.array([0.1, 20.0, 255.0])
    sources = NoisySources(
        leak_hz=0.15, photo_leak_hz=0.5, shot_hz=shot_hz, dead_time_s=5e-4, hot_fraction=0.05,
        hot_hz=1.5, hot_spread=0.5,
    )  # fmt: skip
    settings = Settings(white=255.0, draws=40)
    declared = read_declared([], ["pixel.low_pass=null", "pixel.refractory.period_us=500"])
    measured = table(sources, light)
    problem = problem_of(measured, declared, settings)
    chosen = Selector(problem, settings).select()
    needed = {"leak", "photo_leak", "hot_pixels"} | ({"shot_noise"} if shot_hz else set())
    assert chosen.verdict == "explained"
    assert set(chosen.after.names) == needed
    found = chosen.after.settings
    assert found["pixel.hot_pixels.fraction"] == pytest.approx(0.05, rel=0.2)
    assert found["pixel.leak.photo_rate_hz"] == pytest.approx(0.5, rel=0.1)
    assert found.get("pixel.shot_noise.rate_hz", 0.0) == pytest.approx(shot_hz, rel=0.1)
    assert characterise(measured, declared, settings).verdict == "explained"

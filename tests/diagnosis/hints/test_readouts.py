"""When frames were read out, told by events that come from all pixels at once."""

import numpy as np
import pytest
from made_up.sampler import HINTS, RECORDING, MadeUpSampler, search_of
from made_up.streams import stream_of

from adv2e.config import Config, load_config
from adv2e.diagnosis.fitting.candidates import Candidate
from adv2e.diagnosis.fitting.fitted import Fitted
from adv2e.diagnosis.fitting.library import library
from adv2e.diagnosis.hints.readouts import Readouts, readouts_of
from adv2e.diagnosis.selection.joint_fits import with_more
from adv2e.diagnosis.selection.shortlist import shortlisted

INTERVAL_US = 2000.0
TIMES_S = 3.0 + 2e-3 * np.arange(200)


def events(delay_us=None, count=20_000, burst=12, seed=1):
    """Return events at any time, and some of all pixels `delay_us` after each frame."""
    draw = np.random.default_rng(seed)
    t = [3e6 + 398_000 * draw.random(count)]
    on = [draw.integers(0, 2, count)]
    if delay_us is not None:
        t.append((1e6 * TIMES_S[:-1, None] + delay_us + 15.0 * draw.random(burst)).ravel())
        on.append(np.zeros(t[-1].size, np.int64))
    t, on = np.concatenate(t), np.concatenate(on)
    order = np.argsort(t)
    return stream_of(t[order].astype(np.int64), 0, 0, on[order])


@pytest.mark.parametrize("delay_us", [3.0, 700.0, 1500.0, 1984.0])
def test_the_delay_of_readouts(delay_us):
    found = readouts_of(events(delay_us), TIMES_S)
    assert found.delay_us == pytest.approx(delay_us, abs=20.0)
    assert found.interval_us == pytest.approx(INTERVAL_US)


@pytest.mark.parametrize(
    ("stream", "times_s"),
    [
        (events(), TIMES_S),
        (events(700.0, burst=1), TIMES_S),
        (events(700.0), TIMES_S + 1e-4 * np.random.default_rng(2).random(200)),
        (events(700.0), TIMES_S[:1]),
    ],
    ids=["none", "few", "irregular", "one frame"],
)
def test_no_readouts(stream, times_s):
    assert readouts_of(stream, times_s) is None


def test_swings_are_no_readouts():
    draw = np.random.default_rng(5)
    t = 3e6 + 398_000 * draw.random(60_000)
    kept = draw.random(t.size) < 0.5 + 0.5 * np.sin(2.0 * np.pi * t / INTERVAL_US)
    t = np.sort(t[kept])
    assert readouts_of(stream_of(t.astype(np.int64), 0, 0, 1), TIMES_S) is None


@pytest.mark.parametrize(
    ("delay_us", "offset_us", "exposure_us", "wanted"),
    [
        (1500.0, 0.0, 15_500.0, 15_000.0),
        (1500.0, 0.0, 17_500.0, 19_000.0),
        (1500.0, 0.0, 100.0, 3000.0),
        (1500.0, 300.0, 15_500.0, 14_400.0),
        (500.0, 900.0, 2500.0, 3200.0),
        (0.0, 0.0, 100.0, 4000.0),
    ],
)
def test_the_exposure_that_ends_at_a_readout(delay_us, offset_us, exposure_us, wanted):
    keys = [f"frames.exposure_us={exposure_us}", f"frames.clock_offset_us={offset_us}"]
    found = Readouts(delay_us, INTERVAL_US).exposed(load_config([], keys))
    assert found.frames.exposure_us == pytest.approx(wanted)
    assert found.frames.clock_offset_us == offset_us


class Leaps(MadeUpSampler):
    """Leaps at readouts change nothing but where the exposure ends just at these."""

    def _mean(self, config):
        off = config.frames.exposure_us / 15_000.0 - 1.0
        mean = super()._mean(config)
        if config.readout is not None and config.readout.frame_coupling is not None:
            amplitude = config.readout.frame_coupling.amplitude
            mean = mean + 400.0 * amplitude * np.exp(-((off / 0.015) ** 2)) * self.leap
        return mean + 60.0 * off * self.blur

    leap, blur = np.linalg.qr(np.random.default_rng(21).normal(size=(40, 2)))[0].T


def coupling(readouts):
    parameter = next(iter(candidates_of("frame_coupling"))).parameters[0]
    tau = ("readout.frame_coupling.tau_us", 300.0)
    return Candidate("frame_coupling", (parameter,), ((0.03,), (-0.03,)), (tau,), readouts=readouts)


def candidates_of(name):
    return [one for one in library(Config(), HINTS) if one.name == name]


def best_with_leaps(readouts):
    """Return the best model with leaps on top of an exposure that is a little off."""
    (blur,) = candidates_of("exposure_blur")
    truth = ["frames.exposure_us=15000", "readout.frame_coupling.amplitude=0.05", TAU]
    sampler = Leaps()
    observed = sampler.measure(load_config([], truth), RECORDING)
    search = search_of(sampler, observed, Config(), [coupling(readouts), blur])
    fit = Fitted(blur, Config(), np.array(blur.scaled((15_500.0,))))
    state = search.reference.state(fit.config, (fit,))
    trial = max(shortlisted(search.reference, state, search.candidates), key=lambda one: one.score)
    return with_more(search.reference, state, [trial], [state])


TAU = "readout.frame_coupling.tau_us=300"


def test_leaps_are_looked_for_with_the_exposure_that_ends_there():
    found = best_with_leaps(Readouts(1500.0, INTERVAL_US))
    assert not found.objections
    assert found.state.config.frames.exposure_us == pytest.approx(15_000.0, rel=0.002)
    assert found.state.config.readout.frame_coupling.amplitude == pytest.approx(0.05, rel=0.05)
    assert found.state.fits[0].config.frames.exposure_us == pytest.approx(15_000.0, rel=0.002)
    alone = best_with_leaps(None)
    assert alone.objections or alone.validated < found.validated - 20.0


def test_an_exposure_that_is_declared_is_held():
    declared = load_config([], ["frames.exposure_us=15500"])
    sampler = Leaps()
    observed = sampler.measure(load_config([], ["frames.exposure_us=15000"]), RECORDING)
    leaps = coupling(Readouts(1500.0, INTERVAL_US))
    search = search_of(sampler, observed, declared, [leaps])
    trials = shortlisted(search.reference, search.declared, search.candidates)
    assert [trial.fit.base for trial in trials] == [declared]

"""Causes of events on their way through the effects, and of what effects of one's own add."""

import numpy as np
import pytest

from adv2e import load_config, simulate
from adv2e.causes import (
    CAUSE_BITS,
    CAUSED_DTYPE,
    CAUSES,
    FRAME_COUPLING,
    OWN_EFFECT,
    SIGNAL,
    has_causes,
    label,
    with_cause,
    without_causes,
)
from adv2e.effects.hooks import Hooks
from adv2e.errors import ConfigError, DataError
from adv2e.events import EVENT_DTYPE, make_events, sort_events

COLUMNS, ROWS = 24, 16
TIMES = np.arange(30) / 300
NOISY = (
    "pixel.shot_noise.rate_hz=30",
    "pixel.leak={rate_hz: 15, jitter: 0.1}",
    "pixel.hot_pixels={fraction: 0.05, rate_hz: 200}",
)


def frames():
    y, x = np.mgrid[:ROWS, :COLUMNS]
    return [90 + 70 * np.sin(0.4 * (x + y) - 12 * t) for t in TIMES]


def seen(*sets, effects=(), causes=True, seed=2, **options):
    config = load_config([], [*NOISY, "frames.full_scale=255", *sets], seed)
    run = simulate(frames(), TIMES, config, effects=effects, causes=causes, threads=1, **options)
    return np.concatenate(list(run))


def same(caused, plain):
    return all(np.array_equal(caused[name], plain[name]) for name in EVENT_DTYPE.names)


def test_numbers_and_names():
    assert len(CAUSES) == len(set(CAUSES)) <= 1 << CAUSE_BITS
    assert CAUSES[SIGNAL] == "signal"
    assert CAUSES[FRAME_COUPLING] == "frame_coupling"
    assert CAUSES[OWN_EFFECT] == "own_effect"


def test_helpers_of_the_table():
    plain = make_events([1, 2], [3, 4], [5, 6], [1, 0])
    caused = with_cause(plain, OWN_EFFECT)
    assert caused.dtype == CAUSED_DTYPE
    assert same(caused, plain)
    assert set(caused["cause"]) == {OWN_EFFECT}
    label(caused, SIGNAL)
    label(plain, OWN_EFFECT)  # has none to change
    assert set(caused["cause"]) == {SIGNAL}
    assert without_causes(plain) is plain
    assert np.array_equal(without_causes(caused), plain)
    assert (has_causes(plain), has_causes(caused)) == (False, True)


def test_ties_of_a_pixel_stay_as_they_are_with_their_causes():
    tied = with_cause(make_events([1] * 4, [0] * 4, [0] * 4, [1, 1, 0, 1]), np.array([3, 1, 2, 0]))
    assert sort_events(tied)["cause"].tolist() == [3, 1, 2, 0]


READOUTS = {
    "none": (),
    "arbiter": ("readout.arbiter={event_ns: 3000, row_ns: 20000}",),
    "tick": ("readout.tick_us=1000",),
    "loss, dead": ("readout.loss.fraction=0.3", "pixel.dead_pixels.fraction=0.2"),
    "all": ("readout.arbiter={event_ns: 900, row_ns: 9000}", "readout.loss.fraction=0.1"),
}


@pytest.mark.parametrize("readout", READOUTS)
def test_the_readout_sends_the_same_events_and_they_keep_their_causes(readout):
    sets = READOUTS[readout]
    plain, caused = seen(*sets, causes=False), seen(*sets)
    assert plain.dtype == EVENT_DTYPE
    assert caused.dtype == CAUSED_DTYPE
    assert same(caused, plain)
    # of each cause, at each pixel, no more than the pixels sent
    before, after = (
        np.bincount((e["y"] * COLUMNS + e["x"].astype(int)) * 8 + e["cause"], minlength=8 * 384)
        for e in (seen(), caused)
    )
    assert np.all(after <= before)
    counts = after.reshape(-1, 8).sum(axis=0)
    assert np.all(counts[[0, 1, 2, 4]] > 20)
    assert counts.sum() == len(caused)


def test_nothing_at_all_has_causes_too():
    still = [np.full((2, 3), 50.0)] * 3
    quiet = ["pixel.leak=null", "pixel.shot_noise=null", "readout.arbiter={event_ns: 1, row_ns: 1}"]
    config = load_config([], [*quiet, "frames.full_scale=255"])
    made = np.concatenate(list(simulate(still, 100, config, causes=True)))
    assert made.dtype == CAUSED_DTYPE
    assert not made.size


class Twice(Hooks):
    """Some events come a second time."""

    stage = "readout"

    def events(self, chunks):
        for events in chunks:
            again = events[::3].copy()
            label(again, OWN_EFFECT)
            yield sort_events(np.concatenate([events, again]))


class Made(Hooks):
    """Events of which nothing is known but what they are."""

    stage = "readout"

    def events(self, chunks):
        for events in chunks:
            yield make_events(*(events[name] for name in ("t", "x", "y", "p")))


class Push(Hooks):
    """Moves the signal up and down."""

    def signal(self, times_s):
        return 0.3 * np.sin(2 * np.pi * 200 * times_s)


def test_an_effect_of_ones_own_labels_what_it_adds():
    plain, caused = seen(effects=[Twice()], causes=False), seen(effects=[Twice()])
    assert same(caused, plain)
    assert np.sum(caused["cause"] == OWN_EFFECT) == pytest.approx(len(caused) / 4, abs=30)


def test_what_it_returns_without_a_cause_is_its_own():
    caused = seen(effects=[Made()])
    assert same(caused, seen(effects=[Made()], causes=False))
    assert set(caused["cause"]) == {OWN_EFFECT}


def test_what_it_adds_to_the_signal_is_its_own_and_frames_are_theirs():
    coupling = "readout.frame_coupling={amplitude: 0.3, tau_us: 400}"
    own, frame = seen(effects=[Push()])["cause"], seen(coupling)["cause"]
    assert np.sum(own == OWN_EFFECT) > 500
    assert FRAME_COUPLING not in own
    assert np.sum(frame == FRAME_COUPLING) > 500
    assert OWN_EFFECT not in frame
    with pytest.raises(
        ConfigError, match=r"frame_coupling and the effect push both add to the sig"
    ):
        seen(coupling, effects=[Push()])
    assert len(seen(coupling, effects=[Push()], causes=False)) > 1000


def test_other_arrays_are_refused_as_before():
    class Wrong(Hooks):
        stage = "readout"

        def events(self, chunks):
            for events in chunks:
                yield events[["t", "x"]]

    for causes in (False, True):
        with pytest.raises(DataError, match="must yield arrays of EVENT_DTYPE"):
            seen(effects=[Wrong()], causes=causes)


@pytest.mark.parametrize("causes", [False, True])
def test_frames_minutes_apart(causes):
    """Parts of a call are cut before their times grow out of a packed event."""
    light = [np.full((1, 2), dn) for dn in (20.0, 40.0, 30.0, 60.0) * 8]
    sets = ["frames.full_scale=255", "pixel.leak=null", "pixel.shot_noise=null"]
    config = load_config([], [*sets, "pixel.thresholds.mismatch=0", "sampling.L=1"])
    with pytest.warns(UserWarning, match="second frame comes 950 s after"):
        made = np.concatenate(list(simulate(light, 950.0 * np.arange(32), config, causes=causes)))
    assert made["t"][-1] > 29_000 * 10**6
    assert np.all(np.diff(made["t"]) >= 0)
    assert made.size > 100

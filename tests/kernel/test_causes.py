"""Causes of events: the rule, against the slow twin; what is promised; all else as without.

The twin keeps the light, the leak and the noise of each pixel since its reset, each by itself.
"""

from dataclasses import replace

import numpy as np
import pytest
from harness import (
    EVERYTHING,
    IN_LANES,
    STEPPED_FORM,
    advance,
    clock,
    effect,
    first_draws,
    moving_light,
    quiet,
    start,
)
from reference.agreement import count_and_time_errors, split_by_pixel
from reference.circuit import Circuit, Draws, merge_injected
from reference.twin import corner_of, light_of, log_of, moves_of_twin
from test_twin import hot_times, shot_candidates

from adv2e.causes import (
    CAUSED_DTYPE,
    CAUSES,
    FRAME_COUPLING,
    HOT_PIXEL,
    LEAK,
    OWN_EFFECT,
    PHOTORECEPTOR_NOISE,
    SHOT_NOISE,
    SIGNAL,
)
from adv2e.config.model import (
    HotPixels,
    Leak,
    LogResponse,
    LowPass,
    PhotoreceptorNoise,
    Refractory,
    ResetOvershoot,
    ShotNoise,
    SourceFollower,
    Thresholds,
)
from adv2e.effects.hooks import INJECTED_DTYPE
from adv2e.errors import DataError
from adv2e.events import EVENT_DTYPE
from adv2e.kernel import per_pixel, rng
from adv2e.pixel.steps import steps_of

SEED = 9
BY_ITSELF = (SHOT_NOISE, HOT_PIXEL)


def caused(light, times, pixel, *, begin=None, **options):
    """Return the events of each pixel, (events, 2), and their causes."""
    times_ns = [round(float(t) * 1e9) for t in times]
    run = {key: options.pop(key) for key in ("chunk", "threads") if key in options}
    array = start(light, times_ns, pixel, exact_times=True, causes=True, **options)
    if begin is not None:
        begin(array)
    events, exact = advance(array, light, times_ns, **run)
    assert events.dtype == CAUSED_DTYPE
    index = events["y"].astype(np.int64) * array.columns + events["x"]
    at = (exact + array.origin_us) * 1e-6
    found = split_by_pixel(at, index, events["p"], array.pixels)
    return found, [events["cause"][index == i] for i in range(array.pixels)]


def by_moves(events, moves, other=PHOTORECEPTOR_NOISE):
    """Return the causes of a pixel's events that its moves mean, -1 for injected ones.

    Also which of them are so clear that the last digits of the moves do not count.
    """
    ways = events[:, 1:] * moves
    ordered = np.sort(ways, axis=1)
    causes = np.array([SIGNAL, LEAK, other])[np.argmax(np.nan_to_num(ways), axis=1)]
    clear = ~(ordered[:, -1] - ordered[:, -2] < 2e-3)
    return np.where(np.isnan(moves[:, 0]), -1, causes), clear


def check(found, causes, twin, moves, *, within_us, other=PHOTORECEPTOR_NOISE, touching=0):
    """Hold the events and causes of all pixels to the twin's; return how often each cause came.

    `touching` pixels may have other events: a peak that just touches a threshold decides.
    """
    counts = np.zeros(len(CAUSES), int)
    unclear = differ = 0
    for ours, events, now, theirs in zip(found, twin, causes, moves, strict=True):
        agreement = count_and_time_errors([ours], [events])
        if agreement.differing or agreement.max_dt_us > within_us:
            differ += 1
            continue
        expected, clear = by_moves(events, theirs, other)
        injected = expected == -1
        assert np.isin(now[injected], BY_ITSELF).all()
        assert np.array_equal(now[clear & ~injected], expected[clear & ~injected])
        counts += np.bincount(now, minlength=len(CAUSES))
        unclear += np.sum(~clear)
    assert differ <= touching
    assert unclear < 0.05 * counts.sum()
    assert counts[[SIGNAL, LEAK]].min() > 10
    return counts


# ------------------------------------------------------------------------------------ the exact way


@pytest.mark.parametrize("dead_us", [None, 800.0])
@pytest.mark.parametrize("first", ["settled", "running"])
@pytest.mark.thorough
def test_leak_and_noise_events(first, dead_us):
    knots, pixels, jitter = 13, 60, 0.2
    light = moving_light(knots, pixels, seed=6, step=0.15)
    light[5:10, :20] = light[5, :20]
    times = clock(knots, 1 / 240)
    pixel = quiet(
        refractory=Refractory(period_us=dead_us) if dead_us else None,
        leak=Leak(rate_hz=60, photo_rate_hz=40, jitter=jitter),
        shot_noise=ShotNoise(rate_hz=30),
        hot_pixels=HotPixels(fraction=0.3, rate_hz=100),
        initial_reference=first,
    )
    shot = [shot_candidates(i, 30.0, SEED, times[-1]) for i in range(pixels)]
    hot = [hot_times(i, 0.3, 100.0, SEED, times[-1]) for i in range(pixels)]
    normals = rng.normal
    factors = [
        1 / (1 + jitter * np.clip([normals(SEED, rng.LEAK_PERIOD, i, k) for k in range(80)], -3, 3))
        for i in range(pixels)
    ]
    draws = Draws(injected=merge_injected(shot, hot), leak_factors=factors)
    taken = []

    def begin(array):
        given = first_draws(array, draws.leak_factors)
        taken.append(replace(given, injected=draws.injected))

    solved = [
        caused(light, times, pixel, begin=begin, seed=SEED, method=method)
        for method in ("auto", "stepped")
    ]
    circuit = Circuit(dead_time_us=dead_us, leak_hz=60.0, photo_leak_hz=40.0)
    twin, moves = moves_of_twin(light, times, circuit, taken[0], step_us=8.0)
    for found, causes in solved:
        counts = check(found, causes, twin, moves, within_us=3.0)
        assert counts[SHOT_NOISE] > 20
        assert counts[HOT_PIXEL] > 30
        # hot ones come in hot pixels alone
        for i, now in enumerate(causes):
            assert len(hot[i]) or HOT_PIXEL not in now


@pytest.mark.parametrize("dead_us", [None, 700.0])
@pytest.mark.parametrize("overshoot", [0.0, 0.4, -0.4])
@pytest.mark.parametrize("share", [0.3, 0.45, 0.55, 0.8])
def test_a_ramp_and_leak_share_the_way(share, overshoot, dead_us):
    """Light rises and the reference falls, both evenly: the faster of them is the cause."""
    speed, knots = 40.0, 21
    times = np.arange(knots) / 100
    light = 4.0 * np.exp(speed * (1 - share) * times / 2)[:, None]
    pixel = quiet(
        log_response=LogResponse(linear_below=0),
        low_pass=None if overshoot else LowPass(cutoff_hz=9e3, dark_cutoff_hz=9e3),
        leak=Leak(rate_hz=speed * share / 2 / 0.2, jitter=0.0),
        reset_overshoot=ResetOvershoot(fraction=overshoot) if overshoot else None,
        refractory=Refractory(period_us=dead_us) if dead_us else None,
    )
    found, (causes,) = caused(light, times, pixel)
    assert len(causes) > 12
    assert np.all(found[0][:, 1] > 0)
    assert set(causes) == {LEAK if share > 0.5 else SIGNAL}


def test_at_rest_only_leak_fires_and_under_random_references_the_light_has_moved():
    rest = np.full((30, 50), 90.0)
    times = np.arange(30) / 60
    leaking = quiet(leak=Leak(rate_hz=15.0, jitter=0.1))
    for first in ("settled", "running"):
        causes = caused(rest, times, replace(leaking, initial_reference=first))[1]
        assert set(np.concatenate(causes)) == {LEAK}
    # the light of before counts: what is left to leak is less than half in half of the pixels
    drawn = replace(leaking, initial_reference="random")
    found, causes = caused(rest, times, drawn, seed=3)
    first = np.array([now[0] for now in causes])
    waited = np.array([events[0, 0] for events in found])
    assert np.array_equal(first == SIGNAL, waited < 0.5 / 15.0)
    assert 10 < np.sum(first == SIGNAL) < 40
    assert set(np.concatenate([now[1:] for now in causes])) == {LEAK}


# --------------------------------------------------------------------------------- in steps of time


def noise_path(light, times, steps, rms, pixel):
    """Return the noise of a pixel at the ends of its steps, from the draws of the package."""
    per_interval = steps[0]
    count = sum(steps)
    draws = np.empty((count + 3) // 4 * 4)
    out = np.empty((4, 16))
    for block in range(draws.size // 4):
        rng.normals_of_four(rng.key_of(SEED), rng.PHOTORECEPTOR_STEPS, pixel, 1, block, out)
        draws[4 * block : 4 * block + 4] = out[:, 0]
    x, at = log_of(light[:, pixel], Circuit()), np.linspace(0, 1, per_interval + 1)
    now = rms * rng.normal(SEED, rng.PHOTORECEPTOR, pixel, 0)
    ends, values = [times[0]], [now]
    for k in range(len(times) - 1):
        h = (times[k + 1] - times[k]) / per_interval
        for j in range(per_interval):
            inside = x[k] + (x[k + 1] - x[k]) * np.linspace(at[j], at[j + 1], 21)
            corner = corner_of(light_of(inside, Circuit()), Circuit())
            decay = np.exp(-np.trapezoid(corner, dx=h / 20))
            now = decay * now + rms * np.sqrt(1 - decay**2) * draws[k * per_interval + j]
            ends.append(times[k] + (j + 1) * h)
            values.append(now)
    return np.array(ends), np.array(values)


@pytest.mark.parametrize("follower_hz", [None, 250.0])
@pytest.mark.parametrize("dead_us", [None, 800.0])
@pytest.mark.quick_cases(1)
def test_photoreceptor_noise_beside_light_and_leak(dead_us, follower_hz):
    knots, pixels, rms = 11, 12, 0.09
    light = moving_light(knots, pixels, seed=2, step=0.1)
    times = clock(knots, 1 / 100)
    pixel = quiet(
        refractory=Refractory(period_us=dead_us) if dead_us else None,
        source_follower=SourceFollower(cutoff_hz=follower_hz) if follower_hz else None,
        leak=Leak(rate_hz=40, photo_rate_hz=0, jitter=0.0),
        photoreceptor_noise=PhotoreceptorNoise(rms=rms, step=0.4),
    )
    taken, steps = [], []

    def begin(array):
        taken.append(first_draws(array))
        steps.extend([steps_of(1e4, array.circuit)] * (knots - 1))
        if follower_hz:  # the twin's second pole begins without noise
            array.state[per_pixel.SECOND] -= array.state[per_pixel.SEEN]
            array.state[per_pixel.REFERENCE] -= array.state[per_pixel.SEEN]
            array.state[per_pixel.SEEN] = 0.0
            array.state[per_pixel.RESET] = array.state[per_pixel.REFERENCE]
            array.state[per_pixel.RESET_NOISE] = 0.0

    found, causes = caused(light, times, pixel, begin=begin, seed=SEED, chunk=3, method="stepped")
    paths = [noise_path(light, times, steps, rms, i) for i in range(pixels)]
    draws = Draws(signal_noise=paths)
    circuit = Circuit(dead_time_us=dead_us, leak_hz=40.0, follower_hz=follower_hz)
    step_us = 1e4 / steps[0] / -(-100 // steps[0]) * (1 + 1e-9)
    twin, moves = moves_of_twin(light, times, circuit, draws, step_us=step_us)
    counts = check(found, causes, twin, moves, within_us=50.0, touching=3)
    assert counts[PHOTORECEPTOR_NOISE] > 20


@pytest.mark.parametrize(("dead_us", "cause"), [(None, FRAME_COUPLING), (800.0, OWN_EFFECT)])
@pytest.mark.quick_cases(1)
def test_what_is_added_to_the_signal(dead_us, cause):
    knots, pixels = 9, 24
    light = moving_light(knots, pixels, seed=8, step=0.2)
    times = clock(knots, 1 / 100)
    saw = np.arange(knots * 10) / 1000, np.tile([0.0, 0.24, 0.1, 0.05, 0.0], knots * 2)
    whose = "adv2e.effects" if cause == FRAME_COUPLING else "mine"
    added = effect((1, pixels), 50.0, whose, signal=lambda t: np.interp(t, *saw))
    pixel = quiet(
        refractory=Refractory(period_us=dead_us) if dead_us else None,
        leak=Leak(rate_hz=30, photo_rate_hz=30, jitter=0.0),
    )
    found, causes = caused(light, times, pixel, hooks=[added])
    draws = Draws(signal_noise=[saw] * pixels)
    circuit = Circuit(dead_time_us=dead_us, leak_hz=30.0, photo_leak_hz=30.0)
    twin, moves = moves_of_twin(light, times, circuit, draws, step_us=20.0)
    counts = check(found, causes, twin, moves, within_us=10.0, other=cause, touching=5)
    assert counts[cause] > 50


def test_injected_events_are_the_user_s_own():
    rows = np.zeros(3, INJECTED_DTYPE)
    rows["t"], rows["x"], rows["p"] = [0.004, 0.011, 0.013], [0, 1, 1], [1, 0, 1]

    def inject(t0, t1):
        return rows[(rows["t"] >= t0) & (rows["t"] < t1)]

    hooks = [effect((1, 2), inject=inject)]
    found, causes = caused(np.full((3, 2), 60.0), [0.0, 0.01, 0.02], quiet(), hooks=hooks)
    assert [now.tolist() for now in causes] == [[OWN_EFFECT], [OWN_EFFECT] * 2]
    assert [len(events) for events in found] == [1, 2]


# ----------------------------------------------------------------------------------------- promises


@pytest.mark.parametrize("dead_us", [None, 500.0])
@pytest.mark.parametrize("jitter", [0.0, 0.2])
@pytest.mark.parametrize("method", ["auto", "stepped"])
def test_until_its_first_noise_event_a_pixel_has_the_events_of_a_run_without_noise(
    method, jitter, dead_us
):
    knots, pixels = 31, 400
    light = moving_light(knots, pixels, seed=5, step=0.15)
    light[10:16, ::3] = light[10, ::3]
    times = clock(knots, 1 / 240)
    still = quiet(
        refractory=Refractory(period_us=dead_us) if dead_us else None,
        thresholds=Thresholds(mismatch=0.03),
        leak=Leak(rate_hz=10, photo_rate_hz=20, jitter=jitter),
    )
    noisy = replace(
        still, shot_noise=ShotNoise(rate_hz=8), hot_pixels=HotPixels(fraction=0.1, rate_hz=60)
    )
    with_noise = caused(light, times, noisy, seed=SEED, method=method)
    without = caused(light, times, still, seed=SEED, method=method)
    spared = later = differ = 0
    for ours, causes, theirs, expected in zip(*with_noise, *without, strict=True):
        by_itself = np.flatnonzero(np.isin(causes, BY_ITSELF))
        before = by_itself[0] if by_itself.size else len(causes)
        first_us = np.inf if not by_itself.size else np.floor(ours[before, 0] * 1e6 + 0.5)
        stamps = np.floor(theirs[:, 0] * 1e6 + 0.5)
        sooner = np.sum(stamps < first_us)
        # as many, or one on the very microsecond of the noise
        assert before - sooner == np.sum(np.floor(ours[:before, 0] * 1e6 + 0.5) >= first_us)
        count = min(before, sooner)
        assert np.array_equal(ours[:count, 1], theirs[:count, 1])
        assert np.array_equal(causes[:count], expected[:count])
        assert np.all(np.abs(ours[:count, 0] - theirs[:count, 0]) < 0.01e-6)
        spared += not by_itself.size
        later += by_itself.size > 0
        differ += by_itself.size > 0 and len(theirs) > count and len(causes) > count + 1
        assert not np.isin(expected, BY_ITSELF).any()
    assert min(spared, later, differ) > 50


def test_the_run_without_noise_is_the_twin_s_too():
    """The events up to the first one of noise are those of a solver that knows of no noise."""
    knots, pixels = 13, 100
    light = moving_light(knots, pixels, seed=3, step=0.25)
    times = clock(knots, 1 / 240)
    pixel = quiet(
        refractory=Refractory(period_us=600.0),
        leak=Leak(rate_hz=10, photo_rate_hz=20, jitter=0.0),
        shot_noise=ShotNoise(rate_hz=15),
    )
    found, causes = caused(light, times, pixel, seed=SEED)
    circuit = Circuit(dead_time_us=600.0, leak_hz=10.0, photo_leak_hz=20.0)
    twin, moves = moves_of_twin(light, times, circuit, step_us=8.0)
    compared = 0
    for ours, now, theirs, way in zip(found, causes, twin, moves, strict=True):
        noise = np.flatnonzero(now == SHOT_NOISE)
        until = ours[noise[0], 0] if noise.size else np.inf
        expected, clear = by_moves(theirs, way)
        before = theirs[:, 0] < until
        assert np.sum(before) == (noise[0] if noise.size else len(now))
        count = np.sum(before)
        assert np.array_equal(ours[:count, 1], theirs[before, 1])
        assert np.all(np.abs(ours[:count, 0] - theirs[before, 0]) < 3e-6)
        assert np.array_equal(now[:count][clear[before]], expected[before][clear[before]])
        compared += count
    assert compared > 300


# ----------------------------------------------------------------------------- nothing else changes


def clip():
    draw = np.random.default_rng(1)
    y, x = np.mgrid[:40, :70]
    light = [
        60 + 55 * np.sin(0.35 * (x - 1.3 * k)) * np.cos(0.2 * y) + draw.normal(0, 0.5, y.shape)
        for k in range(15)
    ]
    stack = np.clip(light, 0, 255).astype(np.float32)
    stack[6:12, :, 35:] = stack[6, :, 35:]
    return stack


@pytest.mark.parametrize(
    "sections", [IN_LANES, EVERYTHING, STEPPED_FORM], ids=["exact", "all", "K"]
)
def test_events_are_those_without_causes_however_the_work_is_divided(sections):
    light = clip()
    # between two microseconds: whoever puts parts together sorts those that two of them share
    times_ns = [round(k / 240 * 1e6) * 1000 + 500 for k in range(len(light))]
    plain, _ = advance(start(light, times_ns, quiet(**sections), seed=4), light, times_ns)
    assert plain.dtype == EVENT_DTYPE
    found = []
    for options, run in (({}, {}), ({"tile": 512}, {"chunk": 2, "threads": 3})):
        array = start(light, times_ns, quiet(**sections), seed=4, causes=True, **options)
        found.append(advance(array, light, times_ns, **run)[0])
    assert np.array_equal(*found)
    for name in EVENT_DTYPE.names:
        assert np.array_equal(found[0][name], plain[name])
    assert len(set(found[0]["cause"])) >= 3


def test_without_causes_nothing_more_is_kept():
    light = clip()
    times_ns = [round(k / 240 * 1e9) for k in range(len(light))]
    array = start(light, times_ns, quiet(**EVERYTHING), seed=4)
    advance(array, light, times_ns)
    rows = (
        per_pixel.RESET,
        per_pixel.RESET_LIGHT,
        per_pixel.RESET_NOISE,
        per_pixel.RESET_ADDED,
    )
    assert not np.any(array.state[list(rows)])


def test_a_span_that_causes_leave_no_bits_for_is_refused():
    light = np.full((2, 1, 1), 20.0, np.float32)
    times_ns = [0, 2200 * 10**9]
    assert len(advance(start(light, times_ns, quiet()), light, times_ns)[0]) == 0
    with pytest.raises(DataError, match="2200 s between frames: too long"):
        advance(start(light, times_ns, quiet(), causes=True), light, times_ns)


def test_times_at_the_end_of_the_longest_span():
    light = np.array([[[20.0, 30.0]], [[50.0, 25.0]]], np.float32)
    times_ns = [7_000, 2147 * 10**9]
    pixel = quiet(low_pass=LowPass(), thresholds=Thresholds(on=0.2, off=0.1, mismatch=0.0))
    plain, _ = advance(start(light, times_ns, pixel), light, times_ns)
    found, _ = advance(start(light, times_ns, pixel, causes=True), light, times_ns)
    assert found["t"].max() > 1000 * 10**6
    assert all(np.array_equal(found[name], plain[name]) for name in EVENT_DTYPE.names)

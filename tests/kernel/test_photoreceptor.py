"""Photoreceptor noise without steps of time: its moments, its bridges, and the events it makes."""

import math

import numpy as np
import pytest
from harness import EVERYTHING, advance, quiet, solve, start
from reference.agreement import count_and_time_errors
from reference.differences import STEP_S, Truth
from scipy import interpolate, linalg

from adv2e import Config, simulate
from adv2e.causes import LEAK, PHOTORECEPTOR_NOISE
from adv2e.config.model import (
    Frames,
    Leak,
    PhotoreceptorNoise,
    Pixel,
    Refractory,
    ResetOvershoot,
    Sampling,
    SourceFollower,
    Thresholds,
)
from adv2e.effects.hooks import LONGEST_US
from adv2e.kernel import per_pixel, rng
from adv2e.kernel.cascade.plan import plan_for
from adv2e.kernel.photoreceptor import law
from adv2e.kernel.photoreceptor.strip import BLOCKS
from adv2e.kernel.quadrature import rounded
from adv2e.kernel.work_queue import STRIP
from adv2e.pixel.state import make_circuit

RAD_US = 2 * math.pi * 1e-6


def transition(w, b, h):
    """Matrix and covariance of (n, s) over h for rms 1: matrix exponential and Lyapunov."""
    drift = np.array([[-w, 0.0], [b, -b]]) if b else np.array([[-w]])
    spread = np.zeros_like(drift)
    spread[0, 0] = 2.0 * w
    stationary = linalg.solve_continuous_lyapunov(drift, -spread)
    matrix = linalg.expm(drift * h)
    return matrix, stationary - matrix @ stationary @ matrix.T


def between(w, b, h, t):
    """Weights of both ends, and covariance, of (n, s) at share t between two samples h apart."""
    (first, spread), (rest, _), (whole, spread_all) = (
        transition(w, b, part * h) for part in (t, 1 - t, 1.0)
    )
    gain = spread @ rest.T @ np.linalg.inv(spread_all)
    return first - gain @ whole, gain, spread - gain @ rest @ spread


CORNERS = [(1e-4, 1e-3), (2e-3, 2e-3), (2e-3, 1.999e-3), (5e-3, 2e-4), (0.01, 0.05)]


@pytest.mark.parametrize(("w", "b"), CORNERS)
@pytest.mark.parametrize("h", [100.0, 1000.0])
def test_moments_are_those_of_the_equation(w, b, h):
    step = law.step_over(np.array([h]), np.array([w]), b)
    matrix, spread = transition(w, b, h)
    values = [float(part[0]) for part in step]
    expected = [
        matrix[0, 0], matrix[1, 0], matrix[1, 1], spread[0, 0], spread[0, 1], spread[1, 1],
    ]  # fmt: skip
    np.testing.assert_allclose(values, expected, rtol=1e-7, atol=1e-12)


def tables(rms=0.05, follower_hz=300.0, length=4000.0, step=0.1, level=0.2, white=300.0):
    noise = law.NoiseTerms(
        21.8 * RAD_US, white * RAD_US, follower_hz * RAD_US, rms,
        min(step / (white * RAD_US), LONGEST_US), level,
    )  # fmt: skip
    found = law.laws_for((length,), noise)
    corners = (np.arange(found.levels.shape[1]) + found.lowest) << law.SHIFT
    corners = (corners + (1 << (law.SHIFT - 1))).astype(np.int32).view(np.float32).astype(float)
    return noise, found, corners, found.samples[0], found.levels[0]


@pytest.mark.parametrize("follower_hz", [0.0, 60.0, 300.0, 5000.0])
@pytest.mark.quick_cases(1)
def test_bridges_stay_within_their_bounds(follower_hz):
    """Of fifty thousand bridges of each corner none leaves its bounds."""
    # behind one pole, cells must be as short as white moves: only weak noise leaves some between
    noise, found, corners, samples, levels = tables(0.05 if follower_hz else 0.01, follower_hz)
    draw = np.random.default_rng(2)
    b, looked_at = noise.follower, 0
    for entry in range(0, corners.size, 90):
        w, cells = corners[entry], 1 << levels[entry]
        row = dict(zip(range(law.COARSE), found.coarse[0, entry].tolist(), strict=True))
        h = 4000.0 / samples
        parts = int(min(max(cells, 2), 24))
        share = b / (w + b) if b else 1.0
        stationary = np.array([[1.0, share], [share, share]]) if b else np.eye(1)
        matrix, spread = transition(w, b, h / parts)
        root = np.linalg.cholesky(spread)
        now = noise.rms * draw.normal(size=(50_000, len(root))) @ np.linalg.cholesky(stationary).T
        seen, first = [now[:, -1]], now
        for _ in range(parts):
            now = now @ matrix.T + noise.rms * draw.normal(size=now.shape) @ root.T
            seen.append(now[:, -1])
        s0, s1 = seen[0], seen[-1]
        v0, v1 = first[:, 0] - s0, now[:, 0] - s1
        bend, pull, reach = row[law.BEND], row[law.PULL], row[law.REACH]
        high, low = np.maximum(s0, s1), np.minimum(s0, s1)
        high = np.where(high > 0, high, high * (1 - pull))
        low = np.where(low < 0, low, low * (1 - pull))
        high = high + bend * (np.maximum(v0, 0) + np.maximum(-v1, 0)) + reach
        low = low - bend * (np.maximum(-v0, 0) + np.maximum(v1, 0)) - reach
        if cells == 1:  # nothing is drawn between
            continue
        looked_at += 1
        assert (np.max(seen, axis=0) <= high).all()
        assert (np.min(seen, axis=0) >= low).all()
        assert reach <= 6.01 * noise.rms * math.sqrt(share)
    assert looked_at > 1


@pytest.mark.parametrize("follower_hz", [0.0, 60.0, 300.0, 5000.0])
def test_halves_are_those_of_the_bridge(follower_hz):
    """The middle of 2, 4, 8 ... cells: means by both ends, and covariances."""
    noise, found, corners, samples, levels = tables(0.05 if follower_hz else 0.01, follower_hz)
    b, looked_at = noise.follower, 0
    for entry in range(0, corners.size, 60):
        cell = 4000.0 / (samples << levels[entry])
        for level in range(levels[entry]):
            looked_at += 1
            table = found.fine[0, entry, level].astype(float)
            start, end, spread = between(corners[entry], b, cell * (2 << level), 0.5)
            by_n, by_n_s, by_s = table[[law.NEW_N, law.NEW_N_S, law.NEW_S]] / noise.rms
            if not b:
                assert table[law.N_OF_N0] == pytest.approx(start[0, 0], rel=1e-5)
                assert table[law.N_OF_N1] == pytest.approx(end[0, 0], rel=1e-5)
                assert by_n**2 == pytest.approx(spread[0, 0], rel=1e-4)
                continue
            of_n = table[[law.N_OF_N0, law.N_OF_S0, law.N_OF_N1, law.N_OF_S1]]
            of_s = table[[law.S_OF_N0, law.S_OF_S0, law.S_OF_N1, law.S_OF_S1]]
            np.testing.assert_allclose(of_n, [*start[0], *end[0]], rtol=1e-4, atol=2e-4)
            np.testing.assert_allclose(of_s, [*start[1], *end[1]], rtol=1e-4, atol=1e-5)
            made = [by_n**2, by_n * by_n_s, by_n_s**2 + by_s**2]
            expected = [spread[0, 0], spread[0, 1], spread[1, 1]]
            np.testing.assert_allclose(made, expected, rtol=2e-3, atol=1e-9)
    assert looked_at > 5


@pytest.mark.parametrize("follower_hz", [300.0, 5000.0])
def test_cells_behind_two_poles_leave_hardly_any_noise_out(follower_hz):
    noise, _, corners, samples, levels = tables(follower_hz=follower_hz)
    cells = samples << levels
    inner = np.flatnonzero((cells > 1) & (cells < law.MOST_CELLS))
    assert inner.size > 100
    for entry in inner[::80]:
        w = corners[entry]
        share = noise.follower / (w + noise.follower)
        variance = between(w, noise.follower, 4000.0 / cells[entry], 0.5)[2][-1, -1]
        assert math.sqrt(variance / share) < 0.02


@pytest.mark.parametrize("follower_hz", [None, 150.0])
def test_noise_stays_what_it_is_while_the_light_moves(follower_hz):
    """Variance, what both poles have in common, and how fast the past is forgotten."""
    pixels, rms, knots = 20_000, 0.05, 12
    draw = np.random.default_rng(5)
    grey = np.where(np.arange(pixels) < pixels // 2, 30.0, 220.0)
    light = grey * np.exp(0.05 * draw.normal(size=(knots, pixels)))
    light[-3:] = grey
    times = [k * 3_000_000 for k in range(knots)]
    pixel = quiet(
        photoreceptor_noise=PhotoreceptorNoise(rms=rms),
        source_follower=SourceFollower(cutoff_hz=follower_hz) if follower_hz else None,
    )
    stack = light[:, None].astype(np.float32)
    array = start(stack, times, pixel, seed=6)
    advance(array, stack[:-1], times[:-1])
    before = array.state[[per_pixel.NOISE, per_pixel.SEEN]]
    array.advance(stack[-2:], times[-2:], np.zeros(2, bool))
    after = array.state[[per_pixel.NOISE, per_pixel.SEEN]]
    for dn in (30.0, 220.0):
        these = grey == dn
        w = RAD_US * (21.8 + 278.2 * dn / 255)
        b = RAD_US * follower_hz if follower_hz else 0.0
        share = b / (w + b) if b else 1.0
        error = 4.5 * rms**2 * math.sqrt(2 / these.sum())
        both = np.cov(np.vstack([before[:, these], after[:, these]]))
        own = np.array([[1.0, share], [share, share]]) * rms**2
        np.testing.assert_allclose(both[:2, :2], own, atol=error)
        np.testing.assert_allclose(both[2:, 2:], own, atol=error)
        matrix = transition(w, b, 3000.0)[0] if b else np.eye(2) * math.exp(-w * 3000.0)
        np.testing.assert_allclose(both[2:, :2], matrix @ own, atol=error)


def drawn_path(pixel, light, interval_us, intervals, i, seed):
    """Return instants and values (n, s) of all cells of pixel i, each drawn, from the draws alone.

    The moments are those of `transition`; pieces, samples and cells those of the plan.
    """
    circuit = make_circuit(pixel, Sampling(), seed)
    fastest = circuit.dark + 255 * circuit.per_dn
    level = min(pixel.thresholds.on, pixel.thresholds.off)
    noise = law.noise_of(circuit, level, LONGEST_US)
    lengths = np.full(intervals, interval_us)
    starts = np.concatenate([[0.0], np.cumsum(lengths)])
    until, inside = np.arange(1, starts.size), np.zeros(intervals, bool)
    factors = np.ones(starts.size)
    plan = plan_for(starts, until, inside, fastest, circuit.follower, factors, False, noise)
    w = circuit.dark + circuit.per_dn * light
    entry = (int(np.float32(w).view(np.int32)) >> law.SHIFT) - plan.laws.lowest
    w = float(np.int32(((entry + plan.laws.lowest) << law.SHIFT) + 32768).view(np.float32))
    b, rms, pieces = circuit.follower, circuit.noise_rms, int(plan.pieces[0])
    size = 2 if b else 1
    now = np.zeros(size)
    now[0] = rms * rng.normal(seed, rng.PHOTORECEPTOR, i, 0)
    if b:
        exact = circuit.dark + circuit.per_dn * light
        share = b / (exact + b)
        own = rms * math.sqrt(share * (1 - share))
        now[1] = share * now[0] + own * rng.normal(seed, rng.PHOTORECEPTOR_BEHIND, i, 0)
    at, values = [0.0], [now]
    a_block = 2 if b else 4
    for piece in range(intervals * pieces):
        p = piece % pieces
        which = int(plan.law[0, p])
        m, levels = int(plan.laws.samples[which]), int(plan.laws.levels[which, entry])
        q = 1 << levels
        lasts = rounded(interval_us * (plan.ends[0, p + 1] - plan.ends[0, p]))
        matrix, spread = transition(w, b, lasts / m)
        root = rms * np.linalg.cholesky(spread)
        cell = lasts / (m * q)
        begin, end = piece // pieces + plan.ends[0, p : p + 2]
        at += (np.linspace(begin, end, m * q + 1)[1:] * interval_us).tolist()
        for c in range(m):
            block = piece * BLOCKS + c // a_block
            after = matrix @ now + root @ normals(seed, rng.PHOTORECEPTOR_SAMPLES, i, block, c, b)
            inside = {0: now, q: after}
            drawn, first = 0, piece * BLOCKS + c * ((q - 2) // a_block + 1)
            for half in (q >> level for level in range(1, levels + 1)):
                for r in range(half, q, 2 * half):
                    mine, its, rest = between(w, b, cell * 2 * half, 0.5)
                    new = normals(
                        seed, rng.PHOTORECEPTOR_BETWEEN, i, first + drawn // a_block, drawn, b
                    )
                    mean = mine @ inside[r - half] + its @ inside[r + half]
                    inside[r] = mean + rms * np.linalg.cholesky(rest) @ new
                    drawn += 1
            values += [inside[r] for r in range(1, q + 1)]
            now = after
    return np.array(at), np.array(values)


def normals(seed, stream, i, block, number, two):
    """Return the numbers of draw `number` of pixel i, which is in this block."""
    words, drawn = np.zeros((4, 1), np.uint32), np.zeros((4, 1), np.float32)
    rng.normals32_of_pixels(rng.key_of(seed), stream, np.array([i]), block, words, drawn)
    first, size = (number % 2 * 2, 2) if two else (number % 4, 1)
    return drawn[first : first + size, 0].astype(float)


@pytest.mark.thorough
@pytest.mark.parametrize("interval_us", [4000.0, 20_000.0])
@pytest.mark.parametrize("follower_hz", [None, 100.0, 1000.0])
def test_events_are_those_of_the_path_of_which_everything_is_drawn(follower_hz, interval_us):
    """At rest, with dead time: what is not drawn would have made no event."""
    # of this seed no peak of the lines is over a threshold for less than a step of the truth
    pixels, seed, rms, intervals = 12, 5, 0.12, 5
    light = np.full((intervals + 1, pixels), 80.0)
    times = np.arange(intervals + 1) * interval_us * 1e-6
    pixel = quiet(
        photoreceptor_noise=PhotoreceptorNoise(rms=rms, step=0.2),
        source_follower=SourceFollower(cutoff_hz=follower_hz) if follower_hz else None,
        refractory=Refractory(period_us=600.0),
    )
    fine = np.arange(round(times[-1] / STEP_S) + 1) * (STEP_S * 1e6)
    signal = []
    for i in range(pixels):
        at, values = drawn_path(pixel, 80.0, interval_us, intervals, i, seed)
        if follower_hz:
            slopes = RAD_US * follower_hz * (values[:, 0] - values[:, 1])
            signal.append(interpolate.CubicHermiteSpline(at, values[:, 1], slopes)(fine))
        else:
            signal.append(np.interp(fine, at, values[:, 0]))
    truth = Truth(np.stack(signal, axis=1)).events(dead_s=600e-6)
    found = count_and_time_errors(solve(light, times, pixel, seed=seed), truth)
    assert found.count_b > 5
    assert not found.differing
    assert found.max_dt_us < 1.5


@pytest.mark.parametrize("follower_hz", [None, 100.0])
def test_what_rests_is_drawn_from_frame_to_frame_whatever_lies_between(follower_hz):
    """Whole pieces of time have the noise of whole pieces, also beside what moves."""
    pixel = quiet(
        photoreceptor_noise=PhotoreceptorNoise(rms=0.12),
        source_follower=SourceFollower(cutoff_hz=follower_hz) if follower_hz else None,
    )
    frames = [np.full((96, 64), 80.0, np.float32) for _ in range(30)]
    moving = [frame.copy() for frame in frames]
    for number, frame in enumerate(moving):
        frame[:4] += 30.0 * (number % 3)  # all of its strip, and no other

    def made(images, L):
        config = Config(
            seed=3, pixel=pixel, sampling=Sampling(L=L), frames=Frames(encoding="linear")
        )
        chunks = simulate([image / 255 for image in images], fps=240, config=config)
        return np.concatenate(list(chunks))

    alone = made(frames, 1)
    assert alone.size > 1000
    assert np.array_equal(alone, made(frames, 10))
    beside, below = made(moving, 10), STRIP // 64
    assert np.array_equal(beside[beside["y"] >= below], alone[alone["y"] >= below])
    assert not np.array_equal(beside, alone)


def without(*names, **more):
    return {**{key: value for key, value in EVERYTHING.items() if key not in names}, **more}


CASES = {
    "two poles": without("photoreceptor_noise"),
    "one pole": without("photoreceptor_noise", "source_follower"),
    "no dead time": without("photoreceptor_noise", "refractory", refractory=None),
    "overshoot": without("photoreceptor_noise", reset_overshoot=ResetOvershoot(fraction=0.2)),
    "drift": without(
        "photoreceptor_noise",
        thresholds=Thresholds(on=0.2, off=0.25, mismatch=0.03, drift_per_s=2.0),
    ),
}


def moving_texture(frames=30):
    draw = np.random.default_rng(8)
    y, x = np.mgrid[:24, :40]
    stack = [
        70 + 62 * np.sin(0.4 * (x - 1.3 * k)) * np.cos(0.2 * y) + draw.normal(0, 0.5, y.shape)
        for k in range(frames)
    ]
    stack = np.clip(stack, 0, 255).astype(np.float32)
    stack[10:18, :, 20:] = stack[10, :, 20:]
    return stack, [k * 5_000_000 + (k % 3) * 1_000 for k in range(frames)]


@pytest.mark.parametrize("name", CASES)
@pytest.mark.quick_cases(1)
def test_noise_of_next_to_nothing_leaves_events_where_they_are(name):
    """Every pixel goes through the cells of its noise, and nothing but rounding moves."""
    stack, times = moving_texture()
    found = []
    for noise in (None, PhotoreceptorNoise(rms=1e-7)):
        array = start(
            stack, times,
            Pixel(**CASES[name], photoreceptor_noise=noise, initial_reference="settled"), seed=3,
            exact_times=True, method="auto" if noise else "stepped",
        )  # fmt: skip
        found.append(advance(array, stack, times))
    (quiet_events, quiet_times), (events, exact) = found
    assert len(events) > 10_000
    order, quiet_order = (
        np.lexsort((e["t"], e["p"], e["x"], e["y"])) for e in (events, quiet_events)
    )
    assert len(events) == len(quiet_events)
    for key in ("x", "y", "p"):
        assert np.array_equal(events[key][order], quiet_events[key][quiet_order])
    assert np.abs(exact[order] - quiet_times[quiet_order]).max() < 1.5


@pytest.mark.parametrize("follower_hz", [None, 400.0])
def test_causes_of_events_beside_noise(follower_hz):
    """As often by noise, by light and by leak as in steps of time; the same events as without."""
    stack, times = moving_texture(20)
    pixel = Pixel(
        photoreceptor_noise=PhotoreceptorNoise(rms=0.07), shot_noise=None,
        source_follower=SourceFollower(cutoff_hz=follower_hz) if follower_hz else None,
        leak=Leak(rate_hz=20.0), thresholds=Thresholds(on=0.2, off=0.25),
    )  # fmt: skip
    shares = {}
    for method in ("auto", "stepped"):
        array = start(stack, times, pixel, seed=2, method=method, causes=True)
        events, _ = advance(array, stack, times)
        shares[method] = np.bincount(events["cause"], minlength=8) / len(events)
        if method == "auto":
            plain, _ = advance(start(stack, times, pixel, seed=2), stack, times)
            assert np.array_equal(events[["t", "x", "y", "p"]], plain[["t", "x", "y", "p"]])
    assert shares["auto"][PHOTORECEPTOR_NOISE] > 0.05
    assert shares["auto"][LEAK] > 0.01
    np.testing.assert_allclose(shares["auto"], shares["stepped"], atol=0.015)
    still = np.repeat(stack[:1], 20, axis=0)
    alone = quiet(photoreceptor_noise=PhotoreceptorNoise(rms=0.09))
    events, _ = advance(start(still, times, alone, seed=2, causes=True), still, times)
    assert len(events) > 100
    assert (events["cause"] == PHOTORECEPTOR_NOISE).all()


@pytest.mark.parametrize("follower_hz", [None, 400.0])
@pytest.mark.quick_cases(1)
def test_as_many_events_beside_moving_light_as_in_steps_of_time(follower_hz):
    """Other draws of the same law: numbers agree within their spread over seeds, by polarity."""
    stack, times = moving_texture(20)
    pixel = Pixel(
        photoreceptor_noise=PhotoreceptorNoise(rms=0.07),
        source_follower=SourceFollower(cutoff_hz=follower_hz) if follower_hz else None,
        leak=Leak(rate_hz=5.0), thresholds=Thresholds(on=0.2, off=0.25),
    )  # fmt: skip
    counts = {}
    for method in ("auto", "stepped"):
        for seed in range(6):
            array = start(stack, times, pixel, seed=seed, method=method)
            events, _ = advance(array, stack, times)
            counts.setdefault(method, []).append([events["p"].sum(), (~events["p"]).sum()])
    ours, theirs = np.array(counts["auto"], float), np.array(counts["stepped"], float)
    assert ours.min() > 1000
    spread = np.sqrt((ours.var(0, ddof=1) + theirs.var(0, ddof=1)) / 6)
    assert (np.abs(ours.mean(0) - theirs.mean(0)) < 4.5 * spread + 0.004 * ours.mean(0)).all()


def test_a_full_buffer_changes_nothing():
    stack, times = moving_texture(20)
    pixel = Pixel(**without("photoreceptor_noise", photoreceptor_noise=PhotoreceptorNoise(rms=0.1)))
    found = []
    for room in (None, 3):
        array = start(stack, times, pixel, seed=1, threads=1)
        if room:
            worker = array._workers.get()
            worker.keys = np.empty(room, np.int64)
            array._workers.put(worker)
        found.append(array.advance(stack, times, np.zeros(len(times), bool)))
    assert len(found[0]) > 5000
    assert np.array_equal(*found)


def test_normals_of_single_precision_are_normal_and_independent():
    pixels = np.arange(10, 74)
    words, drawn = np.zeros((4, 64), np.uint32), np.zeros((500, 4, 64), np.float32)
    for block, four in enumerate(drawn):
        rng.normals32_of_pixels(
            rng.key_of(3), rng.PHOTORECEPTOR_SAMPLES, pixels, block, words, four
        )
    blocks, again = np.arange(64) % 5, np.zeros((4, 64), np.float32)
    rng.normals32_of_blocks(
        rng.key_of(3), rng.PHOTORECEPTOR_SAMPLES, pixels, blocks, 7, words, again
    )
    assert np.array_equal(again, drawn[7 + blocks, :, np.arange(64)].T)
    flat = drawn.reshape(-1, 64).astype(float)
    assert abs(flat.mean()) < 4 / math.sqrt(flat.size)
    assert flat.var() == pytest.approx(1.0, abs=4 * math.sqrt(2 / flat.size))
    assert (flat**3).mean() == pytest.approx(0.0, abs=4 * math.sqrt(15 / flat.size))
    assert (flat**4).mean() == pytest.approx(3.0, abs=4 * math.sqrt(96 / flat.size))
    for a, b in ((flat[1:], flat[:-1]), (flat[:, 1:], flat[:, :-1]), (drawn[:, 0], drawn[:, 2])):
        assert abs((a * b).mean()) < 4 / math.sqrt(a.size)

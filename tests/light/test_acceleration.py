"""Paths that bend, against scenes of which every instant is known."""

from __future__ import annotations

import numpy as np
import pytest
from flow_scenes import FIGURE, GROUND, clouds, disk, pan, pixels

from adv2e.config.model import Sampling
from adv2e.light.interpolation import make_upsampler
from adv2e.light.interpolation.linear import Beside, neighbours
from adv2e.motion.estimate import Bend, Motion, Side, bends, fastest

SHAPE = (40, 48)


def even(u, v=0.0, score=0.1):
    return Motion(*(np.full(SHAPE, value, np.float32) for value in (u, v, score)))


def parabola(t):
    """Return a pan whose columns are 1.5 + 2 (t - 0.4)^2 pixels, rows half of it."""
    way = 2.0 * (t - 0.4) ** 2
    return pan(1.0, (way, 0.5 * way))


def swung(t):
    """Return a disk that turns back at t = 0.3, over a texture at rest."""
    x, y = pixels()
    column = 40.0 - 4.0 * (t - 0.3) ** 2
    inside = np.clip(0.5 + 11.0 - np.hypot(x - column, y - 32.0), 0.0, 1.0)
    light = (1.0 - inside) * GROUND(x, y) + inside * 2.0 * FIGURE(x - column, y - 32.0)
    return light.astype(np.float32)


def made(scene, beside, L=4):
    upsampler = make_upsampler(Sampling(interpolation="flow", L=L))
    return list(upsampler.between(scene(0.0), scene(1.0), beside))


def error(light, truth, border=8):
    inner = slice(border, -border), slice(border, -border)
    return float(np.mean(np.abs(np.log(light[inner]) - np.log(truth[inner]))))


@pytest.mark.parametrize("scene", [parabola, swung])
def test_even_acceleration_is_followed(scene):
    both = Beside(scene(-1.0), scene(2.0))
    bent, straight = made(scene, both), made(scene, Beside())
    for number in range(3):
        truth = scene(0.25 * (number + 1))
        assert error(bent[number], truth) < 0.4 * error(straight[number], truth)


def test_spans_of_other_frames_count():
    bent = made(parabola, Beside(parabola(-0.5), parabola(2.5), 0.5, 1.5), L=2)[0]
    straight = made(parabola, Beside(), L=2)[0]
    assert error(bent, parabola(0.5)) < 0.4 * error(straight, parabola(0.5))


@pytest.mark.parametrize(
    "beside",
    [
        Beside(before=parabola(-1.0)),
        Beside(after=parabola(2.0)),
        Beside(parabola(-1.0), parabola(2.0), 4.0, 1.0),
        Beside(parabola(-1.0), parabola(2.0), 1.0, 0.3),
        Beside(clouds(7)(*pixels()).astype(np.float32), parabola(2.0)),
    ],
)
def test_without_both_sides_paths_are_straight(beside):
    for one, two in zip(made(parabola, beside), made(parabola, Beside()), strict=True):
        assert np.array_equal(one, two)


def test_even_motion_is_straight():
    beside = Beside(pan(-1.0), pan(2.0))
    for number, (one, two) in enumerate(zip(made(pan, beside), made(pan, Beside()), strict=True)):
        truth = pan(0.25 * (number + 1))
        assert error(one, truth) < 1.1 * error(two, truth) + 1e-4


def test_pixels_at_rest_stay_to_the_bit():
    def stopped(t):
        return disk(min(t, 0.0))

    a = stopped(0.0)
    for light in made(stopped, Beside(stopped(-1.0), disk(1.0))):
        assert np.array_equal(light, a)


def test_the_bend_is_half_the_acceleration():
    # x = 3 t + 2 t^2: by 5 from t = 0 to 1, and back by 1 to t = -1; from t = 1 by 9 to t = 2
    for bend in bends(even(5.0), even(-5.0), Side(even(-1.0), 1.0), Side(even(9.0), 1.0)):
        for share in (0.25, 0.5, 0.9):
            c, d = bend.at(share)
            np.testing.assert_allclose(c, 2.0, atol=1e-5)
            np.testing.assert_allclose(d, 0.0, atol=1e-5)


def test_the_lesser_bend_counts_and_none_where_they_disagree():
    straight, hit = Side(even(-5.0), 1.0), Side(even(-4.0, -3.0), 1.0)
    slower, faster = Side(even(4.6), 1.0), Side(even(7.0, 2.0), 1.0)
    for before, after in ((straight, hit), (hit, straight), (straight, straight)):
        for bend in bends(even(5.0), even(-5.0), before, after):
            assert not np.any(bend.at(0.3))
    first, _ = bends(even(5.0), even(-5.0), Side(even(-3.0), 1.0), faster)
    np.testing.assert_allclose(first.at(0.3)[0], 1.0, atol=1e-5)  # of 1 and (1, 1) the shorter
    for bend in bends(even(5.0), even(-5.0), Side(even(-3.0), 1.0), slower):
        assert not np.any(bend.at(0.3))  # faster before, slower after


@pytest.mark.parametrize(
    ("when", "spans"), [(0.2, (1.0, 1.0)), (0.8, (1.0, 1.0)), (0.2, (2.0, 0.5))]
)
def test_what_is_hit_moves_straight_until_then_and_from_then_on(when, spans):
    before, behind = np.array([8.0, -2.0]), np.array([-4.0, 3.0])  # pixels an interval
    way = before * when + behind * (1.0 - when)
    sides = (
        Side(even(*(-before * spans[0])), spans[0]), Side(even(*(behind * spans[1])), spans[1])
    )  # fmt: skip
    first, second = bends(even(*way), even(*-way), *sides)
    for share in (0.1, when, 0.5, 0.95):
        there = before * min(share, when) + behind * max(share - when, 0.0)
        aside = share * (1.0 - share)
        for k in range(2):
            found = share * way[k] - aside * first.at(share)[k]
            np.testing.assert_allclose(found, there[k], atol=1e-4)
            back = -(1.0 - share) * way[k] - aside * second.at(1.0 - share)[k]
            np.testing.assert_allclose(way[k] + back, there[k], atol=1e-4)


def test_a_hit_is_found_in_the_scene():
    def hit(t):
        """Return a disk that turns back at t = 0.7, over a texture at rest."""
        x, y = pixels()
        column = 40.0 + 6.0 * min(t, 0.7) - 7.0 * max(t - 0.7, 0.0)
        inside = np.clip(0.5 + 11.0 - np.hypot(x - column, y - 32.0), 0.0, 1.0)
        light = (1.0 - inside) * GROUND(x, y) + inside * 2.0 * FIGURE(x - column, y - 32.0)
        return light.astype(np.float32)

    bent, straight = made(hit, Beside(hit(-1.0), hit(2.0))), made(hit, Beside())
    for number in range(3):
        truth = hit(0.25 * (number + 1))
        assert error(bent[number], truth) < 0.6 * error(straight[number], truth)


def test_what_is_not_seen_in_both_frames_tells_nothing():
    unseen = even(-1.0, score=1000.0)
    for bend in bends(even(5.0), even(-5.0), Side(unseen, 1.0), Side(even(9.0), 1.0)):
        assert not np.any(bend.at(0.4))


def test_neighbours_of_a_sequence():
    frames = [(t, np.full((2, 2), t, np.float32)) for t in (0, 10, 30, 35)]
    found = list(neighbours(iter(frames)))
    assert [(a[0], b[0]) for a, b, _ in found] == [(0, 10), (10, 30), (30, 35)]
    assert [(one.span_before, one.span_after) for _, _, one in found] == [
        (1.0, 2.0), (0.5, 0.25), (4.0, 1.0),
    ]  # fmt: skip
    assert found[0][2].before is None
    assert found[1][2].before is frames[0][1]
    assert found[1][2].after is frames[3][1]
    assert found[2][2].after is None
    assert list(neighbours(iter(frames[:1]))) == []
    assert list(neighbours(iter([]))) == []


def test_motion_is_found_once_for_each_pair(monkeypatch):
    from adv2e.light.interpolation import flow

    asked = []

    def estimate(a, b, given):
        assert given is None
        asked.append((a[0, 0], b[0, 0]))

    monkeypatch.setattr(flow, "estimate_motion", estimate)
    frames = [(k, np.full((40, 40), k, np.float32)) for k in range(6)]
    upsampler = make_upsampler(Sampling(interpolation="flow", L=3))
    for (_, a), (_, b), beside in neighbours(iter(frames)):
        list(upsampler.between(a, b, beside))
    assert asked == [(k, k + 1) for k in range(5)]


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.quick_cases(1)
def test_no_path_is_faster_than_the_fastest(seed):
    rng = np.random.default_rng(seed)
    u, v, p, q, j, k = rng.normal(0.0, 3.0, (6, *SHAPE)).astype(np.float32)
    kind = seed % 4  # straight, even, hit, both
    none = np.zeros(SHAPE, np.float32)
    even = (p, q) if kind in (1, 3) else (none, none)
    jump = (j, k) if kind in (2, 3) else (none, none)
    bend = Bend(even, jump, rng.uniform(0.05, 0.95, SHAPE).astype(np.float32))
    motion = Motion(u, v, none)
    # the same path in small steps, as pixels are sent
    share = np.linspace(1e-4, 1 - 1e-4, 2001)
    ways = []
    for s in share:
        x, y = bend.at(s)
        ways.append((s * u - s * (1 - s) * x, s * v - s * (1 - s) * y))
    ways = np.array(ways)
    speed = np.hypot(*np.moveaxis(np.diff(ways, axis=0), 1, 0)).max() / (share[1] - share[0])
    most = fastest(motion, bend)
    assert speed <= most * 1.001
    if kind != 3:
        assert speed >= most * 0.98

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from flow_scenes import clouds, disk, pan, pixels

from adv2e import Config, simulate
from adv2e.config.model import Pixel, Sampling
from adv2e.light.interpolation import make_upsampler
from adv2e.light.interpolation.flow import warp
from adv2e.motion.estimate import SMALLEST, Motion, estimate_motion
from adv2e.motion.warping import ONE_SIDED, UNKNOWN


def made(a, b, L=4, interpolation="flow", **options):
    return list(make_upsampler(Sampling(interpolation=interpolation, L=L), **options).between(a, b))


def error(light, truth, border=6):
    """Return the mean difference of log light away from the border."""
    inner = slice(border, -border), slice(border, -border)
    return float(np.mean(np.abs(np.log(light[inner]) - np.log(truth[inner]))))


@pytest.mark.parametrize("scene", [pan, disk])
def test_frames_between_are_nearer_to_the_truth_than_linear_ones(scene):
    a, b = scene(0.0), scene(1.0)
    pairs = zip(made(a, b), made(a, b, interpolation="linear"), strict=True)
    for number, (flow, linear) in enumerate(pairs, start=1):
        if number < 4:
            truth = scene(number / 4)
            assert error(flow, truth) < 0.2 * error(linear, truth)


def test_the_last_frame_is_the_second_itself():
    a, b = pan(0.0), pan(1.0)
    frames = made(a, b, L=3)
    assert len(frames) == 3
    assert frames[-1] is b
    assert made(a, b, L=1)[0] is b


@pytest.mark.parametrize("scene", [pan, disk])
def test_frames_converge_to_both_ends(scene):
    a, b = scene(0.0), scene(1.0)
    motion = estimate_motion(a, b)
    assert error(warp(a, b, *motion, 1e-4), a) < 1e-3
    assert error(warp(a, b, *motion, 1.0 - 1e-4), b) < 1e-3


def test_equal_frames_stay_to_the_bit():
    a = pan(0.0)
    for light in made(a, a.copy()):
        assert np.array_equal(light, a)


def test_pixels_at_rest_beside_a_moving_disk_stay_to_the_bit():
    a, b = disk(0.0), disk(1.0)
    x, y = pixels()
    # 4 px for the patch that the search looks at, on either side of the way
    far = np.hypot(np.maximum(np.abs(x - 33.0) - 3.0, 0.0), y - 32.0) > 11.0 + 4.0
    assert np.array_equal(a[far], b[far])
    assert far.mean() > 0.7
    for light in made(a, b):
        assert np.array_equal(light[far], a[far])


def test_clipped_pixels_stay_to_the_bit_when_the_rest_changes_brightness():
    a = pan(0.0)
    b = 1.3 * a
    a[20:40, 30:50] = b[20:40, 30:50] = 255.0
    for light in made(a, b):
        assert np.all(light[22:38, 32:48] == 255.0)


@pytest.mark.parametrize("forwards", [True, False])
def test_ground_is_seen_until_it_is_covered_and_once_it_is_uncovered(forwards):
    # outside the disk at a quarter of its way, inside it at the end; or the same backwards
    x, y = pixels()
    band = (np.hypot(x - 31.5, y - 32.0) > 12.5) & (np.hypot(x - 36.0, y - 32.0) < 9.5)
    assert band.sum() > 10
    pair = (disk(0.0), disk(1.0)) if forwards else (disk(1.0), disk(0.0))
    number = 0 if forwards else 2
    linear, flow = (made(*pair, interpolation=i)[number] for i in ("linear", "flow"))
    truth = disk(0.25)
    assert np.abs(flow - truth)[band].mean() < 0.3 * np.abs(linear - truth)[band].mean()


def test_a_fast_small_figure_that_is_not_found_fades_as_with_linear():
    a, b = (disk(t, step=16.0, radius=6.0) for t in (0.0, 1.0))
    linear, flow = (made(a, b, L=2, interpolation=i)[0] for i in ("linear", "flow"))
    assert error(flow, linear) < 0.1 * error(linear, a)


def test_a_change_of_brightness_alone_is_linear():
    a = pan(0.0)
    b = 1.25 * a
    for flow, linear in zip(made(a, b), made(a, b, interpolation="linear"), strict=True):
        np.testing.assert_allclose(flow, linear, rtol=2e-3)


def test_motion_is_found_under_a_change_of_brightness():
    a, b, truth = pan(0.0), 2.0 * pan(1.0), 1.5 * pan(0.5)
    flow, linear = made(a, b, L=2)[0], made(a, b, L=2, interpolation="linear")[0]
    assert error(flow, truth) < 0.25 * error(linear, truth)


def test_a_cut_is_linear():
    a, b = pan(0.0), clouds(7)(*pixels()).astype(np.float32)
    for flow, linear in zip(made(a, b), made(a, b, interpolation="linear"), strict=True):
        assert np.array_equal(flow, linear)


def test_a_part_of_fine_structure_that_does_not_last_is_linear():
    wide = (96, 192)
    a, b = (pan(t, (3.0, 0.0), *wide) for t in (0.0, 1.0))
    rng = np.random.default_rng(0)
    for frame in (a, b):
        frame[:, 96:] = 80.0 * np.exp(0.4 * rng.standard_normal((96, 96)))
    linear, flow = (made(a, b, L=2, interpolation=i)[0] for i in ("linear", "flow"))
    lasting, glitter = np.s_[:, :80], np.s_[16:-16, 112:-16]
    assert np.mean(flow[glitter] == linear[glitter]) > 0.7
    truth = pan(0.5, (3.0, 0.0), *wide)[lasting]
    assert error(flow[lasting], truth) < 0.2 * error(linear[lasting], truth)


def test_what_only_the_second_frame_shows_comes_from_where_it_goes():
    a, b = np.full((40, 40), 10.0, np.float32), np.full((40, 40), 10.0, np.float32)
    b[20:23, 30:33] = 100.0
    known = np.full((40, 40), UNKNOWN, np.float32)
    still = np.zeros((40, 40), np.float32)
    there = Motion(still, still, known)
    score = known.copy()
    score[20:23, 30:33] = ONE_SIDED
    back = Motion(np.where(b > 50, np.float32(-8), still), still, score)
    light = warp(a, b, there, back, 0.25)
    assert np.argwhere(light > 50).min(axis=0).tolist() == [20, 24]
    assert np.argwhere(light > 50).max(axis=0).tolist() == [22, 26]


def test_frames_smaller_than_the_search_are_linear():
    assert SMALLEST == 32
    for rows, columns in ((16, 16), (31, 80), (80, 31), (1, 1)):
        a, b = (pan(t, rows=rows, columns=columns) for t in (0.0, 1.0))
        for flow, linear in zip(made(a, b), made(a, b, interpolation="linear"), strict=True):
            assert np.array_equal(flow, linear)


@pytest.mark.parametrize("size", [(32, 32), (32, 200), (200, 32), (33, 47)])
def test_the_smallest_frames_that_are_searched(size):
    a, b, truth = (pan(t, (2.0, 1.0), *size) for t in (0.0, 1.0, 0.5))
    flow, linear = made(a, b, L=2)[0], made(a, b, L=2, interpolation="linear")[0]
    assert error(flow, truth) < 0.5 * error(linear, truth)


def test_threads_and_order_of_pairs_change_nothing():
    a, b = disk(0.0), disk(1.0)
    before = cv2.getNumThreads()
    try:
        results = []
        upsampler = make_upsampler(Sampling(interpolation="flow", L=5), threads=3)
        list(upsampler.between(pan(0.0), pan(1.0)))
        results.append(list(upsampler.between(a, b)))
        for threads in (1, 2, 4):
            cv2.setNumThreads(threads)
            results.append(made(a, b, L=5, threads=threads))
    finally:
        cv2.setNumThreads(before)
    for other in results[1:]:
        for one, two in zip(results[0], other, strict=True):
            assert np.array_equal(one, two)


@pytest.mark.thorough
def test_double_precision_is_kept():
    a, b = pan(0.0).astype(np.float64), pan(1.0).astype(np.float64)
    single = made(a.astype(np.float32), b.astype(np.float32), L=2)[0]
    double = made(a, b, L=2)[0]
    assert double.dtype == np.float64
    np.testing.assert_allclose(double, single, rtol=1e-5)


def test_views_and_the_frames_given_are_left_as_they_are():
    wide = np.repeat(pan(0.0), 2, axis=1), np.repeat(pan(1.0), 2, axis=1)
    before = wide[0].copy(), wide[1].copy()
    view = made(wide[0][:, ::2], wide[1][:, ::2], L=2)[0]
    assert np.array_equal(view, made(pan(0.0), pan(1.0), L=2)[0])
    assert np.array_equal(wide[0], before[0])
    assert np.array_equal(wide[1], before[1])


def test_light_is_never_negative_and_hardly_overshoots():
    x, _ = pixels()
    a, b = (np.where((x - s) // 10 % 2 == 0, 0.0, 200.0).astype(np.float32) for s in (0.0, 3.3))
    for light in made(a, b):
        assert light.min() >= 0.0
        assert light.max() <= 250.0


def test_pixels_at_rest_fire_no_events():
    quiet = replace(Pixel(), leak=None, shot_noise=None)
    config = Config(sampling=Sampling(L=5, interpolation="flow"), pixel=quiet)
    frames = [disk(t) / np.float32(255.0) for t in (0.0, 1.0, 2.0)]
    events = np.concatenate(list(simulate(frames, [0.0, 0.03, 0.06], config, threads=1)))
    away = np.hypot(np.maximum(np.abs(events["x"] - 36.0) - 6.0, 0.0), events["y"] - 32.0)
    assert events.size > 1000
    assert away.max() < 11.0 + 4.0

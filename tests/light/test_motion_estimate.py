from __future__ import annotations

import numpy as np
from flow_scenes import disk, pan, pixels

from adv2e.motion.estimate import estimate_motion


def test_motion_of_a_pan_in_both_directions():
    there, back = estimate_motion(pan(0.0), pan(1.0))
    inner = slice(10, -10), slice(10, -10)
    for motion, sign in ((there, 1.0), (back, -1.0)):
        assert np.mean(np.abs(motion.u[inner] - sign * 4.0)) < 0.1
        assert np.mean(np.abs(motion.v[inner] + sign * 1.5)) < 0.1
        assert np.mean(motion.score[inner] < 1.0) > 0.95


def test_a_disk_moves_over_its_ground_and_is_in_front():
    there, back = estimate_motion(disk(0.0), disk(1.0))
    x, y = pixels()
    for motion, column, step in ((there, 30.0, 6.0), (back, 36.0, -6.0)):
        away = np.hypot(x - column, y - 32.0)
        assert np.mean(np.abs(motion.u[away < 8.0] - step)) < 0.2
        assert not np.any(motion.u[away > 25.0])
        assert np.median(motion.score[away < 8.0]) < np.median(motion.score[away > 25.0])


def test_nothing_is_found_in_frames_equal_to_within_one_percent():
    a = pan(0.0)
    rng = np.random.default_rng(1)
    assert estimate_motion(a, (a * (1.0 + 0.005 * rng.random(a.shape))).astype(np.float32)) is None


def test_ground_at_rest_hardly_moves_with_its_noise():
    rng = np.random.default_rng(3)
    a, b = (
        (disk(t) * rng.uniform(0.98, 1.02, disk(t).shape)).astype(np.float32) for t in (0.0, 1.0)
    )
    there, back = estimate_motion(a, b)
    x, y = pixels()
    far = np.hypot(x - 33.0, y - 32.0) > 20.0
    for motion in (there, back):
        assert np.mean(np.hypot(motion.u, motion.v)[far]) < 0.1


def test_pixels_whose_surroundings_keep_their_light_do_not_move():
    a, b = disk(0.0), disk(1.0)
    equal = a == b
    equal[1:-1, 1:-1] &= np.logical_and.reduce(
        [(a == b)[1 + j : 63 + j, 1 + i : 79 + i] for j in (-1, 0, 1) for i in (-1, 0, 1)]
    )
    equal[[0, -1]] = equal[:, [0, -1]] = False
    there, back = estimate_motion(a, b)
    seen = equal & (there.score < 100.0)
    assert seen.sum() > 1000
    assert not np.any(there.u[seen])
    assert not np.any(back.v[equal & (back.score < 100.0)])

"""Classes of places: rows, contrast, load."""

import numpy as np
import pytest
from made_up_streams import HEIGHT, WIDTH, scene_of, some_scene, wandering_light

from adv2e.diagnosis.statistics import classes


@pytest.mark.parametrize("period_s", [0.04, 0.01, 0.003])
def test_contrast_is_the_range_of_log_light_within_50_ms(period_s):
    light = wandering_light(seed=3)
    found = classes.contrast(scene_of(light, period_s=period_s))
    beside = {0.04: 0, 0.01: 2, 0.003: 7}[period_s]
    log = np.log(light).reshape(len(light), -1)
    for k in range(len(light) - 1):
        window = log[max(0, k - beside) : k + 2 + beside]
        np.testing.assert_allclose(found[k], np.ptp(window, axis=0), atol=1e-5)


def test_every_row_has_a_class_of_its_own_where_there_are_few():
    scene = some_scene()
    borders = classes.row_borders(scene)
    np.testing.assert_array_equal(borders, np.arange(HEIGHT + 1))
    rows = classes.of_rows(scene, borders)
    np.testing.assert_array_equal(rows.reshape(HEIGHT, WIDTH)[:, 3], np.arange(HEIGHT))


def test_many_rows_are_joined_evenly():
    scene = scene_of(np.full((2, 260, 4), 30.0, np.float32))
    borders = classes.row_borders(scene)
    assert borders[0] == 0 and borders[-1] == 260
    assert set(np.diff(borders)) <= {5, 6}
    number = np.bincount(classes.of_rows(scene, borders).ravel())
    np.testing.assert_array_equal(number, 4 * np.diff(borders))


def test_classes_of_load_hold_as_many_events():
    rate = np.random.default_rng(1).uniform(10.0, 1000.0, 400)
    step = classes.by_load(rate, 5)
    number = np.bincount(step, rate)
    np.testing.assert_allclose(number, rate.sum() / 5, rtol=0.03)
    assert all(rate[step == k].max() < rate[step == k + 1].min() for k in range(4))


def test_without_events_there_is_one_class_of_load():
    assert set(classes.by_load(np.zeros(9), 5)) == {0}

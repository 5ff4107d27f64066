"""Statistics from pixel to pixel: of chips whose pixels differ as told."""

import numpy as np
import pytest
from made_up.streams import (
    HEIGHT,
    STOP_US,
    WIDTH,
    placed,
    random_stream,
    some_scene,
    statistics,
    stream_of,
)

from adv2e.diagnosis.statistics import pixels as of_pixels

SCENE = some_scene(seed=5)
PER_PIXEL = 12


def chip(draw, gains=1.0, dead=(), loud=()):
    """Return a placed stream with Poisson numbers of events, pixels differing as told."""
    mean = np.full(WIDTH * HEIGHT, float(PER_PIXEL)) * gains
    mean[list(dead)] = 0.0
    mean[list(loud)] *= 20.0
    pixel = np.repeat(np.arange(WIDTH * HEIGHT), draw.poisson(mean))
    t = draw.integers(0, STOP_US, len(pixel))
    on = draw.integers(0, 2, len(pixel))
    return placed(stream_of(t, pixel % WIDTH, pixel // WIDTH, on), SCENE)


@pytest.fixture(scope="module")
def pixels():
    """Return a function: the statistics of a chip against those of twenty plain ones."""
    draw = np.random.default_rng(9)
    plain = [chip(draw) for _ in range(30)]
    counted = [of_pixels.count_pixels(one, SCENE) for one in plain]
    group = of_pixels.pixels(SCENE, np.mean(counted, axis=0))
    usual = [statistics(group, chip(draw)) for _ in range(20)]

    def deviations(**differences):
        found = statistics(group, chip(draw, **differences))
        result = {}
        for (name, value), least in zip(found.items(), group.least, strict=True):
            values = np.array([one[name] for one in usual])
            result[name] = float((value - values.mean()) / max(values.std(ddof=1), least))
        return result

    return deviations


def test_pixels_as_expected_are_within_chance(pixels):
    assert max(map(abs, pixels().values())) < 5.0


def test_pixels_that_are_silent(pixels):
    found = pixels(dead=[5, 50, 77, 100, 130, 160])
    assert found["silent pixels"] > 5
    assert abs(found["loudest pixel"]) < 5


def test_silent_pixels_are_told_as_a_number():
    dead = {5, 50, 77}
    stream = random_stream(40_000, 3)
    alive = stream.chosen(~np.isin(stream.pixel, list(dead)))
    group = of_pixels.pixels(SCENE, of_pixels.count_pixels(placed(stream, SCENE), SCENE))
    values = group.values(group.count(placed(alive, SCENE)).sum(axis=0))
    (told,) = (
        entry.plain(value)
        for entry, value in zip(group.entries, values, strict=True)
        if entry.name == "silent pixels"
    )
    assert told == pytest.approx(len(dead))


def test_pixels_that_are_loud(pixels):
    found = pixels(loud=[40])
    assert found["loudest pixel"] > 8
    assert abs(found["silent pixels"]) < 5


def test_pixels_that_differ(pixels):
    gains = np.exp(np.random.default_rng(1).normal(0.0, 0.5, WIDTH * HEIGHT))
    found = pixels(gains=gains)
    assert min(found["spread of ON"], found["spread of OFF"], found["ON with OFF"]) > 6
    assert min(found["ON persists"], found["OFF persists"]) > 4
    assert abs(found["rows"]) < 6


def test_rows_and_columns_that_differ(pixels):
    gains = np.exp(np.random.default_rng(2).normal(0.0, 0.4, HEIGHT))
    rows = pixels(gains=np.repeat(gains, WIDTH))
    assert rows["rows"] > 4
    assert rows["rows"] > rows["columns"]
    assert rows["beside"] > 6
    gains = np.exp(np.random.default_rng(3).normal(0.0, 0.4, WIDTH))
    columns = pixels(gains=np.tile(gains, HEIGHT))
    assert columns["columns"] > 4
    assert columns["columns"] > columns["rows"]
    assert columns["below"] > 6


def test_slopes_over_the_sensor(pixels):
    y, x = np.mgrid[-1 : 1 : HEIGHT * 1j, -1 : 1 : WIDTH * 1j]
    for name, gains in (
        ("left to right", 1 + 0.5 * x),
        ("top to bottom", 1 + 0.5 * y),
        ("towards the corners", 0.7 + 0.5 * (x * x + y * y)),
    ):
        found = pixels(gains=gains.ravel())
        assert found[name] > 6, name
        assert pixels(gains=1.4 - 0.6 * gains.ravel())[name] < -3, name

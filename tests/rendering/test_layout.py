from __future__ import annotations

import numpy as np
import pytest

from adv2e.rendering.styles import (
    GAP,
    MOST_PIXELS,
    STRIP,
    Cell,
    Style,
    compose,
    default_scale,
    sheet,
)


def panel(level, rows=60, columns=200):
    return np.full((rows, columns, 3), level, np.uint8)


def test_panels_stand_side_by_side_below_a_strip():
    picture = compose(Cell((panel(10), panel(200)), "caption"), 1, Style())
    assert picture.shape == (STRIP + 60, 400 + GAP, 3)
    assert np.all(picture[STRIP:, :200] == 10)
    assert np.all(picture[STRIP:, 200 + GAP :] == 200)


def test_pixels_are_repeated_exactly():
    image = np.random.default_rng(0).integers(0, 256, (60, 200, 3)).astype(np.uint8)
    picture = compose(Cell((image,), ""), 3, Style())
    assert np.array_equal(picture[STRIP:], image.repeat(3, axis=0).repeat(3, axis=1))


def test_strip_shows_caption_and_both_colours():
    style = Style(on=(200, 0, 0), off=(0, 0, 200))
    bare = compose(Cell((panel(0),), ""), 1, style)[:STRIP]
    written = compose(Cell((panel(0),), "0.5 s"), 1, style)[:STRIP]
    for colour in (style.on, style.off):
        assert np.count_nonzero(np.all(bare == colour, axis=2)) > 50
    changed = np.flatnonzero(np.any(written != bare, axis=(0, 2)))
    assert changed.size > 10
    assert changed.max() < 60


def test_legend_gives_way_to_a_long_caption():
    style = Style(on=(200, 0, 0))
    strip = compose(Cell((panel(0),), "words " * 10), 1, style)[:STRIP]
    assert not np.any(np.all(strip == style.on, axis=2))


@pytest.mark.parametrize(("width", "scale"), [(1280, 1), (640, 1), (346, 2), (240, 3), (64, 10)])
def test_small_sensors_are_enlarged(width, scale):
    assert default_scale(width) == scale


def test_sheet_is_filled_in_reading_order():
    cells = [Cell((panel(30 * k + 10, 90, 120),), "") for k in range(6)]
    picture = sheet(cells, Style(), 1)
    height, width = STRIP + 90 + GAP, 120 + GAP
    assert picture.shape == (2 * height + GAP, 3 * width + GAP, 3)
    for k in range(6):
        place = picture[(k // 3) * height + GAP + STRIP + 5, (k % 3) * width + GAP + 5]
        assert place.tolist() == [30 * k + 10] * 3


def test_sheet_of_large_pictures_is_made_smaller():
    cells = [Cell((panel(9, 720, 1280), panel(90, 720, 1280)), "") for _ in range(4)]
    picture = sheet(cells, Style())
    assert MOST_PIXELS * 0.8 < picture.shape[1] < MOST_PIXELS * 1.05


def test_sheet_of_one():
    picture = sheet([Cell((panel(9, 180, 240),), "")], Style())
    assert picture.shape == (STRIP + 3 * 180 + 2 * GAP, 3 * 240 + 2 * GAP, 3)

from __future__ import annotations

import math

import numpy as np
import pytest

from adv2e.errors import UsageError
from adv2e.events import make_events
from adv2e.rendering.styles import Style, draw, parse_colour

RED, BLUE = (255, 0, 0), (0, 0, 255)


def one_of_each(style, **more):
    """Draw ON at (1, 0), OFF at (3, 2) and both, OFF last, at (0, 1), on 5x3 pixels."""
    events = make_events([10, 20, 30, 40], [1, 3, 0, 0], [0, 2, 1, 1], [1, 0, 1, 0])
    return draw(events, 5, 3, 41, Style(name=style, on=RED, off=BLUE, window_us=100, **more))


@pytest.mark.parametrize(("style", "ground"), [("white", 255), ("black", 0)])
def test_a_pixel_has_the_colour_of_its_last_event(style, ground):
    expected = np.full((3, 5, 3), ground, np.uint8)
    expected[0, 1] = RED
    expected[2, 3] = BLUE
    expected[1, 0] = BLUE
    assert np.array_equal(one_of_each(style), expected)


def test_defaults_are_red_and_blue_on_white():
    picture = draw(make_events([1, 2], [0, 1], [0, 0], [1, 0]), 3, 1, 10)
    on, off, ground = picture[0].astype(int)
    assert on[0] > on[1] + on[2]
    assert off[2] > off[0] + off[1]
    assert ground.tolist() == [255, 255, 255]


def test_window_has_its_start_and_lacks_its_end():
    events = make_events([99, 100, 149, 150], [0, 1, 2, 3], [0] * 4, [1] * 4)
    picture = draw(events, 4, 1, 150, Style(on=(0, 0, 0), window_us=50))
    assert (picture[0, :, 0] == 0).tolist() == [False, True, True, False]


def test_grey_is_the_net_count_clipped_at_three():
    times = np.arange(11)
    x = [0, 1, 1, 2, 2, 2, 2, 3, 4, 4, 4]
    p = [1, 1, 1, 1, 1, 1, 1, 0, 1, 0, 0]
    picture = draw(make_events(times, x, [0] * 11, p), 6, 1, 11, Style(name="grey"))
    levels = [round(255 * (net + 3) / 6) for net in (1, 2, 3, -1, -1, 0)]
    assert picture[0, :, 0].tolist() == levels
    assert np.array_equal(picture[..., 0], picture[..., 2])


def test_time_surface_fades_with_the_age_of_the_last_event():
    style = Style(name="surface", on=(0, 0, 0), window_us=3000)
    events = make_events([100, 2000, 2000, 2999], [1, 0, 1, 2], [0] * 4, [1] * 4)
    picture = draw(events, 4, 1, 3000, style)
    faded = round(255 * (1 - math.exp(-1)))
    assert picture[0, :, 0].tolist() == [faded, faded, 0, 255]


@pytest.mark.parametrize("style", ["white", "black", "grey", "surface"])
def test_without_events_all_is_background(style):
    style = Style(name=style)
    picture = draw(make_events([], [], [], []), 3, 2, 0, style)
    assert picture.shape == (2, 3, 3)
    assert picture.dtype == np.uint8
    assert np.all(picture == np.array(style.background))


def test_colours_by_name_and_by_number():
    assert parse_colour("#10A0ff") == (16, 160, 255)
    assert parse_colour("Black") == (0, 0, 0)


@pytest.mark.parametrize("text", ["rouge", "#12345", "#12345g", ""])
def test_unknown_colours_name_the_known(text):
    with pytest.raises(UsageError, match=r"must be #rrggbb or one of red, blue"):
        parse_colour(text)


def test_unknown_style_and_empty_window():
    with pytest.raises(UsageError, match="'pink': must be one of white, black, grey, surface"):
        Style(name="pink")
    with pytest.raises(UsageError, match="at least 1 us"):
        Style(window_us=0)

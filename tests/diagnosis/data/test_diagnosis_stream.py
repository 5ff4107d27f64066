"""Events with their predecessors, against a plain loop."""

import numpy as np
import pytest
from hypothesis import given, settings
from made_up.streams import HEIGHT, WIDTH, random_stream, stream_of, streams

from adv2e.diagnosis.data.splits import Stream
from adv2e.events import EVENT_DTYPE


def predecessors(stream):
    """Return (since, on_before) by a plain loop."""
    last, since, before = {}, [], []
    for t, pixel, on in zip(
        stream.t.tolist(), stream.pixel.tolist(), stream.on.tolist(), strict=True
    ):
        then, polarity = last.get(pixel, (t + 1, on))
        since.append(t - then)
        before.append(polarity)
        last[pixel] = t, on
    return since, before


def check(stream):
    since, before = predecessors(stream)
    assert stream.since.tolist() == since
    assert stream.on_before.tolist() == before


@settings(deadline=None, max_examples=80)
@given(streams())
def test_predecessors(stream):
    check(stream)


def test_more_pixels_than_16_bits_count():
    check(random_stream(3000, seed=1, width=400, height=300))
    width, height = 346, 260
    # numbers of pixels that agree in their lower 16 bits
    x, y = np.divmod(np.array([5, 5 + 65536, 5, 5 + 65536, 89_000]), width)[::-1]
    stream = stream_of([0, 10, 30, 60, 61], x, y, [1, 0, 0, 1, 1], width, height)
    assert stream.since.tolist() == [-1, -1, 30, 50, -1]
    assert stream.on_before.tolist() == [1, 0, 1, 0, 1]


def test_exactly_as_many_pixels_as_16_bits_count():
    check(random_stream(2000, seed=2, width=256, height=256))
    stream = stream_of([0, 1, 2], [255, 0, 255], [255, 0, 255], [1, 1, 1], 256, 256)
    assert stream.since.tolist() == [-1, -1, 2]


@pytest.mark.parametrize("count", [0, 1])
def test_few_events(count):
    stream = random_stream(count)
    assert len(stream) == count
    assert stream.since.tolist() == [-1] * count
    assert stream.on_before.tolist() == stream.on.tolist()
    assert len(stream.events()) == count


@settings(deadline=None, max_examples=40)
@given(streams())
def test_events_and_back(stream):
    events = stream.events()
    assert events.dtype == EVENT_DTYPE
    again = Stream.of(events, WIDTH, HEIGHT)
    for name in ("t", "pixel", "on"):
        np.testing.assert_array_equal(getattr(again, name), getattr(stream, name))


def test_far_corner_of_a_wide_sensor():
    events = np.array([(7, 1279, 719, 1)], EVENT_DTYPE)
    stream = Stream.of(events, 1280, 720)
    assert stream.pixel.tolist() == [1280 * 720 - 1]
    np.testing.assert_array_equal(stream.events(), events)


def test_a_span_has_its_start_and_not_its_stop():
    stream = stream_of([1, 5, 5, 9, 12], [0] * 5, [0] * 5, [1, 0, 1, 0, 1])
    assert stream.between(5.0, 12.0).t.tolist() == [5, 5, 9]
    assert stream.between(5.5, 100.0).t.tolist() == [9, 12]
    assert len(stream.between(100.0, 200.0)) == 0


def test_chosen_events_have_other_predecessors():
    stream = stream_of([1, 5, 9], [2, 2, 2], [0, 0, 0], [1, 0, 1])
    some = stream.chosen(np.array([True, False, True]))
    assert some.since.tolist() == [-1, 8]
    assert some.on_before.tolist() == [1, 1]
    assert (some.width, some.height) == (WIDTH, HEIGHT)


def test_the_stream_does_not_change_with_its_events():
    events = np.zeros(3, EVENT_DTYPE)
    stream = Stream.of(events, 4, 4)
    events["t"] = 5
    assert stream.t.tolist() == [0, 0, 0]

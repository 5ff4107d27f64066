import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.formats.event_file import EventFile, Facts
from adv2e.formats.reading import assemble


def built(rows, geometry=(10, 10), parts=1, **said):
    facts = Facts("a.h5", **said)
    facts.state(geometry, "the file")
    columns = [part.T for part in np.array_split(np.array(rows, np.int64).reshape(-1, 4), parts)]
    found = assemble(EventFile("monash", facts, lambda: iter(columns)))
    return found.events.tolist(), (found.width, found.height), found.problems


def test_sound_events_have_no_problems():
    rows = [(1, 2, 3, 1), (2, 2, 3, 0)]

    assert built(rows) == (rows, (10, 10), [])


def test_unsorted_events_are_sorted_and_told():
    events, _, problems = built([(5, 1, 1, 1), (3, 1, 1, 1), (4, 1, 1, 1), (2, 1, 1, 1)])

    assert [t for t, *_ in events] == [2, 3, 4, 5]
    assert problems == [
        "events are not in the order of time (2 steps back, the largest 2 us): sorted"
    ]


@pytest.mark.parametrize("late", [False, True])
def test_events_of_one_time_stay_in_the_order_of_the_file(late):
    rows = [(0, 9, 9, 1), (1, 2, 1, 0), (1, 1, 1, 1), (1, 1, 1, 0), (1, 1, 1, 1), (2, 0, 0, 0)]
    given = [*rows[1:], rows[0]] if late else rows

    events, _, problems = built(given, parts=2)

    assert events == rows
    assert [p for p in problems if "repeat" not in p] == (
        ["events are not in the order of time (1 steps back, the largest 2 us): sorted"]
        if late
        else []
    )


@pytest.mark.parametrize("shuffled", [False, True])
def test_duplicates_are_counted_and_kept(shuffled):
    rows = [(1, 2, 3, 1), (1, 5, 5, 0), (1, 2, 3, 1), (1, 2, 3, 0), (4, 2, 3, 1)]

    events, _, problems = built(rows[::-1] if shuffled else rows)

    assert len(events) == 5
    assert problems[-1] == "1 events repeat another one exactly: kept"


def test_negative_and_huge_coordinates_are_left_out():
    rows = [(1, -1, 0, 1), (2, 0, -5, 1), (3, 70_000, 0, 1)]
    rest = [(t, 1, 1, 1) for t in range(4, 304)]

    events, _, problems = built(rows + rest)

    assert events == rest
    assert problems == ["3 events with a coordinate below 0 or above 65535: left out"]


def test_events_outside_the_geometry_are_left_out():
    rest = [(t, 9, 9, 1) for t in range(3, 203)]
    events, size, problems = built([(1, 12, 0, 1), (2, 0, 400, 0), *rest])

    assert (events, size) == (rest, (10, 10))
    assert problems == ["2 events outside 10x10, which the file states: left out"]


def test_geometry_that_is_one_short_is_widened():
    events, size, problems = built([(1, 10, 3, 1)])

    assert (len(events), size) == (1, (11, 10))
    assert problems == [
        "the file states 10x10, one less than the largest coordinates need: 11x10 taken"
    ]


def test_without_geometry_the_largest_coordinates_tell():
    events, size, problems = built([(1, 7, 3, 1), (2, 2, 5, 0)], geometry=None)

    assert (len(events), size) == (2, (8, 6))
    assert problems == ["no geometry stated: 8x6 from the largest coordinates"]


def test_odd_polarities_are_counted():
    rest = [(t, 0, 0, 1) for t in range(3, 2003)]
    events, _, problems = built([(1, 0, 0, 2), (2, 0, 0, -3), *rest])

    assert [p for *_, p in events] == [1, 0, *[1] * 2000]
    assert problems == [
        "2 events with a polarity other than -1, 0 and 1: taken as ON above 0, else OFF"
    ]


def test_two_kinds_of_off_are_told():
    events, _, problems = built([(1, 0, 0, 0), (2, 0, 0, -1), (3, 0, 0, 1)], parts=3)

    assert [p for *_, p in events] == [0, 0, 1]
    assert problems == ["polarities -1 and 0 both occur: both taken as OFF"]


def test_two_polarities_of_which_none_is_on_are_refused():
    with pytest.raises(DataError, match=r"polarities are -1 \(or 255\) and 0 alone"):
        built([(1, 0, 0, 0), (2, 0, 0, -1)])


def test_negative_times_are_told():
    _, _, problems = built([(-1_500_000, 0, 0, 1), (2, 0, 0, 1)])

    assert problems == ["times begin below zero, at -1.500000 s"]


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        ([(1, 12, 0, 1), (2, 0, 0, 1)], r"1 events outside 10x10, .* of 2 \(they need 13x1\)"),
        ([(1, -1, 0, 1), (2, 0, 0, 1)], "1 events with a coordinate below 0 or above 65535, of 2"),
        ([(1, 20_000, 30_000, 1)] * 50, "50 events outside 10x10"),
    ],
)
def test_many_events_outside_the_sensor_are_an_error_unless_asked_for(rows, text):
    with pytest.raises(DataError, match=rf"a\.h5: {text}.*: --crop-events leaves them out"):
        built(rows)

    events, _, problems = built(rows, crop_events=True)
    assert all(x < 10 and y < 10 for _, x, y, _ in events)
    assert any("left out" in problem for problem in problems)


def test_a_sensor_that_is_stated_the_other_way_round_is_named():
    rows = [(t, t % 200, t % 100, 1) for t in range(400)]
    with pytest.raises(DataError, match="a sensor of 240x180 holds them"):
        built(rows, geometry=(180, 240))
    assert built(rows, geometry=(240, 180))[2] == []


def columns_of(order, count=2000):
    """Columns of a made-up recording in some order, which are then taken for t, x, y, p."""
    draw = np.random.default_rng(0)
    held = {
        "t": np.sort(draw.integers(0, 1_000_000, count)),
        "x": draw.integers(0, 640, count),
        "y": draw.integers(0, 480, count),
        "p": draw.integers(0, 2, count),
    }
    return np.stack([held[name] for name in order], axis=1).tolist()


@pytest.mark.parametrize("order", ["xypt", "xytp", "tpxy", "pxyt", "yxtp"])
def test_columns_in_another_order_are_an_error(order):
    with pytest.raises(DataError, match="are the columns t x y p"):
        built(columns_of(order), geometry=None, parts=3)


@pytest.mark.parametrize(
    "rows",
    [
        [(1, 5, 0, 1), (2, 3, 1, 0)],
        [(7, 5, 5, 1)] * 50,
        [(t, 1, t % 2, 1) for t in range(100)],
        [(7, t // 30, t, 1) for t in range(100)],
        [(t, t, t, 1) for t in range(100)],
    ],
)
def test_events_that_look_alike_are_no_columns_in_another_order(rows):
    events, _, problems = built(rows, geometry=None)
    assert events == rows
    assert not [problem for problem in problems if "order" in problem or "polarit" in problem]

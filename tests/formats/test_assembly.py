import numpy as np
import pytest

from adv2e.events import sort_events
from adv2e.formats.assembly import assemble
from adv2e.formats.event_file import EventFile, Facts


def built(rows, geometry=(10, 10), parts=1):
    facts = Facts("a.h5")
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
    assert problems == ["events are not in the order of time (2 steps back): sorted"]


def test_ties_are_put_in_order_of_row_column_polarity_silently():
    rows = [(0, 9, 9, 1), (1, 2, 1, 0), (1, 1, 2, 0), (1, 1, 1, 1), (1, 1, 1, 0), (2, 0, 0, 0)]

    events, _, problems = built(rows)

    assert events == [rows[0], rows[4], rows[3], rows[1], rows[2], rows[5]]
    assert problems == []


def test_order_agrees_with_a_full_sort():
    rng = np.random.default_rng(0)
    rows = np.column_stack(
        [
            np.sort(rng.integers(0, 100, 2000)),
            rng.integers(0, 10, (2000, 2)),
            rng.integers(0, 2, 2000),
        ]
    )
    events = assemble(EventFile("monash", Facts("a.h5"), lambda: iter([rows.T]))).events

    assert np.array_equal(events, sort_events(events))


@pytest.mark.parametrize("shuffled", [False, True])
def test_duplicates_are_counted_and_kept(shuffled):
    rows = [(1, 2, 3, 1), (1, 5, 5, 0), (1, 2, 3, 1), (1, 2, 3, 0), (4, 2, 3, 1)]

    events, _, problems = built(rows[::-1] if shuffled else rows)

    assert len(events) == 5
    assert problems[-1] == "1 events repeat another one exactly: kept"


def test_negative_and_huge_coordinates_are_left_out():
    rows = [(1, -1, 0, 1), (2, 0, -5, 1), (3, 70_000, 0, 1), (4, 1, 1, 1)]

    events, _, problems = built(rows)

    assert events == [(4, 1, 1, 1)]
    assert problems == ["3 events with a coordinate below 0 or above 65535: left out"]


def test_events_outside_the_geometry_are_left_out():
    events, size, problems = built([(1, 9, 9, 1), (2, 12, 0, 1), (3, 0, 400, 0)])

    assert (events, size) == ([(1, 9, 9, 1)], (10, 10))
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
    events, _, problems = built([(1, 0, 0, 2), (2, 0, 0, -3), (3, 0, 0, 1)])

    assert [p for *_, p in events] == [1, 0, 1]
    assert problems == [
        "2 events with a polarity other than -1, 0 and 1: taken as ON above 0, else OFF"
    ]


def test_two_kinds_of_off_are_told():
    events, _, problems = built([(1, 0, 0, 0), (2, 0, 0, -1), (3, 0, 0, 1)], parts=3)

    assert [p for *_, p in events] == [0, 0, 1]
    assert problems == ["polarities -1 and 0 both occur: both taken as OFF"]


def test_negative_times_are_told():
    _, _, problems = built([(-1_500_000, 0, 0, 1), (2, 0, 0, 1)])

    assert problems == ["times begin below zero, at -1.500000 s"]

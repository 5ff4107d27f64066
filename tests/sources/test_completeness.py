"""Pictures that were expected and did not come."""

from __future__ import annotations

import pytest

from adv2e.sources.video.completeness import lost_by_count, lost_by_time

MS = 10**6
AT = [n * 40 * MS for n in range(12)]
"""When pictures are expected."""


def without(*numbers, times=AT):
    return [t for n, t in enumerate(times) if n not in numbers]


@pytest.mark.parametrize("lost", [(), (5,), (11,), (4, 5, 6), (1, 3, 10, 11)])
@pytest.mark.parametrize("origin", [0, 7 * 10**9])
def test_pictures_missing_behind_the_first_are_named(lost, origin):
    expected = [t + origin for t in AT]
    assert lost_by_time(expected, without(*lost), 0) == [expected[n] for n in lost]


def test_pictures_before_the_first_that_stands_alone_are_not_missing():
    assert lost_by_time(AT, without(0, 1), 0) == []
    assert lost_by_time(AT, without(0, 1, 7), 0) == [AT[7]]


def test_stamps_may_begin_at_the_first_in_the_file():
    late = [t - AT[2] for t in AT]  # the first two are shown before it, and cannot be
    assert lost_by_time(AT, late[2:], 0, leading=2) == []
    assert lost_by_time(AT, [*late[2:6], *late[7:]], 0, leading=2) == [AT[6]]
    assert lost_by_time(AT, late[2:-1], 0, leading=2) == [AT[-1]]
    assert len(lost_by_time(AT, late[2:], 0)) == 2


def test_stamps_may_begin_elsewhere():
    assert lost_by_time([t + 10**9 for t in AT], [t + 12 * MS for t in without(3)], 0) == [
        10**9 + AT[3]
    ]


def test_a_coarse_clock_is_no_loss():
    assert lost_by_time(AT, [t + MS * (n % 2) for n, t in enumerate(AT)], MS) == []


def test_second_fields_are_not_missing():
    fields = sorted([*AT, *(t + 20 * MS for t in AT)])
    assert lost_by_time(fields, AT, 0) == []
    assert lost_by_time(fields, without(4), 0) != []
    assert lost_by_count(24, AT, fields) == 0


def test_nothing_came():
    assert lost_by_time(AT, [], 0) == AT
    assert lost_by_time([], AT, 0) == []


def test_times_of_decoding_are_late_by_what_is_held_back():
    held = [*AT[2:], None, None]
    assert lost_by_count(12, held, AT) == 0
    assert lost_by_count(12, held[:4] + held[5:], AT) == 1
    assert lost_by_count(14, held, [*AT, 10**9, 2 * 10**9]) == 2
    leading = [*AT[5:], None, None]  # three could not stand alone
    assert lost_by_count(12, leading, AT) == 0
    assert lost_by_count(12, [*leading[:3], *leading[4:]], AT) == 1

"""Pictures that were expected and did not come."""

from __future__ import annotations

import pytest

from adv2e.sources.video.times import lost_pictures

MS = 10**6
AT = [n * 40 * MS for n in range(12)]
"""When pictures are expected."""


def without(*numbers, times=AT):
    return [t for n, t in enumerate(times) if n not in numbers]


@pytest.mark.parametrize("lost", [(), (5,), (11,), (4, 5, 6), (1, 3, 10, 11)])
def test_pictures_missing_behind_the_first_are_counted(lost):
    assert lost_pictures(12, without(*lost), AT) == len(lost)
    assert lost_pictures(12, [t + 1000 * (n % 2) for n, t in enumerate(without(*lost))], AT) == len(
        lost
    )


def test_pictures_before_the_first_that_stands_alone_are_not_missing():
    assert lost_pictures(12, without(0, 1), AT) == 0
    assert lost_pictures(12, without(0, 1, 7), AT) == 1


def test_stamps_may_begin_at_the_first_in_the_file():
    late = [t - AT[2] for t in AT[2:]]  # the first two are shown before it, and cannot be
    assert lost_pictures(12, late, AT, leading=2) == 0
    assert lost_pictures(12, [*late[:6], *late[7:]], AT, leading=2) == 1
    assert lost_pictures(12, late[:-1], AT, leading=2) == 1


def test_second_fields_are_not_missing():
    fields = sorted([*AT, *(t + 20 * MS for t in AT)])
    assert lost_pictures(24, AT, fields) == 0
    assert lost_pictures(24, without(4), fields) != 0


def test_nothing_came():
    assert lost_pictures(12, [], AT) == 12
    assert lost_pictures(0, AT, []) == 0


def test_times_of_decoding_are_late_by_what_is_held_back():
    held = [*AT[2:], None, None]
    assert lost_pictures(12, held, AT) == 0
    assert lost_pictures(12, held[:4] + held[5:], AT) == 1
    assert lost_pictures(14, held, [*AT, 10**9, 2 * 10**9]) == 2
    leading = [*AT[5:], None, None]  # three could not stand alone
    assert lost_pictures(12, leading, AT) == 0
    assert lost_pictures(12, [*leading[:3], *leading[4:]], AT) == 1

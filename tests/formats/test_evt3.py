"""EVT 3.0 as cameras write it: vectors, repeated times, times that begin again, other words."""

import event_readers
import numpy as np
import pytest

from adv2e.events import make_events
from adv2e.formats.reading import read_events
from adv2e.formats.writing import write_events

HEADER = b"% evt 3.0\n% format EVT3;height=480;width=640\n% geometry 640x480\n% end\n"


def row(y):
    return y


def column(x, p):
    return 0x2000 | p << 11 | x


def base(x, p):
    return 0x3000 | p << 11 | x


def vector(bits, columns):
    return (0x4000 if columns == 12 else 0x5000) | bits


def low(t):
    return 0x6000 | t & 0xFFF


def high(t):
    return 0x8000 | t >> 12 & 0xFFF


def read(path, words, header=HEADER):
    path.write_bytes(header + np.array(words, "<u2").tobytes())
    recording = read_events(path)
    return [tuple(event) for event in recording.events.tolist()], recording.problems


@pytest.mark.parametrize("gap", [0, 1 << 18])
def test_vectors_move_their_base(tmp_path, gap):
    """Also where other words, or the end of a block, lie between."""
    words = [high(0), low(9), row(7), base(100, 1), vector(0x801, 12)]
    words += [0xE000] * gap
    words += [vector(0b10, 12), column(3, 0), vector(0x81, 8), base(30, 0), vector(1, 8)]

    events, problems = read(tmp_path / "a.raw", words)

    expected = [(9, 100, 7, 1), (9, 111, 7, 1), (9, 113, 7, 1), (9, 3, 7, 0), (9, 124, 7, 1),
                (9, 131, 7, 1), (9, 30, 7, 0)]  # fmt: skip
    assert events == expected
    assert problems == []


def test_a_high_that_repeats_keeps_the_low_and_one_that_changes_does_not(tmp_path):
    words = [high(4096), low(4096 + 5), row(0), column(1, 1), high(4096), column(2, 1)]
    words += [high(8192), column(3, 1), low(8192 + 7), column(4, 1)]

    events, _ = read(tmp_path / "a.raw", words)

    assert events == [(4101, 1, 0, 1), (4101, 2, 0, 1), (8192, 3, 0, 1), (8199, 4, 0, 1)]


@pytest.mark.parametrize("gap", [0, 1 << 18])
def test_times_begin_again_and_steps_back_do_not_count(tmp_path, gap):
    turn = 1 << 24
    t = [16_700_000, turn - 216, turn + 4097, turn + (turn >> 1), 2 * turn, 2 * turn + 9000,
         2 * turn + 100]  # fmt: skip
    words = [row(0)]
    for number, time in enumerate(t):
        words += [high(time), low(time), column(number, 1)] + [0x8000 | time >> 12 & 0xFFF] * gap
    words[-gap or len(words) :] = []

    events, problems = read(tmp_path / "a.raw", words)

    assert sorted(time for time, *_ in events) == sorted(t)
    assert [p for p in problems if "order" not in p] == []


def test_events_before_the_first_time_and_row_are_left_out(tmp_path):
    words = [column(1, 1), low(3), column(2, 1), high(0), column(3, 1), row(4), vector(3, 8)]
    words += [low(8), column(4, 1)]

    events, problems = read(tmp_path / "a.raw", words)

    assert events == [(8, 4, 4, 1)]
    assert problems == ["5 events without a time, row or column before them: left out"]


def test_triggers_are_left_out_and_unknown_kinds_told(tmp_path):
    words = [high(0), low(1), row(2), column(3, 1), 0xA101, 0xE015, 0xF123, 0x7004, 0xB000, 0xC000]

    events, problems = read(tmp_path / "a.raw", words)

    assert events == [(1, 3, 2, 1)]
    assert problems == [
        "2 of 10 words of a kind that the format does not have (0xb, 0xc): left out"
    ]


def test_rows_of_the_other_type_hold_none_of_these_events(tmp_path):
    words = [high(0), low(1), row(2), column(3, 1), 0x1002, column(4, 1), row(2)]
    words += [column(x, 0) for x in range(5, 105)]

    events, problems = read(tmp_path / "a.raw", words)

    assert events == [(1, 3, 2, 1), *((1, x, 2, 0) for x in range(5, 105))]
    assert len(problems) == 2


def test_a_part_of_a_word_at_the_end_is_told(tmp_path):
    words = np.array([high(0), low(1), row(2), column(3, 1)], "<u2").tobytes()

    events, problems = read(tmp_path / "a.raw", [], HEADER + words + b"\x01")

    assert events == [(1, 3, 2, 1)]
    begin = len(HEADER + words)
    assert problems == [f"1 bytes at the end, at byte {begin}, are no whole word of 2: left out"]


def test_expelliarmus_counts_turns_of_the_low_bits_twice(tmp_path):
    """So it is no witness of EVT 3.0: it is late by 4096 us for each time that they turn over."""
    t = [4000, 4100, 60_000]
    write_events(tmp_path / "a.raw", make_events(t, [0, 1, 2], [0, 0, 0], [1, 1, 0]), (4, 3))

    _, found = event_readers.expelliarmus("evt3")(tmp_path / "a.raw")

    assert [int(time) - real for time, real in zip(found["t"], t, strict=True)] == [0, 4096, 4096]

from decimal import ROUND_HALF_UP, Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adv2e.errors import DataError
from adv2e.formats.reading import read_events
from adv2e.formats.text import parse_lines


@pytest.fixture
def read(tmp_path):
    def from_text(text, name="e.txt"):
        content = text if isinstance(text, bytes) else text.encode()
        (tmp_path / name).write_bytes(content)
        return read_events(tmp_path / name)

    return from_text


def times(recording):
    return recording.events["t"].tolist()


def parse_time(text, decimals=6):
    """Parse one time; None if it is refused."""
    (times, *_), _, wrong = parse_lines(f"{text} 1 2 1\n".encode(), decimals, exact=False)
    return None if wrong else int(times[0])


def test_lines_of_the_event_camera_dataset(read):
    recording = read("0.003811000 96 133 0\n0.003820001 127 171 1\n")

    assert recording.events.tolist() == [(3811, 96, 133, 0), (3820, 127, 171, 1)]
    assert recording.layout == "text"


def test_last_line_needs_no_line_feed(read):
    assert times(read("0.1 1 2 1\n0.2 1 2 1")) == [100_000, 200_000]


@pytest.mark.parametrize("separator", [" ", "  ", "\t", " \t "])
@pytest.mark.parametrize("end", ["\n", "\r\n", " \n"])
def test_blanks_and_line_ends(read, separator, end):
    line = separator.join(["0.5", "1", "2", "1"]) + end

    assert read("  " + line + line).events.tolist() == [(500_000, 1, 2, 1)] * 2


def test_comments_and_empty_lines_are_skipped(read):
    text = "#!events.txt\n# t x y 1.5e3\n\n0.5 1 2 1\n   \n# 0.6 1 2 1\n0.7 1 2 1\n"

    assert times(read(text)) == [500_000, 700_000]


def test_byte_order_mark_is_skipped(read):
    assert times(read(b"\xef\xbb\xbf0.5 1 2 1\n")) == [500_000]


def test_first_line_of_two_numbers_is_the_geometry(read):
    recording = read("# e2vid\n240 180\n0.000000000001 0 1 0\n0.5 239 179 1\n")

    assert (recording.width, recording.height) == (240, 180)
    assert times(recording) == [0, 500_000]
    assert recording.problems == []


def test_header_counts_as_a_line_in_messages(read):
    with pytest.raises(DataError, match=r"e\.txt line 3: "):
        read("240 180\n0.5 1 1 1\n0.6 1 1\n")


def test_scientific_notation(read):
    assert times(read("1e-06 1 2 1\n4.999999873689376e-05 1 2 1\n1.5E+0 1 2 1\n")) == [
        1,
        50,
        1_500_000,
    ]


def test_whole_rows_in_scientific_notation(read):
    rows = np.array([[0.5, 239, 0, 1], [0.75, 0, 179, 0]])
    text = "\n".join(" ".join(f"{number:.18e}" for number in row) for row in rows)

    assert read(text).events.tolist() == [(500_000, 239, 0, 1), (750_000, 0, 179, 0)]


def test_epoch_seconds_are_exact(read):
    assert times(read("1468941032.229165635 128 154 1\n1468941032.229166 1 1 0\n")) == [
        1_468_941_032_229_166,
        1_468_941_032_229_166,
    ]


def test_whole_seconds_among_decimals_are_seconds(read):
    assert times(read("0.5 1 1 1\n1 1 1 1\n")) == [500_000, 1_000_000]


def test_times_without_any_point_are_microseconds(read):
    recording = read("1500 1 2 1\n1468941032229165 3 4 0\n")

    assert times(recording) == [1500, 1_468_941_032_229_165]
    assert recording.problems[0].startswith("no unit is stated: times are taken as us;")


def test_polarity_minus_and_plus_one(read):
    assert read("0.1 1 1 -1\n0.2 1 1 +1\n").events["p"].tolist() == [0, 1]


def random_decimals(count):
    """Decimal numbers of every shape: signs, no integer or no fractional digits, exponents."""
    rng = np.random.default_rng(5)

    def digits(most):
        return "".join(rng.choice(list("0000123456789"), rng.integers(0, most + 1)))

    for _ in range(count):
        number = f"{digits(10) or '5'}.{digits(14)}" if rng.random() < 0.5 else f".{digits(14)}7"
        exponent = f"{rng.choice(list('eE'))}{rng.integers(-20, 9):+d}"
        yield rng.choice(["", "-", "+"]) + number + (exponent if rng.random() < 0.5 else "")


@pytest.mark.thorough
def test_times_agree_with_exact_decimal_arithmetic():
    for text in random_decimals(2000):
        exact = Decimal(text) * 1_000_000
        if abs(exact) < 9 * 10**18:
            assert parse_time(text) == int(exact.quantize(Decimal(1), ROUND_HALF_UP)), text


@pytest.mark.parametrize(
    ("text", "rounded"),
    [("0.0000005", 1), ("0.00000049999", 0), ("-0.0000005", -1), ("-5e-8", 0), ("9e-7", 1)],
)
def test_halves_are_rounded_away_from_zero(text, rounded):
    assert parse_time(text) == rounded


def test_time_beyond_64_bits_is_refused():
    assert parse_time("9223372036853.999999") == 9_223_372_036_853_999_999
    assert parse_time("9223372036855000000.0") is None


@pytest.mark.parametrize(
    "text", ["", "-", ".", "e5", "1e", "1e+", "1.2.3", "nan", "inf", "0x10", "1,5", "1e99", "١"]
)
def test_what_is_no_number_is_refused(text):
    assert parse_time(text) is None


@pytest.mark.parametrize(
    "line",
    [
        "0.5 1 2",
        "0.5 1 2 1 7",
        "0.5 1 two 1",
        "0.5,1,2,1",
        "0.5 1.5 2 1",
        "nan 1 2 1",
        "0.5 1 2 99999999999999999999",
    ],
)
def test_malformed_line_is_named(read, line):
    with pytest.raises(DataError) as info:
        read(f"# comment\n0.1 1 2 1\n{line}\n0.7 1 2 1\n")
    assert "e.txt line 3: must be 'time x y polarity', got " in str(info.value)
    assert repr(line) in str(info.value)


def test_malformed_line_far_down_is_named(read):
    text = "0.123456789 100 100 1\n" * 400_000 + "broken\n"

    with pytest.raises(DataError, match=r"line 400001: .* got 'broken'"):
        read(text)


def test_what_is_no_text_is_one_line(read):
    with pytest.raises(DataError, match=r"line \d+: ") as info:
        read(bytes(range(256)) * 100)
    assert "\n" not in str(info.value)


def test_decimal_among_microseconds_is_refused(read):
    text = "1000 100 100 1\n" * 400_000 + "1000.5 1 1 1\n"

    with pytest.raises(DataError, match="line 400001"):
        read(text)


def test_empty_file_has_no_events(read):
    recording = read("")

    assert (recording.events.size, recording.width, recording.height) == (0, 0, 0)
    assert recording.problems == ["no events"]


def test_metadata_of_a_folder_hold_for_its_events_file(tmp_path):
    (tmp_path / "events.txt").write_text("0.5 1 2 1\n")
    (tmp_path / "adv2e.json").write_text('{"width": 240, "height": 180}')

    recording = read_events(tmp_path / "events.txt")

    assert (recording.width, recording.height, recording.problems) == (240, 180, [])


def test_broken_metadata_are_a_problem_not_an_error(tmp_path):
    (tmp_path / "e.txt").write_text("0.5 1 2 1\n")
    (tmp_path / "e.txt.json").write_text("{")

    recording = read_events(tmp_path / "e.txt")

    assert recording.metadata == {}
    assert "e.txt.json: not a JSON mapping, ignored" in recording.problems[0]


@given(
    st.lists(
        st.tuples(
            st.integers(0, 10**11).map(str),
            st.text("0123456789", min_size=1, max_size=13),
            *(st.integers(0, 70_000).map(str) for _ in range(3)),
        ),
        min_size=1,
        max_size=20,
    ),
    st.booleans(),
    st.integers(0, 6),
)
@pytest.mark.thorough
def test_lines_written_plainly_are_read_as_all_others(rows, point, decimals):
    lines = [
        f"{whole}.{part} {x} {y} {p}" if point else f"{whole} {x} {y} {p}"
        for whole, part, x, y, p in rows
    ]
    plain, others = ("".join(f"{first}{line}\n" for line in lines) for first in ("", "  "))
    for exact in (False, True):
        found, expected = (
            parse_lines(text.encode(), decimals, exact=exact) for text in (plain, others)
        )
        assert np.array_equal(found[0], expected[0])
        assert np.array_equal(found[1], expected[1])
        assert found[2] == expected[2]

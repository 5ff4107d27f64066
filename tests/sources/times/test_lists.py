"""Lists of frames: what their columns are, whatever program wrote them."""

from __future__ import annotations

import pytest

from adv2e.errors import DataError
from adv2e.sources.times.lists import parse_list, read_list


def read(text, **evidence):
    return parse_list(text, "t.txt", **evidence)


def times_s(found):
    return [stamp.t_ns / 1e9 for stamp in found.stamps]


def names(found):
    return [stamp.name for stamp in found.stamps]


def error_of(text, **evidence):
    with pytest.raises(DataError) as info:
        read(text, **evidence)
    assert "\n" not in str(info.value)
    return str(info.value)


def lines(*rows):
    return "".join(f"{row}\n" for row in rows)


PROGRAMS = {
    "DAVIS240C": (lines("0.1 images/a.png", "0.2 images/b.png"), "time [s], name"),
    "vid2e": (lines("0.1", "0.2"), "time [s]"),
    "UZH-FPV": (
        lines("# id timestamp image_name", "0 0.1 images/a.png", "1 0.2 images/b.png"),
        "unused, time [s], name",
    ),
    "number and time": (lines("# id t", "7 0.1", "8 0.2"), "unused, time [s]"),
    "EuRoC": (
        lines("#timestamp [ns],filename", "100000000,images/a.png", "200000000,images/b.png\r"),
        "time [ns], name",
    ),
    "TUM": (
        lines(
            *("# color images", "# file: 'rgbd.bag'", "# timestamp filename"),
            *("0.1 images/a.png", "0.2 images/b.png"),
        ),
        "time [s], name",
    ),
    "DVS-Voltmeter": (lines("images/a.png 100000", "images/b.png 200000"), "name, time [us]"),
    "spreadsheet": (
        lines("Frame;Time (ms);File name;Gain", "1;100;images/a.png;3", "2;200;images/b.png;4"),
        "unused, time [ms], name, unused",
    ),
    "tabs": (
        lines("name\tt_us", "images/a.png\t100000", "images/b.png\t200000"),
        "name, time [us]",
    ),
    "heading over blanks": (
        lines("exposure timestamp image", "0.1 0.1 images/a.png", "0.2 0.2 images/b.png"),
        "unused, time [s], name",
    ),
    "Windows": (lines("0.1 images\\a.png", "0.2 images\\b.png"), "time [s], name"),
    "quoted": (lines('0.1 "images/a.png"', "0.2 'images/b.png'"), "time [s], name"),
    "PowerShell": (lines("0.1 images/a.png", "0.2 images/b.png"), "time [s], name"),
}


@pytest.mark.parametrize("program", PROGRAMS)
def test_columns_of_many_programs(tmp_path, program):
    text, columns = PROGRAMS[program]
    path = tmp_path / "list.txt"
    path.write_text(text, "utf-16" if program == "PowerShell" else "utf-8", newline="")
    found = read_list(path)
    assert found.columns == columns
    assert times_s(found) == [0.1, 0.2]
    named = "name" in columns
    assert names(found) == (["images/a.png", "images/b.png"] if named else [None, None])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('0.1 "a b.png"\n0.2 c.png\n', ["a b.png", "c.png"]),
        ('"a, b.png",0.1\nc.png,0.2\n', ["a, b.png", "c.png"]),
        ("0.1 a,b.png\n0.2 c,d.png\n", ["a,b.png", "c,d.png"]),
        ("0.1\ta b.png\n0.2\tc.png\n", ["a b.png", "c.png"]),
        ("0.1 it's.png\n0.2 b's.png\n", ["it's.png", "b's.png"]),
        ('0.1 "C:\\my clip\\1"\n0.2 "C:\\my clip\\2"\n', ["C:/my clip/1", "C:/my clip/2"]),
    ],
)  # fmt: skip
def test_names_with_blanks_and_marks(text, expected):
    assert names(read(text)) == expected


OPEN = {
    "two columns of numbers": ("0 0.1 a.png\n1 0.2 b.png\n", "line 1.*which is the time, 0 or 0.1"),
    "seconds and nanoseconds": ("# secs nsecs name\n1 5 a\n2 7 b\n", "line 2.*which is the time"),
    "numbers that are no times": ("# id image\n0 a.png\n1 b.png\n", "line 2.*no time in it"),
    "two names": ("0.1,l/a.png,r/a.png\n0.2,l/b.png,r/b.png\n", "line 1.*which is the name"),
    "a name with blanks": ("0.1 a b.png\n0.2 c d.png\n", "line 1.*which is the name"),
    "a number in a name": ("x 1540821840.6 l/a.png\ny 1540821841.6 l/b.png\n", "line 1.*name"),
    "decimal commas": ("0,1\n0,2\n", "line 1: '0,1': which is the time, 0 or 1"),
    "a heading alone": ("timestamp filename\n", "line 1.*no time in it"),
}  # fmt: skip


@pytest.mark.parametrize("case", OPEN)
def test_what_is_open_is_an_error_that_says_what_to_write(case):
    text, message = OPEN[case]
    with pytest.raises(DataError, match=message):
        read(text)
    assert "put a line such as '# id timestamp filename' above" in error_of(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "t.txt: no times"),
        ("# nothing\n", "t.txt: no times"),
        ("0.1\nabc\n", "t.txt line 2: 'abc' is not a number"),
        ("0.1,a\nabc,b\n0.3,c\n", "t.txt line 2: 'abc' is not a number"),
        ("0.1 a\nabc b\n0.3 c\n", "t.txt line 2: 'abc' is not a number"),
        ("0.1,a,3\n0.2,b\n0.3,c,4\n", "t.txt line 2: '0.2,b'"),
        ("0.1 a\n0.2 5 b\n0.3 c\n", "t.txt line 2: '0.2 5 b'"),
        ("0.2\n0.1\n", "t.txt line 2: times must increase; 0.1 s is not after the 0.2 s of line 1"),
        ("0.2\n0.2\n", "t.txt line 2: times must increase"),
        ("0.2 a\n0.1 b\n0.2 c\n", "t.txt line 3: times must increase.*line 1"),
        ("0.1 a\n0.2\n", "t.txt line 2: '0.2': expected one like line 1, '0.1 a'"),
        ("0.1\n0.2 a\n", "t.txt line 2: '0.2 a': expected one like line 1"),
        ("0 a\n9999999999999999999 b\n", "t.txt line 2: '9+' is out of range"),
        (f"0 a\n{'9' * 5000} b\n", "t.txt line 2: '9+' is out of range"),
        ("1e999\n2e999\n", "t.txt line 1: '1e999' is out of range"),
        ("1e-999\n2e-999\n", "t.txt line 2: times must increase"),
        ("nan\n0.2\n0.3\n", "t.txt line 1: 'nan'"),
    ],
)
def test_wrong_lines_are_named(text, message):
    with pytest.raises(DataError, match=message):
        read(text)


def test_comments_blank_lines_and_line_ends():
    found = read("# t\r\n0.25\r\n\r\n  0.5   # late\r\n% 3\r\n")
    assert times_s(found) == [0.25, 0.5]
    assert [stamp.line for stamp in found.stamps] == [2, 4]


def test_named_lines_are_sorted_and_that_is_told():
    found = read("0.2 'b c.png'\n0.1 a.png\n")
    assert [(stamp.t_ns, stamp.line, stamp.name) for stamp in found.stamps] == [
        (100_000_000, 2, "a.png"),
        (200_000_000, 1, "b c.png"),
    ]
    assert found.order == "line 2 is earlier than one before it: sorted by time"
    assert read("0.1 a\n0.2 b\n").order == ""


def test_epoch_times_keep_every_digit():
    found = read("1468941032.229165635 a\n1468941032.229165636 b\n", time_unit="s")
    assert [stamp.t_ns for stamp in found.stamps] == [
        1_468_941_032_229_165_635,
        1_468_941_032_229_165_636,
    ]


def test_endless_numbers_take_no_time_and_are_shown_in_part():
    for text in (f"0.1\n{'9' * 10**6}x\n0.2\n", f"0.1,a\n{'9' * 10**5}x,b\n0.2,c\n"):
        assert len(error_of(text)) < 200


def test_what_is_no_text(tmp_path):
    path = tmp_path / "times.txt"
    path.write_bytes(b"\x93NUMPY\xff\xfe\x00")
    with pytest.raises(DataError, match=r"times\.txt: not a text file"):
        read_list(path)
    with pytest.raises(DataError, match=r"none\.txt: No such file"):
        read_list(tmp_path / "none.txt")

"""Sizes and rectangles as they are written."""

import pytest

from adv2e.geometry import Rectangle, Size, parse_rectangle, parse_size


def test_a_size_is_columns_and_rows():
    assert parse_size("346x260") == parse_size(" 346 X 260 ") == parse_size((346, 260))
    assert parse_size("346x260") == Size(346, 260)
    assert str(Size(346, 260)) == "346x260"


@pytest.mark.parametrize(
    "text", ["", "346", "346x", "0x260", "346x0", "-3x5", "3.5x4", "1x2x3", "346,260", "³x2"]
)
def test_anything_else_is_no_size(text):
    with pytest.raises(ValueError, match=r"must be columns x rows, such as 346x260, got '"):
        parse_size(text)


def test_a_rectangle_is_a_corner_and_a_size():
    part = parse_rectangle("10,0,320,240")
    assert part == parse_rectangle((10, 0, 320, 240)) == Rectangle(10, 0, 320, 240)
    assert str(part) == "10,0,320,240"


@pytest.mark.parametrize(
    "text", ["", "1,2,3", "1,2,3,4,5", "1,2,0,4", "1,2,3,0", "-1,2,3,4", "1;2;3;4", "a,b,c,d"]
)
def test_anything_else_is_no_rectangle(text):
    with pytest.raises(ValueError, match=r"must be first column, first row, columns, rows"):
        parse_rectangle(text)


@pytest.mark.parametrize(
    ("part", "inside"),
    [
        ((0, 0, 8, 6), True),
        ((3, 2, 5, 4), True),
        ((4, 2, 5, 4), False),
        ((3, 3, 5, 4), False),
        ((0, 0, 9, 1), False),
    ],
)
def test_a_rectangle_is_inside_up_to_the_last_pixel(part, inside):
    assert Rectangle(*part).is_inside(8, 6) is inside

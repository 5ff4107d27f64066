"""Names in lists: whole, then by their end, never one picture for two."""

from __future__ import annotations

import pytest

from adv2e.errors import DataError
from adv2e.sources import open_source
from adv2e.sources.times.lists import match, member_of
from adv2e.sources.times.rates import Stamp

LEFT = ["/data/rec/left/0000.png", "/data/rec/left/0001.png"]


def matched(*names):
    """The picture of each line."""
    stamps = [Stamp(10**7 * n, n + 1, name) for n, name in enumerate(names)]
    return match(stamps, LEFT, "info.txt", " in left")


@pytest.mark.parametrize(
    "way", ["", "./", "../left/", "left/", "/data/rec/left/", "C:/clip/left/", "C:\\moved\\since\\"]
)
def test_a_name_is_matched_by_its_end(way):
    assert matched(f"{way}0001.png", f"{way}0000.png") == [1, 0]


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["a/0000.png", "b/0000.png"], "line 2: b/0000.png is the same picture as a/0000.png on"),
        (["0000.png", "left/0000.png"], "line 2: left/0000.png is the same picture as"),
        (["left/0000.png", "left/0002.png"], "info.txt line 2: no image left/0002.png in left"),
        (["1540821840.6 0001.png"], "line 1: no image 1540821840.6 0001.png"),
    ],
)
def test_lines_without_a_picture_of_their_own_are_named(names, message):
    with pytest.raises(DataError, match=message):
        matched(*names)


def test_pictures_of_two_folders_need_theirs():
    stamps = [Stamp(0, 1, "left/0.png"), Stamp(1, 2, "right/0.png"), Stamp(2, 3, "0.png")]
    paths = ["right/0.png", "left/0.png"]
    assert match(stamps[:2], paths, "t.txt", "") == [1, 0]
    with pytest.raises(DataError, match=r"line 3: no image 0\.png"):
        match(stamps, paths, "t.txt", "")


@pytest.mark.parametrize(
    ("name", "member"),
    [
        ("images/a.png", "images/a.png"),
        ("images\\a.png", "images/a.png"),
        ("./images//a.png", "images/a.png"),
        ("images/../images/a.png", "images/a.png"),
        ("../rec/images/a.png", "images/a.png"),
        ("C:\\clip\\images\\a.png", "images/a.png"),
        ("/home/x/rec/images/a.png", "images/a.png"),
        ("rec/b.png", "b.png"),
        ("other.png", None),
        ("", None),
    ],
)
def test_a_name_in_a_recording_means_a_file_below_it(name, member):
    assert member_of(name, {"images/a.png", "b.png"}.__contains__) == member


# whole inputs


@pytest.fixture
def two_folders(write_images, picture):
    """Folders left and right with two pictures each, and a list of all four beside them."""
    for number, folder in enumerate(("left", "right")):
        write_images([picture(2 * number), picture(2 * number + 1)], folder, "{:04d}.png")
    root = write_images([], "left").parent
    rows = ["left/0000.png 0", "right/0000.png 2000", "left/0001.png 10000", "right/0001.png 12000"]
    (root / "info.txt").write_text("\n".join(rows))
    return root


def test_a_list_of_two_folders_is_an_error(two_folders):
    with pytest.raises(DataError, match=r"info\.txt line 2: right/0000\.png is the same picture"):
        open_source(two_folders / "left")


def test_windows_paths_of_a_recording(write_images, picture):
    images = write_images([picture(0), picture(1)], "rec/images")
    rows = [f"0.{n + 1} C:\\rec\\images\\frame_{n}.png\n" for n in range(2)]
    (images.parent / "images.txt").write_text("".join(rows))
    assert [frame.t_ns for frame in open_source(images.parent).frames()] == [10**8, 2 * 10**8]


@pytest.fixture
def reaching_out(write_images, picture):
    """A recording whose list names an image beside its folder, by the name given."""
    images = write_images([picture(0)], "rec/images")
    outside = write_images([picture(1)], "elsewhere", "secret.png") / "secret.png"

    def write(name):
        (images.parent / "images.txt").write_text(f"0.1 images/frame_0.png\n0.2 {name}\n")
        (images.parent / "events.txt").write_text("0.1 1 1 1\n")
        return images.parent

    return write, outside


@pytest.mark.parametrize(
    "way", ["../elsewhere/secret.png", "/", "images/../../elsewhere/secret.png"]
)
def test_images_outside_a_recording_are_refused(adv2e, reaching_out, way):
    write, outside = reaching_out
    folder = write(str(outside) if way == "/" else way)
    with pytest.raises(DataError, match=r"images\.txt line 2: no image .*secret\.png in "):
        open_source(folder)
    told = adv2e("info", folder)
    assert told.status == 1
    assert "images.txt line 2: no image" in told.err


def test_an_absolute_path_that_is_not_there_is_taken_by_its_end(reaching_out):
    write, _ = reaching_out
    with pytest.raises(DataError, match=r"line 2: no image /gone/frame_0\.png in "):
        open_source(write("/gone/frame_0.png"))
    with pytest.raises(DataError, match=r"line 2: .* is the same picture as .* on line 1"):
        open_source(write("/gone/images/frame_0.png"))

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adv2e.errors import OutputError, UsageError
from adv2e.rendering.films import Film, Sheet, VideoFile, check_suffix, spread, stride_of
from adv2e.rendering.layout import Cell
from adv2e.rendering.styles import Style


def read_film(path):
    video = cv2.VideoCapture(str(path))
    pictures = []
    while (read := video.read())[0]:
        pictures.append(read[1][:, :, ::-1])
    return video.get(cv2.CAP_PROP_FPS), pictures


def noise(rows, columns, seed=0):
    return np.random.default_rng(seed).integers(0, 256, (rows, columns, 3)).astype(np.uint8)


def write(path, pictures, fps=20.0):
    with VideoFile(path, fps) as film:
        for picture in pictures:
            film.add(picture)


def test_avi_loses_nothing(tmp_path):
    pictures = [noise(24, 32, k) for k in range(4)]
    write(tmp_path / "film.avi", pictures)
    fps, found = read_film(tmp_path / "film.avi")
    assert fps == 20
    assert np.array_equal(found, pictures)


def test_mp4_keeps_count_rate_and_colours(tmp_path):
    pictures = [np.full((48, 64, 3), (200, 40, 20), np.uint8) for _ in range(7)]
    write(tmp_path / "film.mp4", pictures, fps=12.5)
    fps, found = read_film(tmp_path / "film.mp4")
    assert fps == pytest.approx(12.5)
    assert len(found) == 7
    assert np.abs(found[3].astype(int) - pictures[3]).max() < 12


def test_odd_sizes_gain_a_line(tmp_path):
    picture = noise(9, 15)
    write(tmp_path / "film.avi", [picture])
    found = read_film(tmp_path / "film.avi")[1][0]
    assert found.shape == (10, 16, 3)
    assert np.array_equal(found[:9, :15], picture)


def test_video_that_cannot_be_written(tmp_path):
    with pytest.raises(OutputError, match="a video cannot be written there"):
        write(tmp_path / "absent" / "film.mp4", [noise(16, 16)])


def test_video_that_came_out_short(tmp_path):
    film = VideoFile(tmp_path / "film.avi", 10)
    film.add(noise(16, 16))
    film.close()
    (tmp_path / "film.avi").write_bytes(b"")  # as on a full disk
    with pytest.raises(OutputError, match="holds 0 of 1 pictures"):
        film.finish()


@pytest.mark.parametrize("name", ["film.mov", "film", "film.jpg"])
def test_unknown_suffixes_are_refused(name):
    with pytest.raises(UsageError, match=rf"{name}: a film ends in .mp4"):
        check_suffix(name)


def test_suffixes_in_capitals():
    assert check_suffix("FILM.MP4") == ".mp4"


@pytest.mark.parametrize("suffix", [".mp4", ".avi", ".gif"])
def test_film_of_cells(tmp_path, suffix):
    path = tmp_path / f"film{suffix}"
    film = Film(path, 10, Style(), scale=2)
    for k in range(3):
        assert film.wanted_from(k) == k
        film.add(k, Cell((noise(20, 30), noise(20, 30)), "text"))
    film.finish()
    assert path.stat().st_size > 500


def add_all(album, count):
    taken = 0
    for k in range(count):
        if album.wanted_from(k) == k:
            album.add(k, Cell((np.full((40, 60, 3), k, np.uint8),), ""))
            taken += 1
    return taken


@pytest.mark.parametrize("count", [1, 4, 5])
def test_sheet_has_all_where_there_are_few(tmp_path, count):
    path = tmp_path / "sheet.png"
    album = Sheet(path, 5, Style(), scale=1)
    add_all(album, count)
    assert list(album._cells) == list(range(count))
    album.finish()
    assert cv2.imread(str(path)).size > 0


def test_sheet_spreads_its_cells_over_all_that_came():
    album = Sheet("unused", 4, Style(), scale=1)
    taken = add_all(album, 200)
    held = list(album._cells)
    assert 8 <= len(held) <= 16
    assert len(set(np.diff(held))) == 1
    assert held[0] < 16
    assert held[-1] > 180
    assert taken < 60  # most are not even drawn


@given(st.integers(1, 5000), st.integers(1, 7))
def test_what_a_sheet_holds_can_be_told_beforehand(instants, count):
    album = Sheet("unused", count, Style(), scale=1)
    number = 0
    while (number := album.wanted_from(number)) < instants:
        album.add(number, Cell((), ""))
        number += 1
    stride = stride_of(instants, count)
    assert [held + 1 for held in album._cells] == list(range(stride, instants + 1, stride))
    shown = spread(len(album._cells), count)
    assert shown == sorted(set(shown))
    assert len(shown) == min(count, instants)
    assert np.ptp(np.diff(shown)) <= 1 if len(shown) > 1 else True

from __future__ import annotations

import cv2
import numpy as np
import pytest

from adv2e.errors import UsageError
from adv2e.rendering.films import Film, Sheet, check_suffix
from adv2e.rendering.styles import Cell, Style


def noise(rows, columns, seed=0):
    return np.random.default_rng(seed).integers(0, 256, (rows, columns, 3)).astype(np.uint8)


@pytest.mark.parametrize("name", ["film.mov", "film", "film.jpg"])
def test_unknown_suffixes_are_refused(name):
    with pytest.raises(UsageError, match=rf"{name}: a film ends in .mp4"):
        check_suffix(name)


def test_suffixes_in_capitals():
    assert check_suffix("FILM.MP4") == ".mp4"


@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".avi", ".gif"])
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


@pytest.mark.parametrize("count", [1, 3, 4])
def test_what_a_sheet_shows_is_even(monkeypatch, tmp_path, count):
    shown = []

    def sheet(cells, style, scale):
        shown.extend(int(cell.panels[0][0, 0, 0]) for cell in cells)
        return cells[0].panels[0]

    monkeypatch.setattr("adv2e.rendering.films.sheet", sheet)
    album = Sheet(tmp_path / "sheet.png", count, Style(), scale=1)
    add_all(album, 250)
    album.finish()
    assert len(shown) == count
    assert np.ptp(np.diff([0, *shown, 250])) <= 60

from __future__ import annotations

import cv2
import numpy as np
import pytest

from adv2e.errors import UsageError
from adv2e.rendering.films import GifFile, palette
from adv2e.rendering.styles import Style


def test_film_holds_size_times_and_colours(tmp_path):
    path = tmp_path / "film.gif"
    style = Style()
    film = GifFile(path, 30, style)
    rng = np.random.default_rng(0)
    choice = np.array([style.on, style.off, style.background, (0, 0, 0), (128, 128, 128)], np.uint8)
    pictures = [choice[rng.integers(0, 5, (13, 31))] for _ in range(6)]
    for picture in pictures:
        film.add(picture)
    film.finish()
    read, found = cv2.imreadanimation(str(path))
    assert read
    assert found.loop_count == 0  # for ever
    # thirtieths of a second in whole hundredths, without drifting away
    assert found.durations.ravel().tolist() == [30, 40, 30, 30, 40, 30]
    for shown, picture in zip(found.frames, pictures, strict=True):
        assert shown.shape[:2] == (13, 31)
        assert np.abs(shown[..., 2::-1].astype(int) - picture).max() <= 4


def test_palette_has_the_colours_of_the_style():
    for name in ("white", "black", "grey", "surface"):
        style = Style(name=name, on=(1, 200, 3), off=(250, 120, 0))
        colours = palette(style)
        assert colours.shape == (256, 3)
        for colour in (*style.colours, style.background, (0, 0, 0), (255, 255, 255)):
            assert np.any(np.all(colours == colour, axis=1))


def test_too_fast_for_a_gif(tmp_path):
    with pytest.raises(UsageError, match="at most 50 pictures a second, not 60"):
        GifFile(tmp_path / "film.gif", 60, Style())

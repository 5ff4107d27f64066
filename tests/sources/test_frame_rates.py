"""Frame rates as people write them."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from adv2e.errors import UsageError
from adv2e.sources import open_source
from adv2e.sources.times.rates import parse_rate


@pytest.mark.parametrize(
    ("given", "hz"),
    [
        (30, Fraction(30)),
        (29.97, Fraction(2997, 100)),
        ("29.97", Fraction(2997, 100)),
        ("30000/1001", Fraction(30000, 1001)),
        (Fraction(24000, 1001), Fraction(24000, 1001)),
        (np.float64(0.5), Fraction(1, 2)),
        ("1e3", Fraction(1000)),
        (".5/2", Fraction(1, 4)),
    ],
)
def test_a_rate_is_what_its_digits_say(given, hz):
    assert parse_rate(given) == hz


@pytest.mark.parametrize(
    "given", ["", "x", "1/0", "0", "-1", "1/-2", "nan", "inf", "1//2", "1e99", "1e-9", "9" * 5000]
)
def test_what_is_no_rate_says_what_would_be_right(given):
    with pytest.raises(ValueError, match="must be"):
        parse_rate(given)
    with pytest.raises(UsageError, match="--fps: must be"):
        open_source("none.npy", fps=given)


@pytest.mark.parametrize("kind", ["npy", "images", "video"])
def test_frames_at_a_fraction_are_exact(write_video, write_images, picture, tmp_path, kind):
    pictures = [picture(n, (24, 32, 3)) for n in range(31)]
    if kind == "npy":
        path = tmp_path / "stack.npy"
        np.save(path, np.stack(pictures))
    else:
        path = write_images(pictures) if kind == "images" else write_video("clip.avi", pictures)
    source = open_source(path, fps="30000/1001")
    times = [frame.t_ns for frame in source.frames()]
    assert times == [round(Fraction(n * 1001 * 10**9, 30000)) for n in range(31)]
    assert times[30] == 1_001_000_000
    if kind == "video":
        assert source.notes[0] == "--fps 30000/1001 replaces the times in the file"

"""The rate of events over time: what is counted, and where the picture has its lines."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

import adv2e
from adv2e.errors import DataError, UsageError
from adv2e.events import make_events
from adv2e.rendering.rate import Rates

RED, BLUE, INK = (214, 30, 36), (24, 84, 205), (20, 20, 20)
SIZE = (8, 6)


def even(on, off, length_us=1_000_000, begin_us=0):
    """Return so many ON and OFF events, evenly over a time that they fill."""
    times = [np.arange(n) * length_us // n for n in (on, off)]
    t = np.concatenate([*times, [length_us - 1]]) + begin_us
    p = np.repeat([1, 0, 1], [on, off, 1])
    order = np.argsort(t, kind="stable")
    return make_events(t[order], t[order] % 8, t[order] % 6, p[order])


def heights(picture):
    """Return how high above the axis the lines lie that are longest in each colour [pixels]."""

    def row_of(colour, rows=slice(30, None)):
        apart = np.abs(picture[rows].astype(int) - colour).max(axis=2)
        near = np.clip(1 - apart / 150, 0, 1)  # a line between two rows is pale in both
        return rows.start + int(np.argmax(near.sum(axis=1)))

    axis = picture.shape[0] - 52
    return [axis - row_of(colour, slice(30, axis - 3)) for colour in (RED, BLUE, INK)]


def test_lines_are_as_high_as_the_rates():
    on, off, both = heights(adv2e.render(even(30_000, 10_000), size=SIZE, style="rate"))
    assert both > 200
    assert on / both == pytest.approx(3 / 4, abs=0.02)
    assert off / both == pytest.approx(1 / 4, abs=0.02)


def test_a_line_falls_where_the_events_end():
    """All OFF events lie in the first quarter of the time."""
    events = np.sort(np.concatenate([even(10_000, 1), even(1, 5_000, 250_000)]), order="t")
    picture = adv2e.render(events, size=SIZE, style="rate").astype(int)
    blue = np.abs(picture - BLUE).max(axis=2) < 40
    high = np.flatnonzero(blue[44:200].any(axis=0))
    left, right = 62, 960 - 16
    # the name of the line stands at the right, above row 44
    assert (high.min() - left) / (right - left) == pytest.approx(0, abs=0.01)
    assert (high.max() - left) / (right - left) == pytest.approx(0.25, abs=0.01)


def test_counts_are_those_of_all_bins_whatever_the_pieces():
    rng = np.random.default_rng(3)
    t = np.sort(rng.integers(-5_000, 12_345, 9_000))
    events = make_events(t, t % 8, t % 6, rng.integers(0, 2, 9_000))
    rates = Rates(-5_000, 12_345, 1000)
    for part in np.array_split(events, 7):
        rates.add(part)
    assert rates.width_us == 100
    expected = [np.histogram(t[events["p"] == p], rates.edges_us)[0] for p in (0, 1)]
    np.testing.assert_array_equal(rates.counts, expected)
    # the last bin has 45 of the 100 us
    assert rates.per_second[1, -1] == pytest.approx(rates.counts[1, -1] / 45e-6)


@pytest.mark.parametrize(
    ("length_us", "bins", "width_us"),
    [(1, 300, 100), (30_000, 300, 100), (30_001, 300, 200), (3_600_000_000, 1000, 5_000_000)],
)
def test_bins_are_round(length_us, bins, width_us):
    rates = Rates(7, 7 + length_us, bins)
    assert rates.width_us == width_us
    assert rates.counts.shape[1] <= bins


def test_from_the_command_and_from_python(tmp_path, adv2e, monkeypatch):
    import adv2e as package

    monkeypatch.chdir(tmp_path)
    package.write_events("e.h5", even(3_000, 1_000, begin_us=-400_000), SIZE)
    given = ("--start", 0.2, "--stop", 0.6, "--window", 10, "--scale", 2)
    told = "e.h5: times begin below zero, at -0.400000 s\na.png: written\n"
    for _ in range(2):
        done = adv2e("render", "e.h5", "-o", "a.png", "--style", "rate", *given, "--overwrite")
        assert (done.status, done.err) == (0, told)
    options = {"start_s": 0.2, "stop_s": 0.6, "window_ms": 10, "scale": 2}
    picture = package.render("e.h5", style="rate", **options)
    np.testing.assert_array_equal(cv2.imread("a.png")[:, :, ::-1], picture)
    assert picture.shape == (680, 1920, 3)


@pytest.mark.parametrize(
    ("output", "options", "text"),
    [
        ("a.mp4", (), "a.mp4: --style rate makes one .png"),
        ("a.png", ("--at", "0.1"), "leave --at out"),
        ("a.png", ("--window", "0.001"), "--window is too short: 1,000,000 of them"),
    ],
)
def test_what_cannot_be(tmp_path, adv2e, monkeypatch, output, options, text):
    import adv2e as package

    monkeypatch.chdir(tmp_path)
    package.write_events("e.h5", even(300, 100), SIZE)
    done = adv2e("render", "e.h5", "-o", output, "--style", "rate", *options)
    assert done.status == 2
    assert text in done.err
    assert done.err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["e.h5"]


def test_in_python_errors_name_arguments():
    with pytest.raises(UsageError, match="window_ms is too short: 1,000,000 of them"):
        adv2e.render(even(3, 1), size=SIZE, style="rate", window_ms=0.001)
    with pytest.raises(DataError, match="nothing is left from 3 s on"):
        adv2e.render(even(3, 1), size=SIZE, style="rate", start_s=3)

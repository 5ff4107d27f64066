"""Recordings of known films: what is fitted of the view, and what is found of the camera.

The recordings are those of the brute-force camera, before pictures that are sums of Gaussians: so
their blur and their motion are known in closed form.
"""

import json
from dataclasses import dataclass

import cv2
import numpy as np
import pytest
from camera import Camera, patchwork
from camera.scene import AnyScene, View

from adv2e import load_config
from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.film.fitting import FilmFitter, Place, first_point
from adv2e.diagnosis.film.nearness import DISTANCES, TOLD, distances
from adv2e.diagnosis.film.recordings import read_pairs, read_recordings, split
from adv2e.diagnosis.film.registration import first_delays, first_view
from adv2e.diagnosis.film.residual import Counting
from adv2e.diagnosis.film.view import STEP_NS, Films
from adv2e.diagnosis.film.view import View as FilmView
from adv2e.diagnosis.fitting.candidates import Candidate, FitParameter
from adv2e.diagnosis.fitting.fitted import Fitted
from adv2e.diagnosis.fitting.library import names
from adv2e.diagnosis.outcome.findings import finding_of
from adv2e.errors import DataError
from adv2e.events import EVENT_DTYPE
from adv2e.geometry import Size

SIZE, SECONDS = Size(20, 20), 0.25
BLUR_PX, BLACK = 0.6, 0.1


def path(t):
    """Return where the camera looks at times [s], (times, 2) [px]: a circle, from rest to rest."""
    u = np.clip((t - 0.02) / 0.2, 0.0, 1.0)
    turn = 2 * np.pi * (u - np.sin(2 * np.pi * u) / (2 * np.pi))
    return np.stack([2.2 * np.cos(turn), 2.2 * np.sin(turn) - 0.5], axis=-1)


@dataclass(frozen=True)
class Blobs(AnyScene):
    """A picture of Gaussians, (blobs, 4): column, row, size [px], height."""

    blobs: np.ndarray
    inverted: bool
    late_s: float

    def numbers(self, x, y, blur=0.0):
        total = 0.0
        for column, row, size, height in self.blobs:
            wide = size**2 + blur**2
            square = (x - column) ** 2 + (y - row) ** 2
            total = total + height * size**2 / wide * np.exp(-square / (2 * wide))
        return total

    def view(self, columns, rows):
        x, y = np.meshgrid(columns - (SIZE.width - 1) / 2, rows - (SIZE.height - 1) / 2)
        return _Seen(self, x.ravel(), y.ravel())


@dataclass(frozen=True)
class _Seen(View):
    scene: Blobs
    x: np.ndarray
    y: np.ndarray

    def light(self, times):
        dx, dy = path(times - self.scene.late_s).T
        v = self.scene.numbers(self.x + dx[:, None], self.y + dy[:, None], BLUR_PX)
        return 255.0 * (BLACK + (1.0 - BLACK) * (1.0 - v if self.scene.inverted else v))


def blobs(seed):
    random = np.random.default_rng([seed, 60])
    count = 7
    places = random.uniform(-4.5, 4.5, (count, 2))
    return np.column_stack(
        [places, random.uniform(0.8, 1.4, count), random.uniform(0.3, 0.6, count)]
    )


@pytest.fixture
def recorded(tmp_path):
    """Return what records a camera before pictures, and gives the table of both."""

    def record(hidden, count, *, inverted, late_s=()):
        lines = ["events,film\n"]
        middle = np.arange(24) - 11.5
        for k in range(count):
            scene = Blobs(blobs(k), inverted, late_s[k] if k < len(late_s) else 0.0)
            picture = scene.numbers(*np.meshgrid(middle, middle)).clip(0, 1)
            film = tmp_path / f"{k}.png"
            assert cv2.imwrite(str(film), np.rint(65535 * picture).astype(np.uint16))
            camera = Camera(
                scene, hidden=hidden, size=SIZE, duration_s=SECONDS, fps=20.0, seed=k, step_us=50.0
            )
            camera.record(tmp_path / f"{k}.zip")
            lines.append(f"{k}.zip,{film.name}\n")
        (tmp_path / "pairs.csv").write_text("".join(lines), "utf-8")
        return tmp_path / "pairs.csv"

    return record


@pytest.mark.thorough
def test_a_dead_time_is_found_behind_a_view_that_nobody_knows(adv2e, tmp_path, recorded):
    late_s = [0.0, 0.0, 0.008]
    pairs = recorded(
        {"pixel": {"refractory": {"period_us": 5000.0}}}, 16, inverted=False, late_s=late_s
    )
    tried = "refractory", "leak", "dead_pixels"
    without = [part for name in names() if name not in tried for part in ("--without", name)]
    outcome = adv2e(
        "diagnose", "--films", pairs, "-c", tmp_path / "0.declared.yaml", "-o", tmp_path / "out",
        *without,
    )  # fmt: skip
    assert outcome.status == 0, outcome.err
    found = json.loads((tmp_path / "out" / "report.json").read_text("utf-8"))
    assert [one["name"] for one in found["effects"]] == ["refractory"]
    (period_us,) = found["effects"][0]["parameters"].values()
    assert period_us == pytest.approx(5000.0, rel=0.1)
    assert found["error"]["after"] < 0.5 * found["error"]["before"]
    view = {one["name"]: one["value"] for one in found["view"]}
    assert view["inverted"] is False
    assert view["scale"] == pytest.approx(1.0, abs=0.05)
    assert view["turn_rad"] == pytest.approx(0.0, abs=0.04)
    assert BLACK / 3 < view["black"] < 3 * BLACK
    # a line between the numbers of a picture blurs it by 0.41 px
    assert np.hypot(view["blur_px"], 0.41) == pytest.approx(BLUR_PX, abs=0.2)
    # nothing tells where the camera looked before and after it moved but what then came
    moving = np.array([row for row in view["path"] if 80.0 < row[0] < 180.0])
    late_ms = np.array(view["late_ms"])
    common_s = 1e-3 * np.median(np.delete(late_ms, 2))
    away = moving[:, 1:] - path(1e-3 * moving[:, 0] + common_s)
    assert np.sqrt(np.mean(away**2)) < 0.3
    assert late_ms[2] - np.median(late_ms) == pytest.approx(8.0, abs=1.0)
    page = (tmp_path / "out" / "report.html").read_text("utf-8")
    assert "View of the film, which was fitted" in page


@pytest.mark.parametrize("inverted", [False, True])
def test_events_tell_where_a_camera_looked_and_whether_the_picture_was_inverted(recorded, inverted):
    pairs = recorded({}, 4, inverted=inverted)
    recordings = read_recordings(read_pairs(pairs))
    view = first_view(recordings.films, recordings.stream)
    assert view.inverted is inverted
    times_s = recordings.films.times_ns * 1e-9
    moving = (times_s > 0.08) & (times_s < 0.18)
    away = (recordings.films.positions(view) - path(times_s))[moving]
    assert np.sqrt(np.mean(away**2)) < 0.8


def test_a_ramp_is_seen_where_the_view_says():
    rows, columns = np.mgrid[:30, :40]
    picture = (0.2 + 0.01 * columns + 0.005 * rows).astype(np.float32)
    films = Films([picture[None]], np.arange(0, 50_000_001, STEP_NS), Size(16, 12))
    knots = len(films.knots_ns)
    view = FilmView(
        np.tile([1.5, -2.25], (knots, 1)), scale=1.1, turn_rad=0.2, blur_px=0.4, black=0.25
    )
    light = films.light(view)
    y, x = np.mgrid[:12, :16] - np.array([5.5, 7.5])[:, None, None]
    right = 1.1 * (np.cos(0.2) * x - np.sin(0.2) * y) + 1.5 + 19.5
    down = 1.1 * (np.sin(0.2) * x + np.cos(0.2) * y) - 2.25 + 14.5
    expected = 255 * (0.25 + 0.75 * (0.2 + 0.01 * right + 0.005 * down))
    np.testing.assert_allclose(light, np.broadcast_to(expected, light.shape), atol=0.15)
    inverted = films.light(FilmView(view.path, True, 1.1, 0.2, 0.4, 0.25))
    expected = 255 * (0.25 + 0.75 * (0.8 - 0.01 * right - 0.005 * down))
    np.testing.assert_allclose(inverted[0], expected, atol=0.15)


def test_a_path_is_at_rest_where_its_knots_are_alike_and_moves_as_a_line():
    films = Films([np.zeros((1, 8, 8), np.float32)], np.arange(0, 100_000_001, STEP_NS), Size(8, 8))
    knots_s = films.knots_ns * 1e-9
    line = FilmView(np.column_stack([3.0 * knots_s, np.full(len(knots_s), 0.5)]))
    found = films.positions(line)
    np.testing.assert_allclose(found[:, 0], 3.0 * films.times_ns * 1e-9, atol=1e-12)
    np.testing.assert_allclose(found[:, 1], 0.5, atol=1e-12)


def _events(seed, count, shift_us=0):
    random = np.random.default_rng(seed)
    events = np.zeros(count, EVENT_DTYPE)
    t = np.concatenate(
        [random.normal(60e3, 12e3, count // 2), random.normal(150e3, 8e3, count - count // 2)]
    )
    events["t"] = np.sort(t.clip(0, 199e3).astype(np.int64)) + shift_us
    events["x"], events["y"] = random.integers(0, 10, (2, count))
    events["p"] = random.integers(0, 2, count)
    return events


def _stream(recordings):
    moved = []
    for k, events in enumerate(recordings):
        one = events.copy()
        one["x"] += 10 * k
        moved.append(one)
    every = np.concatenate(moved)
    return Stream.of(every[np.argsort(every["t"], kind="stable")], 10 * len(recordings), 10)


def test_recordings_that_begin_late_are_told_by_their_courses():
    shifts_us = [0, 0, 12_000, 0, -5_000, 0, 0]
    stream = _stream([_events(k, 3000, shift) for k, shift in enumerate(shifts_us)])
    np.testing.assert_allclose(first_delays(stream, 7), shifts_us, atol=1500)


def test_numbers_are_those_of_a_slow_count():
    recordings = [_events(k, 400) for k in range(3)]
    stream = _stream(recordings)
    counting = Counting(10, 10, 3, (0.0, 200e3))
    numbers = counting.numbers(stream)
    for k, events in enumerate(recordings):
        course = np.zeros((2, counting.bins))
        gaps = []
        last = {}
        for t, x, y, p in events[["t", "x", "y", "p"]].tolist():
            course[int(p), min(int(t / 200e3 * counting.bins), counting.bins - 1)] += 1
            if (x, y) in last:
                gaps.append(t - last[x, y])
            last[x, y] = t
        np.testing.assert_allclose(
            numbers.others[k, : 2 * counting.bins] ** 2 - 3 / 8, course.ravel(), atol=1e-9
        )
        told = (numbers.others[k, 2 * counting.bins :] ** 2 - 3 / 8).sum()
        # those of 2 to 100 us have a place of their own, and none is longer than a second
        assert told == pytest.approx(len(gaps))
        back = split(stream, 3)[k]
        np.testing.assert_array_equal(
            np.sort(back, order=["t", "x", "y", "p"]), np.sort(events, order=["t", "x", "y", "p"])
        )


def test_recordings_of_one_law_are_near_and_thinned_ones_are_not():
    measured = [_events(k, 1400 + 10 * k) for k in range(20)]
    alike = [_events(100 + k, 1400 + 10 * k) for k in range(20)]
    fewer = [one[::2] for one in alike]
    size, span = Size(10, 10), (0, 200_000)
    near, far = (distances(measured, other, size, span) for other in (alike, fewer))
    assert list(near) == list(DISTANCES)
    assert near[TOLD] < 0.8 < far[TOLD]
    assert all(
        abs(value) < 1e-12
        for name, value in distances(measured, measured, size, span).items()
        if name != TOLD
    )


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("a,b\n1,2\n", "needs the columns events and film"),
        ("events,film\n", "there are no rows below the header"),
        ("events,film\nx.h5,\n", "csv:2: film: is empty, must be the name of a file"),
    ],
)
def test_a_table_of_films_that_is_none(tmp_path, text, wrong):
    (tmp_path / "pairs.csv").write_text(text, "utf-8")
    with pytest.raises(DataError, match=wrong):
        read_pairs(tmp_path / "pairs.csv")


@pytest.mark.parametrize(
    ("arguments", "wrong"),
    [
        (["a.h5", "b.h5"], "2 recordings are given: one is diagnosed"),
        (["a.h5", "b.h5", "--films", "a.csv"], "--films: its table names the events"),
        ([], "0 recordings are given"),
        (["a.h5", "--film", "a.png", "--light", "b.csv"], "--light and --film: give one of them"),
        (["--film", "a.png"], "--film: give the recordings"),
        (["a.h5", "--films", "a.csv"], "--films: its table names the events"),
        (["a.h5", "--film", "a.png", "--start", "1"], "leave --start, --stop and --crop out"),
    ],
)
def test_options_that_go_not_together(adv2e, tmp_path, arguments, wrong):
    outcome = adv2e("diagnose", *arguments, "-o", tmp_path / "out")
    assert outcome.status == 2
    assert wrong in outcome.err
    assert not (tmp_path / "out").exists()


@pytest.mark.thorough
def test_a_video_is_seen_where_it_was_shifted_to(adv2e, tmp_path):
    hidden = {"frames": {"shift_px": [1.5, -1.0]}}
    scene = patchwork((32, 24), seed=5)
    camera = Camera(scene, hidden=hidden, size=(32, 24), duration_s=0.6, fps=250.0, seed=5)
    camera.record(tmp_path / "seen.zip")
    tried = "refractory", "leak"
    without = [part for name in names() if name not in tried for part in ("--without", name)]
    outcome = adv2e(
        "diagnose", tmp_path / "seen.zip", "--film", tmp_path / "seen.zip",
        "-c", tmp_path / "seen.declared.yaml", "-o", tmp_path / "out", *without,
    )  # fmt: skip
    assert outcome.status == 0, outcome.err
    found = json.loads((tmp_path / "out" / "report.json").read_text("utf-8"))
    view = {one["name"]: one["value"] for one in found["view"]}
    ((_, right, down),) = view["path"]
    # the picture in the frames lies right of and below that of the events by the shift
    assert (right, down) == pytest.approx((1.5, -1.0), abs=0.2)
    assert view["inverted"] is False
    assert view["scale"] == pytest.approx(1.0, abs=0.02)
    assert found["effects"] == []


def test_a_number_that_the_recordings_do_not_tell_may_be_anything(recorded):
    recordings = read_recordings(read_pairs(recorded({}, 4, inverted=False)))
    fitter = FilmFitter(recordings.films, recordings.stream, 1)
    # no event is within so short a time of another, so none is lost
    key = FitParameter("pixel.refractory.period_us", 1e-3, 1e6)
    keys = Candidate("refractory", (key,), ((1e-3,),))
    declared = load_config(["ideal"], ["pixel.refractory.period_us=0.001", "sampling.L=1"])
    place = Place(first_view(recordings.films, fitter.measured), declared, keys, first_point(keys))
    ((variance,),) = fitter.covariance(place, 1.0)
    assert np.isinf(variance)
    fit = Fitted(keys, declared, place.point, covariance=np.array([[variance]]))
    assert finding_of(fit, 1, declared).interval[key.key] == (1e-3, 1e6)

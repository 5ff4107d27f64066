"""Pages on which to look at events: what is in them, found out by a decoder of its own."""

from __future__ import annotations

import base64
import json
import re
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from written_recordings import write_recording

import adv2e
from adv2e.errors import DataError, OutputError, UsageError
from adv2e.events import make_events
from adv2e.formats.recording import Recording
from adv2e.rendering import view as module
from adv2e.rendering.view import MOST_BYTES, view

SIZE = (346, 260)


def element(page, name):
    (found,) = re.findall(rf'<script id="{name}" type="[^"]*">([^<]*)</script>', page)
    return found


def facts_of(page):
    return json.loads(element(page, "facts"))


def events_of(page):
    """Return (t since the first event or frame, x, y, p) of each event of a page, as lists."""
    facts = facts_of(page)
    data = zlib.decompress(base64.b64decode(element(page, "events"), validate=True))
    count = facts["drawn"]
    assert len(data) == 11 * count + -(-count // 8)

    def column(first, planes):
        return [
            sum(data[(first + k) * count + n] << 8 * k for k in range(planes)) for n in range(count)
        ]

    steps, x, y = column(0, 7), column(7, 2), column(9, 2)
    t, now = [], facts["begin"]
    for one in steps:
        now += one
        t.append(now)
    bits = "".join(f"{byte:08b}" for byte in data[11 * count :])
    assert not bits[count:].strip("0")
    return list(zip(t, x, y, map(int, bits[:count]), strict=True))


def random_events(count, size=SIZE, length_us=2_000_000, begin_us=0, seed=1):
    rng = np.random.default_rng(seed)
    t = np.sort(rng.integers(begin_us, begin_us + length_us, count))
    x, y = (rng.integers(0, most, count) for most in size)
    return make_events(t, x, y, rng.random(count) < 0.6)


def plain(events, origin=0):
    return [(int(t) - origin, int(x), int(y), int(p)) for t, x, y, p in events.tolist()]


@pytest.mark.parametrize("count", [1, 2, 7, 8, 9, 3000])
@pytest.mark.parametrize("begin_us", [0, -700_000, 1_468_939_993_067_416])
def test_all_events_of_a_small_recording_are_on_the_page(count, begin_us):
    events = random_events(count, (1280, 720), begin_us=begin_us)
    events["t"][-1:] = events["t"][-2:-1] if count > 1 else events["t"][-1:]  # two of one time
    page = view(events, size=(1280, 720))
    assert events_of(page) == plain(events, int(events["t"][0]))
    facts = facts_of(page)
    assert (facts["width"], facts["height"], facts["every"]) == (1280, 720, 1)
    assert (facts["begin"], facts["stop"]) == (0, int(events["t"][-1] - events["t"][0]) + 1)
    assert [sum(facts["off"]), sum(facts["on"])] == np.bincount(events["p"], minlength=2).tolist()
    assert "all events drawn" in page


def test_hours_and_years_between_two_events():
    year_us = 366 * 86_400 * 10**6
    for apart in (3 * 3600 * 10**6, 100 * year_us):
        events = make_events([5, 5 + apart], [0, 3], [0, 2], [1, 0])
        page = view(events, size=(4, 3))
        assert events_of(page) == [(0, 0, 0, 1), (apart, 3, 2, 0)]
        assert len(facts_of(page)["on"]) <= 1000


@pytest.fixture(scope="module")
def five_million():
    return random_events(5_000_000, length_us=60_000_000)


@pytest.fixture(scope="module")
def large_page(five_million):
    return view(five_million, size=SIZE)


def test_a_page_of_five_million_events_keeps_to_its_size(five_million, large_page):
    size = len(large_page.encode())
    assert MOST_BYTES == 3_000_000
    assert 0.75 * MOST_BYTES < size <= MOST_BYTES
    facts = facts_of(large_page)
    assert sum(facts["on"]) + sum(facts["off"]) == 5_000_000
    begin = int(five_million["t"][0])
    edges = begin + facts["bin"] * np.arange(len(facts["on"]) + 1)
    on = np.histogram(five_million["t"][five_million["p"] == 1], edges)[0]
    assert facts["on"] == on.tolist()
    assert f"1 of {facts['every']:,} events drawn" in large_page
    assert "5,000,000 events" in large_page


def test_events_that_are_drawn_are_of_the_recording_and_evenly_spread(five_million, large_page):
    drawn, every = events_of(large_page), facts_of(large_page)["every"]
    assert every > 1
    assert len(drawn) == pytest.approx(5_000_000 / every, rel=1e-3)
    origin = int(five_million["t"][0])

    def numbers(t, x, y, p):  # one for each kind of event, and how often there is one
        return np.unique(((t * 346 + x) * 260 + y) * 2 + p, return_counts=True)

    here, often = numbers(five_million["t"] - origin, *(five_million[name] for name in "xyp"))
    seen, drawn_often = numbers(*np.array(drawn).T)
    place = np.searchsorted(here, seen)
    assert np.array_equal(here[place], seen)
    assert np.all(drawn_often <= often[place])
    assert drawn == sorted(drawn, key=lambda event: event[0])
    places = np.searchsorted(five_million["t"] - origin, [event[0] for event in drawn])
    tenths = np.histogram(places, 100, (0, 5_000_000))[0]
    assert np.ptp(tenths) < 0.01 * tenths.mean()
    assert np.mean([event[3] for event in drawn]) == pytest.approx(0.6, abs=0.005)


@pytest.mark.parametrize("every", [2, 3, 7, 12, 64])
def test_patterns_of_the_sensor_do_not_keep_step_with_what_is_drawn(every):
    """All pixels row by row, ON and OFF in turn, as a display that flashes gives them."""
    width, height = 346, 260
    pixel = np.tile(np.arange(width * height), 8)
    events = make_events(np.arange(pixel.size), pixel % width, pixel // width, pixel % 2)
    thinned = module.Thinned()
    thinned.add(events)
    drawn = thinned.thin(every)
    share = pixel.size / every
    assert drawn.size == pytest.approx(share, rel=0.001)
    assert np.mean(drawn["p"]) == pytest.approx(0.5, abs=0.01)
    for name, most in (("x", width), ("y", height)):
        counts = np.bincount(drawn[name], minlength=most)
        assert counts.min() > 0.5 * share / most
        assert counts.max() < 1.6 * share / most


def test_pieces_and_bounds_make_no_difference(monkeypatch):
    monkeypatch.setattr(module, "_MOST_DRAWN", 500)
    events = random_events(20_000)
    pages, held = [], []
    add = module.Thinned.add

    def noted(self, part):
        add(self, part)
        held.append(sum(part.size for part, _ in self._parts))

    monkeypatch.setattr(module.Thinned, "add", noted)
    for chunk in (1 << 18, 700, 33):
        monkeypatch.setattr(module, "_CHUNK", chunk)
        pages.append(view(events, size=SIZE))
    assert len(set(pages)) == 1
    assert facts_of(pages[0])["every"] == 40
    assert max(held[1:]) <= 1000  # of the first, which came at once, all were held
    assert len(events_of(pages[0])) == pytest.approx(500, abs=5)


def test_file_recording_and_array_give_the_same(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    events = random_events(5_000, begin_us=2_000_000)
    adv2e.write_events("e.h5", events, SIZE)
    recording = adv2e.read_events("e.h5")
    given = {"start_s": 0.25, "stop_s": 1.5}
    page = view(events, size=SIZE, **given)
    of_file, of_recording = view("e.h5", **given), view(recording, **given)
    recording.view("a.html")
    assert Path("a.html").read_text("utf-8") == view("e.h5")
    assert of_file == of_recording
    assert facts_of(page) == facts_of(of_file)
    origin = int(events["t"][0])
    inside = (events["t"] >= origin + 250_000) & (events["t"] < origin + 1_500_000)
    assert events_of(page) == events_of(of_file) == plain(events[inside], origin)
    assert (facts_of(page)["begin"], facts_of(page)["stop"]) == (250_000, 1_500_000)


@pytest.fixture
def with_frames(tmp_path):
    events = random_events(2_000, (64, 48), begin_us=20_000, length_us=980_000)
    frames = [np.full((48, 64), 20 * k, np.uint8) for k in range(1, 11)]
    frames[4][:24] = 250
    return write_recording(tmp_path / "rec", np.arange(10) * 0.1, frames, events)


def test_frames_are_beneath_at_their_times(with_frames):
    page = view(with_frames, start_s=0.35, stop_s=0.85)
    frames = facts_of(page)["frames"]
    # that before the start is shown at the start
    assert [at for at, _ in frames] == [300_000, 400_000, 500_000, 600_000, 700_000, 800_000]
    for number, (_, source) in enumerate(frames, 4):
        kind, data = source.split(";base64,")
        assert kind == "data:image/webp"
        image = cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_GRAYSCALE)
        assert image.shape == (48, 64)
        assert image[36:].mean() == pytest.approx(20 * number, abs=4)
        assert image[:12].mean() == pytest.approx(250 if number == 5 else 20 * number, abs=4)
    assert "6 of 6 frames" in page
    assert not facts_of(view(with_frames, no_frames=True))["frames"]
    assert view(adv2e.read_events(with_frames), start_s=0.35, stop_s=0.85) == page


def test_frames_keep_to_their_share_of_the_page():
    rng = np.random.default_rng(2)
    frames = 200
    read = []

    def images():
        for _ in range(frames):
            read.append(1)
            yield rng.integers(0, 256, (360, 640, 3), np.uint8)

    times = np.arange(frames) * 10_000_000
    events = random_events(100_000, (640, 360), length_us=4_000_000)
    recording = Recording("noise", "array", 640, 360, events, times, images=images)
    page = view(recording)
    found = facts_of(page)["frames"]
    assert len(page.encode()) <= MOST_BYTES
    assert 5 < len(found) < 160
    assert f"{len(found)} of 200 frames" in page
    assert max(np.diff([at for at, _ in found])) <= 2 * min(np.diff([at for at, _ in found]))
    assert facts_of(page)["every"] == 1


def test_a_page_without_events_says_so(tmp_path):
    adv2e.write_events(tmp_path / "none.h5", random_events(0), SIZE)
    page = view(tmp_path / "none.h5")
    assert events_of(page) == []
    assert "0 events" in page
    (tmp_path / "none.txt").write_text("")
    with pytest.raises(DataError, match=r"none\.txt: no events, and no size of the sensor"):
        view(tmp_path / "none.txt")


def test_nothing_is_loaded_from_elsewhere(large_page, with_frames):
    for page in (large_page, view(with_frames)):
        assert "default-src 'none'; img-src data:;" in page
        assert not re.search(r"https?:|//[a-z]+\.|@import|url\(", page)
        sources = re.findall(r'(?:src|href)\s*=\s*["\']([^"\']*)', page)
        assert all(one.startswith("data:") for one in sources)


def test_names_and_doubts_stay_text():
    name = "</script><b>{{script}} & \x1b.h5"
    recording = Recording(
        name, "array", 4, 3, random_events(3, (4, 3)), problems=["<i>odd</i> {{told}}"]
    )
    page = view(recording)
    assert "<b>" not in page
    assert "<i>" not in page
    assert "\x1b" not in page
    assert page.count("<script") == 3
    assert "&lt;b&gt;{{script}} &amp; " in page
    assert "&lt;i&gt;odd&lt;/i&gt; {{told}}" in page


def test_written_by_the_command(tmp_path, adv2e, monkeypatch):
    import adv2e as package

    monkeypatch.chdir(tmp_path)
    package.write_events("clip.events.h5", random_events(4_000), SIZE)
    first = adv2e("view", "clip.events.h5")
    assert (first.status, first.out) == (0, "")
    assert first.err == "clip.events.view.html: written\n"
    made = Path("clip.events.view.html").read_bytes()
    assert made.decode() == view("clip.events.h5")
    again = adv2e("view", "clip.events.h5")
    assert again.status == 1
    assert "clip.events.view.html: exists already; --overwrite replaces it" in again.err
    assert adv2e("view", "clip.events.h5", "-q", "--overwrite").err == ""
    assert Path("clip.events.view.html").read_bytes() == made
    part = adv2e("view", "clip.events.h5", "-o", "b.html", "--start", 0.5, "--crop", "10,20,30,40")
    assert part.status == 0
    facts = facts_of(Path("b.html").read_text("utf-8"))
    assert (facts["width"], facts["height"], facts["begin"]) == (30, 40, 500_000)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "b.html",
        "clip.events.h5",
        "clip.events.view.html",
    ]


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--start", "9"], "e.h5: lasts 1.986 s, nothing is left from 9 s on"),
        (["--start", "2", "--stop", "1"], "--stop 1 must be after --start 2"),
        (["--crop", "0,0,999,9"], "--crop 0,0,999,9 does not lie on the sensor of 346x260"),
        (["-o", "e.h5", "--overwrite"], "e.h5: is read and would be lost"),
        (["-o", "e.h5/a.html"], "e.h5 is not a folder"),
        (["--scale", "2"], "No such option"),
    ],
)
def test_wrong_command_lines(tmp_path, adv2e, monkeypatch, options, text):
    import adv2e as package

    monkeypatch.chdir(tmp_path)
    package.write_events("e.h5", random_events(400), SIZE)
    done = adv2e("view", "e.h5", *options)
    assert done.status in (1, 2)
    assert text in done.err
    assert done.err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["e.h5"]


def test_what_cannot_be_in_python(tmp_path):
    with pytest.raises(UsageError, match="an array of events needs"):
        view(random_events(3))
    with pytest.raises(UsageError, match="time_unit: is of the reading of a file"):
        view(random_events(3), size=SIZE, time_unit="us")
    (tmp_path / "a.html").touch()
    with pytest.raises(OutputError, match="exists already"):
        Recording("r", "array", *SIZE, random_events(3)).view(tmp_path / "a.html")


def test_what_is_doubtful_is_on_the_page_and_told(tmp_path, adv2e):
    path = tmp_path / "e.txt"
    path.write_text("-0.5 1 2 1\n0.25 3 4 0\n")
    done = adv2e("view", path, "-o", tmp_path / "a.html")
    assert done.err.splitlines()[0].startswith(f"{path}: ")
    assert "times begin below zero" in done.err or "no geometry stated" in done.err
    page = (tmp_path / "a.html").read_text("utf-8")
    assert "no geometry stated: 4x5" in page
    assert events_of(page) == [(0, 1, 2, 1), (750_000, 3, 4, 0)]

from __future__ import annotations

import cv2
import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.events import empty_events, make_events
from adv2e.formats.reading import Recording
from adv2e.rendering import films, styles
from adv2e.rendering.recording import render_recording
from adv2e.rendering.styles import Style

EPOCH = 1_470_000_000_000_000  # us


def recording(events=None, frames=None, start=EPOCH):
    """Return 1 s of events at every 1 ms, and of frames at every 50 ms from 25 ms on."""
    if events is None:
        events = make_events(
            start + np.arange(0, 1_000_000, 1000), [3] * 1000, [2] * 1000, [1] * 1000
        )
    times = None if frames is None else (start + 25_000 + 50_000 * np.arange(frames)) * 1000
    images = [np.full((24, 32), 10 * k + 1, np.uint8) for k in range(frames or 0)]
    return Recording("rec", "text", 32, 24, events, times, images=lambda: iter(images))


@pytest.fixture
def cells(monkeypatch, tmp_path):
    """Render to a file; return the captions and the grey levels of the frames, if any."""

    def render(what, name="out.avi", **more):
        seen = []

        def compose(cell, *rest):
            frame = int(cell.panels[0][0, 0, 0]) if len(cell.panels) > 1 else None
            seen.append((cell.caption, frame))
            return original(cell, *rest)

        original = films.compose if name.endswith("avi") else styles.compose
        with monkeypatch.context() as patch:
            patch.setattr(films if name.endswith("avi") else styles, "compose", compose)
            render_recording(what, tmp_path / name, scale=1, **more)
        return seen

    return render


def test_film_of_all_events(cells):
    seen = cells(recording(), fps=10, style=Style(window_us=100_000))
    assert [text for text, _ in seen] == [f"{k / 10:.3f} s   100 events" for k in range(1, 11)]


def test_film_of_a_part(cells):
    seen = cells(recording(), fps=10, start_s=0.3, stop_s=0.5, style=Style(window_us=100_000))
    assert [text.split()[2] for text, _ in seen] == ["100", "100"]
    assert [text.split()[0] for text, _ in seen] == ["0.400", "0.500"]


def test_frames_stand_beside_their_events(cells):
    seen = cells(recording(frames=20), fps=20, style=Style(window_us=50_000))
    # picture k ends 50 ms k after the first event, where the last frame is 25 ms old
    assert [level for _, level in seen] == [10 * k + 1 for k in range(20)]
    assert all(text.endswith(" 50 events") for text, _ in seen)


def test_part_begins_with_the_frame_before_it(cells):
    seen = cells(recording(frames=20), fps=20, start_s=0.51, stop_s=0.59)
    assert seen[0][1] == 10 * 10 + 1


def test_before_the_first_frame_there_is_grey(cells):
    seen = cells(recording(frames=20), fps=100, stop_s=0.05)
    assert [level for _, level in seen] == [128, 128, 1, 1, 1]


def test_sheet_of_chosen_instants(cells):
    seen = cells(recording(frames=20), "out.png", at_s=[0.5, 0.25, 0.9])
    assert [text.split()[0] for text, _ in seen] == ["0.250", "0.500", "0.900"]
    assert [level for _, level in seen] == [41, 91, 171]


def test_sheet_of_even_instants(cells):
    seen = cells(recording(), "out.png", count=4)
    assert [text.split()[0] for text, _ in seen] == ["0.128", "0.384", "0.640", "0.896"]


def test_frames_can_be_left_out(cells):
    assert {level for _, level in cells(recording(frames=20), frames=False)} == {None}


def test_frames_alone(cells):
    seen = cells(recording(empty_events(), frames=5), fps=20)
    assert [level for _, level in seen] == [11, 21, 31, 41]


def test_events_in_large_chunks_are_all_drawn(cells, monkeypatch):
    monkeypatch.setattr("adv2e.rendering.recording._CHUNK", 7)
    seen = cells(recording(frames=3), fps=10, style=Style(window_us=100_000))
    assert [text.split()[2] for text, _ in seen] == ["100"] * 10


def test_nothing_to_render(tmp_path):
    with pytest.raises(DataError, match="rec: holds no events and no frames"):
        render_recording(recording(empty_events()), tmp_path / "out.mp4")
    with pytest.raises(DataError, match=r"rec: lasts 0\.999 s, nothing is left from 2 s on"):
        render_recording(recording(), tmp_path / "out.mp4", start_s=2)
    with pytest.raises(DataError, match="the instant 3 s is after the end"):
        render_recording(recording(), tmp_path / "out.png", at_s=[3, 0.5])
    assert list(tmp_path.iterdir()) == []


def test_picture_shows_the_events(tmp_path):
    render_recording(recording(), tmp_path / "out.png", at_s=[0.5], scale=1)
    picture = cv2.imread(str(tmp_path / "out.png"))
    red = (picture[:, :, 2] > 150) & (picture[:, :, 0] < 100)
    rows, columns = np.nonzero(red[34:])
    assert (rows.tolist(), columns.tolist()) == ([2], [8 + 3])

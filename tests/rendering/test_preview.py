from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from processes import running_python

from adv2e.errors import OutputError, UsageError
from adv2e.events import empty_events, make_events
from adv2e.rendering.recording import open_preview
from adv2e.rendering.styles import GAP, Style

EVENTS = make_events(np.arange(0, 1_000_000, 500), np.arange(2000) % 32, [0] * 2000, [1, 0] * 1000)


def make(path, *, frames=True, **more):
    with open_preview(path, 32, 24, **more) as preview:
        for k in range(10):
            if frames:
                preview.add_frame(k * 100_000_000, np.full((24, 32), 20 * k, np.uint8))
            preview.add_events(EVENTS[200 * k : 200 * (k + 1)])


@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".avi", ".gif", ".png"])
@pytest.mark.thorough
def test_only_the_finished_file_is_left(tmp_path, suffix):
    path = tmp_path / f"view{suffix}"
    make(path)
    assert list(tmp_path.iterdir()) == [path]
    assert path.stat().st_size > 1000


FULL_DISK = """
import resource, sys
from pathlib import Path
sys.path[:0] = sys.argv[3:]
from adv2e.errors import OutputError
from test_preview import make
path, steps = Path(sys.argv[1]), int(sys.argv[2])
make(path, scale=1, fps=15)
size = path.stat().st_size
path.unlink()
for limit in [size - 1, *(size * k // steps for k in range(steps))]:
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    try:
        make(path, scale=1, fps=15)
    except OutputError as error:
        print(error)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="needs resource limits")
@pytest.mark.parametrize("name", ["view.mp4", "view.webm", "v.avi", "v.gif", "v.png"])
@pytest.mark.quick_cases(1)
def test_a_full_disk_is_told_with_the_name_of_the_file(tmp_path, name):
    path = tmp_path / name
    steps = 1 if path.suffix == ".gif" else 24
    arguments = (path, steps, *Path(__file__).parents[:2])
    with running_python(FULL_DISK, *arguments, text=True) as process:
        out, err = process.communicate(timeout=60)
    assert err == ""
    lines = out.splitlines()
    assert len(lines) == steps + 1
    assert all(line.startswith(f"{path}: ") for line in lines)
    assert list(tmp_path.iterdir()) == []


def test_film_has_the_pictures_of_its_duration(tmp_path):
    make(tmp_path / "view.avi", fps=25)
    video = cv2.VideoCapture(str(tmp_path / "view.avi"))
    assert video.get(cv2.CAP_PROP_FPS) == 25
    assert video.get(cv2.CAP_PROP_FRAME_COUNT) == 25


def test_slow_film_is_longer(tmp_path):
    make(tmp_path / "view.avi", fps=10, speed=0.5)
    video = cv2.VideoCapture(str(tmp_path / "view.avi"))
    assert video.get(cv2.CAP_PROP_FRAME_COUNT) == 20


def test_frames_make_the_picture_wider(tmp_path):
    make(tmp_path / "with.png", scale=4, count=1)
    make(tmp_path / "without.png", frames=False, scale=4, count=1)
    wide, narrow = (cv2.imread(str(tmp_path / name)).shape for name in ("with.png", "without.png"))
    assert wide[0] == narrow[0]
    assert wide[1] == narrow[1] + 4 * 32 + GAP


def test_styles_reach_the_file(tmp_path):
    make(tmp_path / "view.png", frames=False, count=1, scale=8, style=Style(name="black"))
    assert cv2.imread(str(tmp_path / "view.png")).mean() < 60


@pytest.mark.parametrize("suffix", [".mp4", ".gif", ".png"])
def test_an_error_leaves_nothing(tmp_path, suffix):
    with pytest.raises(ZeroDivisionError), open_preview(tmp_path / f"v{suffix}", 32, 24) as preview:
        preview.add_events(EVENTS)
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", [".mp4", ".png"])
def test_nothing_to_draw_leaves_nothing(tmp_path, suffix):
    with (
        pytest.raises(OutputError, match="no events or frames to draw"),
        open_preview(tmp_path / f"view{suffix}", 32, 24) as preview,
    ):
        preview.add_events(empty_events())
    assert list(tmp_path.iterdir()) == []


def test_frames_without_any_event(tmp_path):
    with open_preview(tmp_path / "view.avi", 32, 24, fps=10) as preview:
        for k in range(10):
            preview.add_frame(k * 100_000_000, np.zeros((24, 32), np.uint8))
            preview.add_events(empty_events())
    video = cv2.VideoCapture(str(tmp_path / "view.avi"))
    assert video.get(cv2.CAP_PROP_FRAME_COUNT) == 9


def test_an_existing_file_is_kept_unless_asked(tmp_path):
    path = tmp_path / "view.png"
    path.write_text("mine")
    with pytest.raises(OutputError, match="--overwrite"):
        make(path)
    assert path.read_text() == "mine"
    make(path, overwrite=True)
    assert cv2.imread(str(path)) is not None
    assert list(tmp_path.iterdir()) == [path]


def test_an_error_keeps_the_old_file(tmp_path):
    path = tmp_path / "view.mp4"
    path.write_text("old")
    with pytest.raises(ZeroDivisionError), open_preview(path, 32, 24, overwrite=True) as preview:
        preview.add_events(EVENTS)
        raise ZeroDivisionError
    assert path.read_text() == "old"


def test_wrong_suffix_and_rate_are_found_at_once(tmp_path):
    with pytest.raises(UsageError, match="a film ends in"):
        open_preview(tmp_path / "view.mov", 32, 24).__enter__()
    with pytest.raises(UsageError, match="at most 50"):
        open_preview(tmp_path / "v.gif", 4, 4, fps=60).__enter__()
    assert list(tmp_path.iterdir()) == []


def test_a_film_of_far_too_many_pictures_for_its_frames_ends(tmp_path):
    film = tmp_path / "a.gif"
    events = make_events([0, 2_000_000], [1, 1], [1, 1], [1, 1])
    with (
        pytest.raises(OutputError, match=r"a\.gif: over 10 pictures of 0 frames"),
        open_preview(film, 8, 6, max_pictures=10, frames=False) as preview,
    ):
        preview.add_events(events)
        preview.finish()
    assert list(tmp_path.iterdir()) == []

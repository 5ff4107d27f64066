"""Films: coders that browsers know, colours, and a full disk."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import threading
from contextlib import closing

import cv2
import numpy as np
import pytest

from adv2e.errors import OutputError
from adv2e.rendering.films import VideoFile
from adv2e.sources.images.opencv import quiet

CODERS = {".mp4": "h264", ".webm": "vp8", ".avi": "huffyuv"}


@pytest.fixture(params=list(CODERS))
def coder(request):
    """Choose a coder; return the suffix of its films and its name."""
    return request.param, CODERS[request.param]


def read_film(path):
    film = cv2.VideoCapture(str(path))
    pictures = []
    while (read := film.read())[0]:
        pictures.append(read[1][:, :, ::-1])
    return film.get(cv2.CAP_PROP_FPS), pictures


def noise(rows, columns, seed=0):
    return np.random.default_rng(seed).integers(0, 256, (rows, columns, 3)).astype(np.uint8)


def write(path, pictures, fps=20.0):
    with closing(VideoFile(path, fps)) as film:
        for picture in pictures:
            film.add(picture)
        film.finish()


def test_avi_loses_nothing(tmp_path):
    pictures = [noise(24, 32, k) for k in range(4)]
    write(tmp_path / "film.avi", pictures)
    fps, found = read_film(tmp_path / "film.avi")
    assert fps == 20
    assert np.array_equal(found, pictures)


def test_films_keep_count_rate_and_colours(tmp_path, coder):
    suffix, _ = coder
    pictures = [np.full((48, 64, 3), (200, 40, 20), np.uint8) for _ in range(7)]
    write(tmp_path / f"film{suffix}", pictures, fps=12.5)
    fps, found = read_film(tmp_path / f"film{suffix}")
    assert fps == pytest.approx(12.5)
    assert len(found) == 7
    assert np.abs(found[3].astype(int) - pictures[3]).max() < 12


def test_the_coder_is_one_that_browsers_know(tmp_path, coder):
    suffix, name = coder
    path = tmp_path / f"film{suffix}"
    write(path, [noise(48, 64, k) for k in range(3)])
    marks = {"vp8": b"V_VP8", "huffyuv": b"HFYU", "h264": b"avc1"}
    assert marks[name] in path.read_bytes()
    if shutil.which("ffprobe"):
        shown = ("-show_entries", "stream=codec_name,pix_fmt", "-of", "json")
        told = subprocess.check_output(["ffprobe", "-v", "error", *shown, path])
        (stream,) = json.loads(told)["streams"]
        assert stream["codec_name"] == name
        if name != "huffyuv":
            assert stream["pix_fmt"] == "yuv420p"  # the only one that all browsers show


def test_single_events_stay_red_and_blue(tmp_path, coder):
    suffix, _ = coder
    rng = np.random.default_rng(1)
    small = np.full((8, 120, 160, 3), 255, np.uint8)
    red, blue = rng.random((8, 120, 160)) < 0.01, rng.random((8, 120, 160)) < 0.01
    small[red], small[blue] = (214, 30, 36), (24, 84, 205)
    write(tmp_path / f"film{suffix}", small.repeat(2, axis=1).repeat(2, axis=2))
    _, found = read_film(tmp_path / f"film{suffix}")
    found = np.array(found, int)[:, ::2, ::2]
    only_red, only_blue = found[red & ~blue], found[blue]
    assert np.mean(only_red[:, 0] - only_red[:, 2] > 90) > 0.98
    assert np.mean(only_blue[:, 2] - only_blue[:, 0] > 90) > 0.98
    white = found[~red & ~blue]
    assert np.mean(white.min(axis=1) > 230) > 0.9


def test_odd_sizes_gain_a_line(tmp_path):
    picture = noise(9, 15)
    write(tmp_path / "film.avi", [picture])
    found = read_film(tmp_path / "film.avi")[1][0]
    assert found.shape == (10, 16, 3)
    assert np.array_equal(found[:9, :15], picture)


def test_nothing_is_printed(tmp_path, coder, capfd):
    write(tmp_path / f"film{coder[0]}", [noise(16, 16)])
    assert capfd.readouterr() == ("", "")


def test_a_video_that_cannot_be_written(tmp_path, coder, capfd):
    with pytest.raises(OutputError, match="cannot be written there"):
        write(tmp_path / "absent" / f"film{coder[0]}", [noise(16, 16)])
    assert capfd.readouterr() == ("", "")


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="names are UTF-8, without colons")
@pytest.mark.parametrize("stem", ["14:30:00", "film%03d", "pipe:1", "caf\udce9", "a' b"])
def test_a_film_may_have_any_name(tmp_path, coder, stem):
    path = tmp_path / f"{stem}{coder[0]}"
    write(path, [noise(16, 16)])
    assert path.stat().st_size > 200
    assert list(tmp_path.iterdir()) == [path]


def test_a_video_that_came_out_short(tmp_path, coder):
    path = tmp_path / f"film{coder[0]}"
    for damage in (lambda data: b"", lambda data: data[: len(data) // 2], lambda data: data[:-9]):
        film = VideoFile(path, 10)
        for k in range(3):
            film.add(noise(64, 64, k))
        film.close()
        path.write_bytes(damage(path.read_bytes()))  # as on a full disk
        with pytest.raises(OutputError, match="holds 0 of 3 pictures"):
            film.finish()


def test_opencv_stays_quiet_until_the_last_has_left():
    logging = cv2.utils.logging if hasattr(cv2.utils, "logging") else cv2
    before = logging.getLogLevel()
    inside, leave = threading.Event(), threading.Event()

    def other():
        with quiet:
            inside.set()
            leave.wait(10)

    thread = threading.Thread(target=other)
    with quiet:
        thread.start()
        assert inside.wait(10)
    assert logging.getLogLevel() == 0
    leave.set()
    thread.join()
    assert logging.getLogLevel() == before

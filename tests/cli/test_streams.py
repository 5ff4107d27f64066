"""Libraries' own lines about broken files do not reach standard error; ours do."""

import os
import signal
import subprocess
import sys
import time

import cv2
import numpy as np
import pytest


def run(*arguments, python=()):
    return subprocess.run(
        [sys.executable, *python, "-m", "adv2e", *map(str, arguments)],
        capture_output=True, text=True, timeout=100, check=False,
    )  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    """Images of which one PNG is damaged in the midst, and one JPEG holds something foreign."""
    for n, suffix in enumerate((".jpg", ".png")):
        picture = np.random.default_rng(n).integers(0, 255, (40, 50), np.uint8)
        data = bytearray(cv2.imencode(suffix, picture)[1].tobytes())
        middle = len(data) // 2
        data[middle : middle + 4] = b"\xff\x00\xff\x36"
        (tmp_path / f"{n}{suffix}").write_bytes(data)
    return tmp_path


def test_a_broken_picture_is_one_line(folder):
    found = run("info", folder, "--fps", "10")
    assert found.returncode == 1
    assert found.stderr.count("\n") == 1
    assert found.stderr.startswith(f"adv2e: error: {folder}{os.sep}")


@pytest.mark.skipif(os.name == "nt", reason="prints of C libraries are looked for")
def test_the_library_would_have_said_more(folder):
    code = f"import cv2; cv2.imread({str(folder / '1.png')!r}, cv2.IMREAD_UNCHANGED)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False).stderr
    if not said:
        pytest.skip("this OpenCV prints nothing")
    seen = run("info", folder, "--fps", "10", python=("-X", "faulthandler"))
    assert len(seen.stderr) > 0  # where a fault is looked for, all may be seen
    assert seen.returncode == 1


@pytest.mark.skipif(os.name == "nt", reason="signals of another kind")
@pytest.mark.thorough
def test_last_words_on_a_signal_are_still_said(tmp_path):
    np.save(tmp_path / "s.npy", np.random.default_rng(0).random((3000, 60, 80), np.float32))
    child = subprocess.Popen(
        [sys.executable, "-m", "adv2e", "convert", tmp_path / "s.npy", "--fps", "1000",
         "-o", tmp_path / "o.txt"],
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    until = time.monotonic() + 60
    while not list(tmp_path.glob(".adv2e.*/new*")) and time.monotonic() < until:
        time.sleep(0.02)
    child.send_signal(signal.SIGTERM)
    _, said = child.communicate(timeout=60)
    assert child.returncode == 143
    assert said.endswith("adv2e: stopped by SIGTERM\n")


def test_tracebacks_and_warnings_of_python_are_still_seen(tmp_path):
    found = run("info", tmp_path / "none.mp4", "-vv")
    assert found.returncode == 1
    assert "no such file" in found.stderr


@pytest.mark.parametrize("subsampling", [0x111111, 0x221111])
@pytest.mark.quick_cases(1)
def test_a_jpeg_of_which_a_part_is_missing_is_not_filled_with_grey(tmp_path, subsampling):
    how = (cv2.IMWRITE_JPEG_SAMPLING_FACTOR, subsampling)
    noise = np.random.default_rng(0).integers(0, 255, (2, 60, 80, 3), np.uint8)
    whole = [cv2.imencode(".jpg", frame, how)[1].tobytes() for frame in noise]
    folder = tmp_path / "f"
    folder.mkdir()
    (folder / "0.jpg").write_bytes(whole[0])
    (folder / "1.jpg").write_bytes(whole[1])
    assert run("info", folder, "--fps", "10").returncode == 0
    half = len(whole[1]) // 2
    (folder / "1.jpg").write_bytes(whole[1][:half] + b"\xff\xd9")
    found = run("info", folder, "--fps", "10")
    assert found.returncode == 1
    assert found.stderr == (
        f"adv2e: error: {folder / '1.jpg'}: not an image that can be read, or damaged\n"
    )
    # a few foreign bytes before the end, as cameras leave them, take nothing away
    (folder / "1.jpg").write_bytes(whole[1][:-2] + bytes(5) + b"\xff\xd9")
    assert run("info", folder, "--fps", "10").returncode == 0

"""Pipes, devices and sockets are no inputs, but text may come through open descriptors."""

import os
import socket
import subprocess
import sys

import numpy as np
import pytest

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no such files")

NO_FILE = "is a pipe, a device or a socket, must be a file"
SUFFIXES = (".mp4", ".npy", ".npz", ".zip", ".txt", ".h5", "")


def run(*arguments, **how):
    return subprocess.run(
        [sys.executable, "-m", "adv2e", *map(str, arguments)],
        capture_output=True, text=True, timeout=60, check=False, **how,
    )  # fmt: skip


@pytest.fixture
def stack(tmp_path):
    np.save(tmp_path / "stack.npy", np.zeros((3, 4, 5), np.uint8))
    return tmp_path / "stack.npy"


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.thorough
def test_a_pipe_as_input(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    os.mkfifo(path)
    for command in ("convert", "info"):
        more = ("--fps", "10", "-o", tmp_path / "o.txt") if command == "convert" else ()
        found = run(command, path, *more)
        assert found.returncode == 1
        assert found.stderr == f"adv2e: error: {path}: {NO_FILE}\n"


def test_a_device_and_a_socket_as_input(tmp_path):
    (tmp_path / "zero.npy").symlink_to("/dev/zero")
    assert NO_FILE in run("info", tmp_path / "zero.npy").stderr
    with socket.socket(socket.AF_UNIX) as opened:
        opened.bind(str(tmp_path / "s.npz"))
        assert NO_FILE in run("info", tmp_path / "s.npz").stderr


@pytest.mark.parametrize("option", ["-c", "--timestamps", "--effect"])
@pytest.mark.quick_cases(1)
def test_a_pipe_as_text(tmp_path, stack, option):
    os.mkfifo(tmp_path / "pipe")
    rate = () if option == "--timestamps" else ("--fps", "10")
    found = run("convert", stack, *rate, option, tmp_path / "pipe", "-o", tmp_path / "o.txt")
    assert found.returncode == 1
    assert found.stderr == f"adv2e: error: {tmp_path / 'pipe'}: {NO_FILE}\n"


@pytest.mark.parametrize("name", ["images.txt", "frame_1.png", "events.txt", "a_ts.npy"])
@pytest.mark.quick_cases(1)
def test_a_pipe_within_a_folder_is_no_part_of_it(tmp_path, name):
    folder = tmp_path / "folder"
    folder.mkdir()
    os.mkfifo(folder / name)
    found = run("info", folder, "--fps", "10")
    assert found.returncode == 1
    assert found.stderr.count("\n") == 1


@pytest.mark.thorough
def test_text_through_an_open_descriptor(stack):
    found = run("info", stack, "--timestamps", "/dev/stdin", input="0.0\n0.1\n0.3\n")
    assert found.returncode == 0, found.stderr
    assert "0 to 0.3 s" in found.stdout
    found = run("config", "check", "/dev/stdin", input="seed: 5\n")
    assert found.returncode == 0, found.stderr
    shell = f"{sys.executable} -m adv2e config show -c <(echo 'seed: 77')"
    found = subprocess.run(["bash", "-c", shell], capture_output=True, text=True, check=False)
    assert "seed: 77" in found.stdout, found.stderr


@pytest.mark.thorough
def test_links_that_lead_to_each_other(tmp_path):
    for suffix in (".mp4", ".npy", ".txt", ""):
        (tmp_path / f"a{suffix}").symlink_to(tmp_path / f"b{suffix}")
        (tmp_path / f"b{suffix}").symlink_to(tmp_path / f"a{suffix}")
        found = run("info", tmp_path / f"a{suffix}")
        assert found.returncode == 1
        assert found.stderr.count("\n") == 1
        assert "symbolic links" in found.stderr

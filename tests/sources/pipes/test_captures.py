"""Ctrl-C while frames come through a pipe: the first ends the capture, the second the program."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from pictures import picture
from processes import running_python
from threads import wait_until

from adv2e.formats.reading import read_events

pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="nobody can wait there for a pipe and a signal at once"
)

PROGRAM = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # as in a terminal
signal.signal(signal.SIGTERM, signal.SIG_DFL)
from adv2e.__main__ import main
main()
"""

LARGE = (240, 280)
"""Rows and columns of frames that a pipe does not hold, which takes 65,536 bytes."""

HEARD = "adv2e: capture ended: what came is converted; a second Ctrl-C stops at once"


def frames_of(count, shape=(24, 32)):
    return [picture(k, shape) for k in range(count)]


def y4m(frames):
    rows, columns = frames[0].shape
    head = f"YUV4MPEG2 W{columns} H{rows} F100:1 Ip Cmono\n".encode()
    return head + b"".join(b"FRAME\n" + frame.tobytes() for frame in frames)


def capturing(*options, **more):
    """Start a conversion of what comes through a pipe."""
    more = {"stdin": subprocess.PIPE, "text": False, **more}
    return running_python(PROGRAM, "convert", "-", "--no-progress", *options, **more)


def send(process, data):
    """Send all that, and wait until it was taken from the pipe."""
    process.stdin.write(data)
    process.stdin.flush()
    wait_until_read(process.stdin)


def wait_until_read(pipe):
    fcntl, termios = pytest.importorskip("fcntl"), pytest.importorskip("termios")
    wait_until(lambda: not any(fcntl.ioctl(pipe, termios.FIONREAD, bytes(4))), seconds=120)


def is_writing(folder):
    """Tell whether an output was begun: by then the capture was, too."""
    return list(folder.glob(".adv2e.*/new*")) != []


def ended(process):
    """Return the lines on stderr of a process that ends while its pipe stays open."""
    pipe, process.stdin = process.stdin, None
    _, err = process.communicate(timeout=120)
    if pipe is not None:
        pipe.close()
    return err.decode().splitlines()


@pytest.fixture
def converted_from_a_file(adv2e, tmp_path):
    """Return the bytes that frames become which lie in a file."""

    def convert(frames, suffix):
        stack, output = tmp_path / "whole.npy", tmp_path / f"whole{suffix}"
        np.save(stack, np.array(frames))
        done = adv2e("convert", stack, "--fps", "100", "-o", output, "-q", "--seed", "5")
        assert done.status == 0, done.err
        return output.read_bytes()

    return convert


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("threads", "cut"),
    [
        pytest.param("1", 0, id="whole"),
        pytest.param("2", 3, id="cut mark"),
        pytest.param("2", 6 + 1000, id="cut frame"),
    ],
)
def test_a_producer_that_falls_silent(converted_from_a_file, tmp_path, threads, cut):
    frames = frames_of(6, LARGE)
    out = tmp_path / "out"
    with capturing("-o", out / "a.txt", "--seed", "5", "--threads", threads) as process:
        send(process, y4m(frames) + (b"FRAME\n" + bytes(1000))[:cut])
        time.sleep(1)  # it waits for more by now, or will at once
        process.send_signal(signal.SIGINT)
        told = ended(process)
    assert process.returncode == 0, told
    assert sum(line.startswith(HEARD) for line in told) == 1
    assert "standard input: ended by hand (Ctrl-C) after 6 frames" in told
    whole = converted_from_a_file(frames, ".txt")
    assert (out / "a.txt").read_bytes() == whole
    assert len(whole) > 10_000
    assert sorted(path.name for path in out.iterdir()) == ["a.txt", "a.txt.json"]
    assert read_events(out / "a.txt").metadata["ended_by_hand_after_frames"] == 6


@pytest.mark.thorough
def test_frames_that_wait_in_the_pipe_have_come(converted_from_a_file, tmp_path):
    frames = frames_of(40)
    with capturing("-o", tmp_path / "out" / "a.csv", "-q", "--seed", "5") as process:
        process.stdin.write(y4m(frames))
        process.stdin.flush()
        wait_until(lambda: is_writing(tmp_path / "out"), seconds=120)
        process.send_signal(signal.SIGINT)
        assert ended(process) == []
    assert process.returncode == 0
    assert read_events(tmp_path / "out" / "a.csv").metadata["ended_by_hand_after_frames"] == 40
    assert (tmp_path / "out" / "a.csv").read_bytes() == converted_from_a_file(frames, ".csv")


PRODUCER = """
import signal, sys
signal.signal(signal.SIGINT, signal.SIG_DFL)
data = open(sys.argv[1], "rb").read()
while True:
    sys.stdout.buffer.write(data)
    sys.stdout.buffer.flush()
    print("sent", file=sys.stderr, flush=True)
    if len(sys.argv) > 2:
        signal.pause()
    data = data[data.index(b"FRAME"):]
"""


@pytest.mark.parametrize("pauses", [True, False], ids=["pauses within a frame", "goes on"])
@pytest.mark.thorough
def test_a_terminal_interrupts_the_producer_too(converted_from_a_file, tmp_path, pauses):
    """Both are in one group, as in a pipeline of a shell."""
    frames = frames_of(5, LARGE)
    data = y4m(frames)
    (tmp_path / "sent").write_bytes(data + b"FRAME\n" + bytes(99) if pauses else data)
    arguments = [tmp_path / "sent", *["pauses"][: int(pauses)]]
    out = tmp_path / "out"
    with running_python(PRODUCER, *arguments, preexec_fn=os.setpgrp) as producer:
        group = {"preexec_fn": lambda: os.setpgid(0, producer.pid)}
        options = ("-o", out / "a.txt", "--seed", "5")
        with capturing(*options, stdin=producer.stdout, **group) as process:
            assert producer.stderr.readline() == b"sent\n"
            if pauses:
                wait_until_read(producer.stdout)
            producer.stdout.close()
            os.killpg(producer.pid, signal.SIGINT)
            told = ended(process)
        assert producer.wait(timeout=120) == -signal.SIGINT
    assert process.returncode == 0, told
    count = read_events(out / "a.txt").metadata["ended_by_hand_after_frames"]
    assert count == 5 if pauses else count >= 4
    whole = (frames * (1 + count // 5))[:count]
    assert (out / "a.txt").read_bytes() == converted_from_a_file(whole, ".txt")


@pytest.mark.thorough
def test_a_stream_that_is_cut_without_an_interrupt_is_damaged(tmp_path):
    with capturing("-o", tmp_path / "a.h5") as process:
        _, err = process.communicate(y4m(frames_of(3))[:-1], timeout=120)
    assert process.returncode == 1
    assert b"ends within frame 2" in err
    assert list(tmp_path.iterdir()) == []


def slow_to_convert(folder):
    """Return options by which each of 20 frames takes seconds: millions of leak events."""
    times = folder / "times.txt"
    times.write_text("".join(f"{30 * k}\n" for k in range(20)))
    return ("--timestamps", times, "--time-unit", "s", "--set", "pixel.leak.rate_hz=300")


def test_a_second_interrupt_ends_at_once_and_leaves_nothing(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    with capturing("-o", out / "a.h5", *slow_to_convert(tmp_path)) as process:
        process.stdin.write(y4m(frames_of(20)))
        process.stdin.flush()
        wait_until(lambda: is_writing(out), seconds=120)
        process.send_signal(signal.SIGINT)
        while not process.stderr.readline().decode().startswith(HEARD):
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        assert ended(process) == ["adv2e: interrupted"]
    assert process.returncode == 130
    assert list(out.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "piped"), [("SIGTERM", True), ("SIGINT", False)], ids=["SIGTERM", "no pipe"]
)
@pytest.mark.quick_cases(1)
def test_what_ends_the_program_as_ever(tmp_path, name, piped):
    """Another signal; and SIGINT while frames come from a file, which ends by itself."""
    out, stored = tmp_path / "out", tmp_path / "stored.y4m"
    out.mkdir()
    stored.write_bytes(y4m(frames_of(20)))
    with stored.open("rb") as file:
        given = {} if piped else {"stdin": file}
        with capturing("-o", out / "a.h5", *slow_to_convert(tmp_path), **given) as process:
            if piped:
                process.stdin.write(stored.read_bytes())
                process.stdin.flush()
            wait_until(lambda: is_writing(out), seconds=120)
            process.send_signal(getattr(signal, name))
            told = ended(process)
    last = {"SIGTERM": (143, "stopped by SIGTERM"), "SIGINT": (130, "interrupted")}[name]
    assert (process.returncode, told[-1]) == (last[0], f"adv2e: {last[1]}")
    assert not any(line.startswith(HEARD) for line in told)
    assert list(out.iterdir()) == []


@pytest.mark.parametrize("count", [0, 1])
@pytest.mark.quick_cases(1)
def test_nothing_is_kept_of_less_than_two_frames(tmp_path, count):
    out = tmp_path / "out"
    out.mkdir()
    with capturing("-o", out / "a.h5") as process:
        send(process, y4m(frames_of(2))[: -(2 - count) * (6 + 24 * 32)])
        if count:
            wait_until(lambda: is_writing(out), seconds=120)
        process.send_signal(signal.SIGINT)
        told = ended(process)
    assert (process.returncode, told[-1]) == (130, "adv2e: interrupted")
    assert len(told) == 1 + count
    assert list(out.iterdir()) == []


@pytest.mark.thorough
def test_more_times_than_frames_came(tmp_path):
    times = tmp_path / "times.txt"
    times.write_text("".join(f"{k / 50:.3f}\n" for k in range(10)))
    with capturing("-o", tmp_path / "a.h5", "--timestamps", times) as process:
        send(process, y4m(frames_of(4, LARGE)))
        process.send_signal(signal.SIGINT)
        told = ended(process)
    assert process.returncode == 0, told
    assert f"{times}: 10 times for 4 frames: the first 4 are taken" in told
    assert read_events(tmp_path / "a.h5").events["t"].max() <= 60_000


@pytest.mark.thorough
def test_in_python_an_interrupt_is_one(tmp_path):
    script = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
import adv2e
try:
    adv2e.convert("-", sys.argv[1])
except KeyboardInterrupt:
    print("interrupted", signal.getsignal(signal.SIGINT) is signal.default_int_handler)
"""
    with running_python(script, tmp_path / "a.h5", stdin=subprocess.PIPE) as process:
        send(process, y4m(frames_of(4, LARGE)))
        process.send_signal(signal.SIGINT)
        assert process.stdout.read() == b"interrupted True\n"
    assert list(tmp_path.iterdir()) == []

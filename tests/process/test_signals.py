"""Waiting for a pipe and for a signal at once."""

from __future__ import annotations

import os
import signal
import sys
import threading

import pytest
from processes import running_python

from adv2e.process.signals import stopping_on_signals, wait_for

pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="nobody can wait there for a pipe and a signal at once"
)


@pytest.fixture
def pipe():
    reads, writes = os.pipe()
    yield reads, writes
    os.close(reads)
    os.close(writes)


@pytest.fixture
def stopping():
    """Have signals end the program, as in the command, and as they did before afterwards."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with stopping_on_signals():
        yield
    for number, handler in before.items():
        signal.signal(number, handler)


def test_it_ends_when_there_is_something_to_read(pipe, stopping):
    later = threading.Timer(0.2, os.write, (pipe[1], b"frame"))
    later.start()
    wait_for(pipe[0])
    assert os.read(pipe[0], 9) == b"frame"
    later.join()


def test_an_interrupt_ends_it():
    program = """
import os, signal, threading
from adv2e.process.signals import stop_on_signals, wait_for

signal.signal(signal.SIGINT, signal.default_int_handler)
stop_on_signals()
threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
wait_for(os.pipe()[0])
"""
    with running_python(program, text=True) as process:
        _, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (130, "adv2e: interrupted\n")


def test_another_signal_does_not_end_it(pipe, stopping):
    heard = []
    before = signal.signal(signal.SIGUSR1, lambda number, frame: heard.append(number))
    timers = [
        threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGUSR1)),
        threading.Timer(0.4, os.write, (pipe[1], b"frame")),
    ]
    for timer in timers:
        timer.start()
    try:
        wait_for(pipe[0])
    finally:
        signal.signal(signal.SIGUSR1, before)
    assert heard == [signal.SIGUSR1]
    assert os.read(pipe[0], 9) == b"frame"
    for timer in timers:
        timer.join()


def test_where_a_signal_ends_nothing_the_read_itself_waits(pipe):
    wait_for(pipe[0])  # at once, as a program that uses adv2e has handlers of its own

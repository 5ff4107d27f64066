"""Threads of our own, and waiting for what they do."""

import threading
import time


def own_threads():
    return [thread for thread in threading.enumerate() if thread.name.startswith("adv2e-")]


def wait_until(true, seconds=10):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.001)

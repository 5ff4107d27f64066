"""Threads of our own, and waiting for what they do."""

import threading
import time


def own_threads():
    """Return those that work for a call; those of a camera live as long as it does."""
    found = (thread for thread in threading.enumerate() if thread.name.startswith("adv2e-"))
    return [thread for thread in found if not thread.name.startswith("adv2e-camera")]


def wait_until(true, seconds=10):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.001)

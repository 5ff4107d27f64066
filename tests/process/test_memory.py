"""Memory that goes back to the system."""

from __future__ import annotations

import subprocess
import sys

import pytest

from adv2e.process import machine

SCRIPT = """
import sys
from pathlib import Path
import numpy as np
from adv2e.process.machine import return_large_blocks
if sys.argv[1] == "returned":
    return_large_blocks()

def rss():
    text = Path("/proc/self/status").read_text()
    return int(text.partition("VmRSS:")[2].split()[0]) // 1024

np.zeros(30 << 20, np.uint8)  # once freed, arrays of this size come from the heap
before = rss()
blocks = [np.ones(8 << 20, np.uint8) for _ in range(10)]
small = np.ones(1000)  # above them in the heap: it cannot shrink
blocks.clear()
print(rss() - before)
"""


def held_mib(how):
    command = [sys.executable, "-c", SCRIPT, how]
    return int(subprocess.run(command, capture_output=True, check=True, text=True).stdout)


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_large_arrays_leave_nothing_behind():
    assert held_mib("returned") < 4


def test_other_systems_have_no_such_setting(monkeypatch):
    def no_library(name):
        raise TypeError

    monkeypatch.setattr(machine.ctypes, "CDLL", no_library)
    machine.return_large_blocks()

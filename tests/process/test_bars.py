"""Progress bars go on in silence where nobody reads them any more."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

FROM_THREADS = """
from concurrent.futures import ThreadPoolExecutor
from adv2e.process.bars import bar

with bar(desc="work", total=400, mininterval=0) as shown, ThreadPoolExecutor(2) as pool:
    list(pool.map(lambda _: shown.update(), range(400)))
print("done")
"""


@pytest.mark.parametrize("reader", ["gone", "full"])
def test_a_bar_that_threads_move_ends_nothing(reader):
    """Without it, tqdm keeps its lock after an error, and the other threads wait for ever."""
    if reader == "full" and not os.path.exists("/dev/full"):  # noqa: PTH110
        pytest.skip("this system has no /dev/full")
    read, write = os.pipe()
    os.close(read)
    if reader == "full":
        os.close(write)
        write = os.open("/dev/full", os.O_WRONLY)
    done = subprocess.run(
        [sys.executable, "-c", FROM_THREADS],
        stdout=subprocess.PIPE, stderr=write, timeout=60, check=False,
    )  # fmt: skip
    os.close(write)
    assert (done.returncode, done.stdout) == (0, b"done\n")


def test_a_bar_is_shown_on_standard_error_and_goes():
    done = subprocess.run(
        [sys.executable, "-c", FROM_THREADS], capture_output=True, timeout=60, check=True
    )
    assert b"work:" in done.stderr
    assert b"400/400" in done.stderr
    assert done.stderr.split(b"\r")[-2].strip() == b""

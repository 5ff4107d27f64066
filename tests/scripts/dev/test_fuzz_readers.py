"""Damaged files of every kind end in one right line, and the fuzzer sees it when they do not."""

import ctypes
import mmap
import os
import random
import subprocess
import sys
import time
from pathlib import Path

import pytest

if sys.platform != "linux":
    pytest.skip("the fuzzer needs fork and /proc", allow_module_level=True)

from dev import fuzz_readers
from dev.fuzz_readers import Limits, judged
from dev.fuzz_seeds import all_seeds, mutated

SCRIPT = Path(__file__).parents[3] / "scripts" / "dev" / "fuzz_readers.py"


@pytest.mark.thorough
def test_some_damaged_files_of_every_kind():
    found = subprocess.run(
        [sys.executable, SCRIPT, "--count", "60", "--seed", "20"],
        capture_output=True, text=True, timeout=200, check=False,
    )  # fmt: skip
    assert found.returncode == 0, found.stdout + found.stderr
    assert "60 files: " in found.stdout
    assert "nothing wrong" in found.stdout


def _allocate():
    held = bytearray(400 << 20)
    for place in range(0, len(held), 4096):
        held[place] = 1


def _error(text):
    def say():
        os.write(2, text)
        raise SystemExit(1)

    return say


LINE = b"adv2e: error: a.png: damaged\n"


@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")  # fork beside threads
@pytest.mark.parametrize(
    ("action", "wrong"),
    [
        (_error(LINE), ""),
        (lambda: None, ""),
        (_error(b""), "0 lines of error"),
        (_error(LINE + LINE), "2 lines of error"),
        (_error(LINE + b"and more\n"), "1 lines of error"),
        (_error(b"libpng error: bad\n" + LINE), "a library speaks"),
        (_error(b"adv2e: error: internal error: KeyError: 3\n"), "internal error"),
        (_error(b"adv2e: error: not enough memory: 8 GiB\n"), "too much memory"),
        (lambda: ctypes.string_at(0), "ended by SIGSEGV"),
        (os.abort, "ended by SIGABRT"),
        (lambda: sys.exit(2), "exit status 2"),
        (lambda: time.sleep(30), "too slow"),
        (lambda: [None for _ in iter(int, 1)], "too slow"),
        (_allocate, "MiB"),
    ],
)
def test_what_ends_badly_is_seen(tmp_path, monkeypatch, action, wrong):
    monkeypatch.setattr(fuzz_readers, "_command", lambda _: action())
    monkeypatch.setattr(fuzz_readers, "_virtual_bytes", lambda: 1 << 46)  # this process holds much
    cpu_s, wall_s = (0.5, 3.0) if wrong == "too slow" else (20.0, 60.0)
    found = fuzz_readers.run([], tmp_path, Limits(cpu_s=cpu_s, wall_s=wall_s, mib=200))
    assert wrong in found.wrong if wrong else not found.wrong, found


@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")  # fork beside threads
def test_what_is_mapped_from_files_here_is_not_taken_off_there(tmp_path, monkeypatch):
    with (tmp_path / "large").open("wb+") as file:
        file.truncate(300 << 20)
        mapped = mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ)
    assert not any(mapped[:: 1 << 12])  # looks at every page
    monkeypatch.setattr(fuzz_readers, "_command", lambda _: _allocate())
    monkeypatch.setattr(fuzz_readers, "_virtual_bytes", lambda: 1 << 46)
    assert "MiB" in fuzz_readers.run([], tmp_path, Limits(mib=200)).wrong
    mapped.close()


def test_an_exit_status_of_success_with_an_error_is_wrong():
    assert judged(0, LINE.decode()) == "1 lines of error with exit status 0"


def test_the_same_number_makes_the_same_file(tmp_path):
    data = bytes(range(256)) * 4
    for n in range(200):
        first, again = (mutated(data, random.Random(n), text=n % 2 == 0) for _ in range(2))
        assert first == again
    (tmp_path / "scratch").mkdir()
    seeds = all_seeds(tmp_path / "scratch")
    kinds = [seed.name for seed in seeds]
    assert {"a.npz", "a.bag", "a.aedat4", "a.zip", "monash.h5", "h264.mp4", "config"} <= {*kinds}
    for seed in seeds:
        made = []
        for name in ("one", "two"):
            seed.write(tmp_path / name, random.Random(5)) if seed.content else None
            made.append(
                [f.read_bytes() for f in sorted((tmp_path / name).rglob("*")) if f.is_file()]
            )
        assert made[0] == made[1]

"""Where the machine gives no more memory or threads, it is blamed, and not the input."""

import errno
import os
import subprocess
import sys

import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.formats.reading import read_events
from adv2e.process.machine import machine_complaint
from adv2e.sources.images import opencv

MEMORY, THREADS = "not enough memory (see ulimit -v)", "the machine starts no more threads"


@pytest.mark.parametrize(
    ("error", "begin"),
    [
        (MemoryError(), MEMORY),
        (MemoryError("Unable to allocate 8. GiB"), f"{MEMORY}: Unable to allocate"),
        (RuntimeError("can't start new thread"), THREADS),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), MEMORY),
        (OSError(errno.EAGAIN, "Resource temporarily unavailable"), MEMORY),
        (ImportError("libx.so: failed to map segment from shared object"), f"{MEMORY}: libx.so"),
        (ImportError("Pages.\nOriginal error was: y.so: cannot allocate memory\n"), f"{MEMORY}: y"),
        (OSError("Could not find/load shared object file 'libllvmlite.so'"), MEMORY),
        (RuntimeError("std::bad_alloc"), MEMORY),
        (ValueError("failed to allocate"), ""),
        (OSError(errno.ENOENT, "No such file or directory"), ""),
        (ImportError("No module named 'tqdm'"), ""),
        (ModuleNotFoundError("No module named 'adv2e.pixel'", name="adv2e.pixel"), MEMORY),
        (ModuleNotFoundError("No module named 'tqdm'", name="tqdm"), ""),
    ],
)
def test_what_is_told(error, begin):
    told = machine_complaint(error)
    assert told.startswith(begin) if begin else told == ""


@pytest.mark.parametrize("suffix", [".txt", ".h5", ".npz", ".zip"])
@pytest.mark.parametrize("error", [RuntimeError("can't start new thread"), OSError("bad_alloc")])
def test_readers_leave_it_as_it_is(tmp_path, monkeypatch, suffix, error):
    def fail(*_, **__):
        raise error

    path = tmp_path / f"a{suffix}"
    path.write_text("PK" if suffix in (".npz", ".zip") else "0.1 1 1 1\n")
    for name in ("zipfile.ZipFile", "h5py.File", "adv2e.formats.text.parse_lines"):
        monkeypatch.setattr(name, fail)
    with pytest.raises(type(error), match=str(error)):
        read_events(path)


def test_an_image_for_which_memory_is_short(monkeypatch):
    cv2 = opencv.cv2

    def fail(*_, **__):
        error = cv2.error("Insufficient memory")
        error.code, error.err = cv2.Error.StsNoMem, "Failed to allocate 3 bytes"
        raise error

    monkeypatch.setattr(cv2, "imdecodeWithMetadata", fail)
    with pytest.raises(MemoryError, match=r"a\.png: Failed to allocate"):
        opencv.decode_image(b"\x89PNG", "a.png")
    monkeypatch.undo()
    with pytest.raises(DataError):
        opencv.decode_image(b"\x89PNG", "a.png")


@pytest.mark.skipif(sys.platform != "linux", reason="other systems limit memory otherwise")
@pytest.mark.parametrize("mib", [60, 150, 220, 400])
@pytest.mark.quick_cases(1)
def test_a_limit_on_memory(tmp_path, mib):
    np.save(tmp_path / "s.npy", np.zeros((3, 4, 5), np.uint8))
    (tmp_path / "e.txt").write_text("0.1 1 1 1\n0.2 2 2 0\n")
    made = {"s.npy": ("convert", "--fps", "10", "-o", tmp_path / "o.txt"), "e.txt": ("info",)}
    code = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_AS, "
        f"({mib} << 20,) * 2);"
        "from adv2e.__main__ import main; main()"
    )
    for name, (command, *more) in made.items():
        run = subprocess.run(
            [sys.executable, "-c", code, command, tmp_path / name, *more],
            capture_output=True, text=True, timeout=100, check=False,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        )  # fmt: skip
        assert run.returncode in (0, 1), run.stderr
        if run.returncode:
            assert run.stderr.startswith("adv2e: error: not enough memory"), run.stderr
            assert run.stderr.count("\n") == 1

"""Conversions that do not come to their end: signals, readers that stop, full disks."""

import signal
import sys
import time

import numpy as np
import pytest
from pictures import picture
from processes import running_python
from threads import wait_until


@pytest.fixture(scope="module")
def long_stack(tmp_path_factory):
    """Frames that take seconds to convert, with millions of events."""
    path = tmp_path_factory.mktemp("long") / "long.npy"
    np.save(path, np.tile([picture(k) for k in range(10)], (1_000, 1, 1)))
    return path


def started(source, output, *options, **more):
    """Start a conversion in a process of its own, with signals as in a terminal."""
    script = (
        "import signal, sys; from adv2e.cli import main;"
        "signal.signal(signal.SIGINT, signal.default_int_handler);"
        "signal.signal(signal.SIGTERM, signal.SIG_DFL);"
        "main(sys.argv[1:])"
    )
    arguments = ["convert", source, "--fps", "100", "-o", output, "--set", "sampling.L=1", *options]
    return running_python(script, *arguments, **more)


def is_long(path):
    return path.stat().st_size > 10**5


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("threads", ["1", "2"])
@pytest.mark.parametrize(("name", "status"), [("SIGINT", 130), ("SIGTERM", 143)])
@pytest.mark.thorough
def test_a_signal_ends_a_conversion_without_a_trace(long_stack, tmp_path, name, status, threads):
    target = tmp_path / "results"
    target.mkdir()
    with started(long_stack, target / "out.txt", "--threads", threads) as process:
        wait_until(lambda: any(map(is_long, target.glob(".adv2e.*/*.txt"))), seconds=60)
        process.send_signal(getattr(signal, name))
        _, err = process.communicate(timeout=120)
    assert process.returncode == status, err
    assert len(err.splitlines()) == 1
    assert list(target.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("name", ["out.h5", "out"])
@pytest.mark.thorough
def test_what_a_killed_conversion_left_goes_with_the_next(adv2e, long_stack, tmp_path, name):
    target = tmp_path / "results"
    (target / "sub").mkdir(parents=True)
    preview = ["--preview", target / "sub" / "a.gif"]
    stack = tmp_path / "short.npy"
    np.save(stack, np.array([picture(k) for k in range(4)]))
    short = ["convert", stack, "--fps", "100", "--set", "sampling.L=1"]
    before = ["-o", tmp_path / name, "--preview", tmp_path / "a.gif"]
    assert adv2e(*short, *before).status == 0  # and nothing is left to compile
    with started(long_stack, target / name, *preview) as process:
        wait_until(lambda: is_written(target), seconds=60)
        process.kill()
        process.wait()
    assert not (target / name).exists()
    assert is_written(target)
    for place in (target, target / "sub"):
        assert adv2e(*short, "-o", place / "other.h5").status == 0
    left = sorted(path.relative_to(target).as_posix() for path in target.rglob("*"))
    assert left == ["other.h5", "sub", "sub/other.h5"]


def is_written(target):
    """Tell whether something was written for each of two outputs."""
    return all(any(place.glob(".adv2e.*.part/new*")) for place in (target, target / "sub"))


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("threads", ["1", "2"])
@pytest.mark.quick_cases(1)
def test_a_signal_ends_a_conversion_in_the_midst_of_compiled_code(tmp_path, threads):
    """Frames half a minute apart: each call makes millions of leak events."""
    stack, times = tmp_path / "stack.npy", tmp_path / "times.txt"
    np.save(stack, np.array([picture(k) for k in range(20)]))
    times.write_text("".join(f"{1_500_000_000 + 30 * k}\n" for k in range(20)))
    options = ["--timestamps", times, "-o", tmp_path / "out.txt", "--threads", threads]
    options += ["--set", "pixel.leak.rate_hz=300"]
    with running_python(
        "import sys; from adv2e.cli import main; main(sys.argv[1:])",
        *("convert", stack, *options, "--no-progress"),
        text=True,
    ) as process:
        assert "times.txt: no unit is stated: times 30 apart are taken as s" in (
            process.stderr.readline()
        )
        time.sleep(1.0)
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=120) == 143
    assert sorted(path.name for path in tmp_path.iterdir()) == ["stack.npy", "times.txt"]


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.thorough
def test_an_interrupt_ends_a_conversion_whose_reader_has_stopped_reading(long_stack):
    with started(long_stack, "-") as process:
        assert process.stdout.read(100).startswith(b"0.0")
        time.sleep(1)  # the pipe is full by now
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=120) == 130


@pytest.mark.parametrize("name", ["out.txt", "out.h5", "out.zip", "out"])
@pytest.mark.thorough
def test_a_full_disk_ends_a_conversion_at_once(long_stack, tmp_path, name):
    resource = pytest.importorskip("resource")
    target = tmp_path / "results"
    target.mkdir()

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (10**6, 10**6))

    with started(long_stack, target / name, "-q", preexec_fn=limit) as process:
        _, err = process.communicate(timeout=60)
    assert process.returncode == 1
    (line,) = err.decode().splitlines()
    assert f"{target / name}: cannot be written: File too large" in line
    assert list(target.iterdir()) == []

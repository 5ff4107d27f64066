"""What ends a command: exit status, and one line on stderr."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from processes import running_python

from adv2e.cli import exit_status
from adv2e.cli.exit_status import Terminated
from adv2e.errors import Adv2eWarning, DataError, MissingExtraError, UsageError


def raising(error):
    def ending():
        raise error

    return ending


def test_done_is_0(adv2e, pipeline):
    outcome = adv2e("convert", "clip.mp4")
    assert outcome == (0, "the summary\n", "")


@pytest.mark.parametrize(
    ("error", "status", "line"),
    [
        (DataError("a.png: no image"), 1, "adv2e: error: a.png: no image\n"),
        (DataError("two\nlines.mp4: bad"), 1, "adv2e: error: two\\nlines.mp4: bad\n"),
        (DataError("\udcff\x1b.mp4: bad"), 1, "adv2e: error: \\xff\\x1b.mp4: bad\n"),
        (UsageError("--format x: unknown"), 2, "adv2e: error: --format x: unknown\n"),
        (MissingExtraError("aedat4", "aedat"), 1, "pip install 'adv2e[aedat]'\n"),
        (FileNotFoundError(errno.ENOENT, "No such file", "x.h5"), 1, "error: x.h5: No such file\n"),
        (OSError("no signature"), 1, "adv2e: error: no signature\n"),
        (MemoryError("12 GiB"), 1, "error: not enough memory (see ulimit -v): 12 GiB\n"),
        (EOFError("short"), 1, "internal error: EOFError: short; run with -vv for the traceback\n"),
        (ZeroDivisionError("a\nb"), 1, "ZeroDivisionError: a b; run with -vv for the traceback\n"),
        (KeyboardInterrupt(), 130, "adv2e: interrupted\n"),
        (Terminated(signal.SIGTERM), 143, "adv2e: stopped by SIGTERM\n"),
        (BrokenPipeError(errno.EPIPE, "Broken pipe"), 141, ""),
    ],
)
def test_an_error_is_one_line_and_a_status(adv2e, pipeline, error, status, line):
    pipeline.ending = raising(error)
    outcome = adv2e("convert", "clip.mp4")
    assert outcome.status == status
    assert outcome.out == ""
    assert outcome.err.endswith(line)
    assert outcome.err.count("\n") == (1 if line else 0)


@pytest.mark.parametrize(
    ("signalled", "status"), [(KeyboardInterrupt(), 130), (Terminated(signal.SIGTERM), 143)]
)
def test_a_signal_in_compiled_code_counts_as_the_signal(adv2e, pipeline, signalled, status):
    def ending():
        try:
            raise SystemError("inner returned a result with an exception set") from signalled
        except SystemError as error:
            raise SystemError("outer returned a result with an exception set") from error

    pipeline.ending = ending
    outcome = adv2e("convert", "clip.mp4")
    assert outcome.status == status
    assert outcome.err.count("\n") == 1
    assert "internal" not in outcome.err


def test_vv_shows_the_traceback_of_a_bug(adv2e, pipeline):
    pipeline.ending = raising(ZeroDivisionError("oops"))
    outcome = adv2e("convert", "clip.mp4", "-vv")
    assert outcome.status == 1
    assert "Traceback" in outcome.err
    assert outcome.err.endswith("adv2e: error: internal error: ZeroDivisionError: oops\n")


def test_vv_shows_no_traceback_of_a_mistake_of_the_user(adv2e, pipeline):
    pipeline.ending = raising(DataError("a.png: no image"))
    assert adv2e("convert", "clip.mp4", "-vv").err == "adv2e: error: a.png: no image\n"


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["convert"], "Missing argument 'INPUT': adv2e convert [OPTIONS] INPUT (see 'adv2e conv"),
        (["compare", "a"], "Missing argument 'SIMULATED': adv2e compare [OPTIONS] MEASURED SIMU"),
        (["convert", "a", "--bogus"], "No such option"),
        (["convert", "a", "--threads", "0"], "Invalid value for '--threads': 0"),
        (["convert", "a", "--threads", "-2"], "Invalid value for '--threads': -2"),
        (["convert", "a", "--seed", "-1"], "Invalid value for '--seed'"),
        (["convert", "a", "--seed", "1.5"], "'--seed': '1.5' is not a valid whole number"),
        (["convert", "a", "--seed", str(2**64)], "in the range 0<=x<=18446744073709551615"),
        (["convert", "a", "--set", f"seed={2**64}"], "must be at most 18446744073709551615, got 1"),
        (["compare", "a", "b", "--seed", "9" * 400], "in the range 0<=x<=18446744073709551615"),
        (["characterise", "a", "--seed", str(2**64)], "in the range 0<=x<=18446744073709551615"),
        (["convert", "a", "--set", "pixel.leak"], "--set pixel.leak: must be KEY=VALUE"),
        (["convert", "a", "--set", "pixel.leek=null"], "did you mean 'leak'?"),
        (["render", "a", "-o", "a.foo"], "a film ends in .mp4, .webm, .avi or .gif"),
        (["convert", "a", "-o", ""], "Invalid value for '-o' / '--output': is empty"),
        (["convert", "a", "--fps", "0"], "Invalid value for '--fps': must be above 0 Hz, got 0"),
        (["convert", "a", "--fps", "30000/0"], "must be above 0 Hz, got 30000/0"),
        (["convert", "a", "--fps", "30 fps"], "such as 30, 29.97 or 30000/1001, got '30 fps'"),
        (["info", "a", "--fps", "1e99"], "must be from 1e-6 to 1e9 Hz, got 1e99"),
        (["convert", "a", "--fps", "nan"], "or 30000/1001, got 'nan'"),
        (["convert", "a", "--stop", "inf"], "inf is not a finite number"),
        (["convert", "a", "--start", "-1"], "Invalid value for '--start'"),
        (["convert", "a", "--start", "2", "--stop", "2"], "--stop 2 must be after --start 2"),
        (["convert", "a", "--fps", "9", "--timestamps", "t"], "--fps and --timestamps both give"),
        (["convert", "a", "--seed", "1", "--set", "seed=2"], "--set seed and --seed both say it"),
        (["batch", "a", "b", "--seed", "1", "--set", "seed=2"], "--set seed and --seed both say"),
        (["convert", "a", "--size", "8x6", "--set", "sensor.width=9"], "sensor.width and --size"),
        (["convert", "a", "-q", "-v"], "-q and -v say the opposite: keep one"),
        (["convert", "-", "--from", "events"], "--from events needs a file"),
        (["convert", "a", "--t0", "now"], "Invalid value for '--t0'"),
        (["convrt", "a"], "no such command 'convrt', did you mean 'convert'?"),
        (["--bogus"], "No such option"),
    ],
)
def test_a_wrong_command_line_is_2_and_one_line(adv2e, pipeline, args, said):
    outcome = adv2e(*args)
    assert outcome.status == 2
    assert outcome.err.startswith("adv2e: error: ")
    assert said in outcome.err
    assert outcome.err.count("\n") == 1
    assert pipeline.calls == []


def test_a_wrong_file_is_1(adv2e, pipeline, tmp_path):
    path = tmp_path / "c.yaml"
    path.write_text("seed: 1\npixel: {leek: 1}\n")
    outcome = adv2e("convert", "a", "-c", path)
    assert outcome.status == 1
    assert outcome.err == (
        f"adv2e: error: {path}:2: pixel.leek: unknown key (value 1), did you mean 'leak'?\n"
    )
    assert pipeline.calls == []


def test_no_arguments_show_the_help_as_an_error(adv2e):
    outcome = adv2e()
    assert outcome.status == 2
    assert "Commands:" in outcome.err
    assert outcome.out == ""


# What follows needs a process of its own.

WAITING = """
import pathlib, signal, sys, threading, time, types
# as in a terminal: a test run in the background may have been started with signals ignored
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGTERM, signal.SIG_DFL)
from adv2e.files.staging import Staging
pipeline = types.ModuleType("adv2e.conversion.pipeline")
def wait():
    for _ in range(600):
        time.sleep(0.05)  # a signal that comes just as it begins is met after it
def convert(*args, **options):
    staging = Staging(overwrite=False)
    file = staging.file(pathlib.Path("made", "out.txt"))
    folder = staging.folder(pathlib.Path("made", "out"), lambda old: None)
    staging.prepare()
    file.touch()
    folder.mkdir()
    (folder / "a.png").touch()
    try:
        {work}
    finally:
        staging.discard()
pipeline.convert_reading = convert
sys.modules["adv2e.conversion.pipeline"] = pipeline
from adv2e.cli import main
main(["convert", "clip.mp4"])
"""

SLEEPING = "print('ready', flush=True); wait()"

WANTED = """
        lock = threading.Lock()
        lock.acquire()
        threading.Thread(target=lock.acquire).start()
        print('ready', flush=True)
        while True:
            pass
"""
"""A thread waits for what the main thread holds, and Python at its end for the thread."""

ADDING = """
        def add():
            while True:
                for k in range(1000):
                    try:
                        (folder / str(k)).touch()
                    except OSError:
                        pass
        threading.Thread(target=add, daemon=True).start()
        time.sleep(0.1)
        print('ready', flush=True)
        wait()
"""
"""A thread goes on making files in the folder."""

COMING_INTO_PLACE = """
        unlink = pathlib.Path.unlink
        def slowly(path, *args):
            unlink(path, *args)
            pathlib.Path.unlink = unlink
            print('ready', flush=True)
            wait()
        pathlib.Path.unlink = slowly  # of the first of two outputs, which has its final name
        staging.commit()
"""

NOT_REMOVED = """
        Staging.remove_now = lambda staging: False  # as where open files cannot be
        print('ready', flush=True)
        wait()
"""


@pytest.mark.parametrize(("name", "status"), [("SIGINT", 130), ("SIGTERM", 143)])
@pytest.mark.parametrize(
    "work",
    [
        pytest.param(SLEEPING, id="sleeping"),
        pytest.param(WANTED, id="wanted"),
        pytest.param(ADDING, id="adding"),
        pytest.param(COMING_INTO_PLACE, id="coming into place"),
        pytest.param(NOT_REMOVED, id="not removed"),
    ],
)
@pytest.mark.quick_cases(1)
def test_a_signal_ends_it_tidily(tmp_path, work, name, status):
    script = WAITING.replace("{work}", work)
    with running_python(script, cwd=tmp_path, text=True) as process:
        assert process.stdout.readline() == "ready\n"
        process.send_signal(getattr(signal, name))
        _, err = process.communicate(timeout=120)
    assert process.returncode == status
    assert (
        err
        == {
            "SIGINT": "adv2e: interrupted\n",
            "SIGTERM": "adv2e: stopped by SIGTERM\n",
        }[name]
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize(("name", "status"), [("SIGINT", 130), ("SIGTERM", 143)])
def test_a_signal_while_the_program_is_imported_is_as_quiet(tmp_path, name, status):
    (tmp_path / "click.py").write_text("import time; print('ready', flush=True); time.sleep(30)")
    code = (
        "import signal, sys;"
        "signal.signal(signal.SIGINT, signal.default_int_handler);"
        "signal.signal(signal.SIGTERM, signal.SIG_DFL);"
        f"sys.path.insert(0, {str(tmp_path)!r});"
        "from adv2e.__main__ import main; main()"
    )
    with running_python(code, text=True) as process:
        assert process.stdout.readline() == "ready\n"
        process.send_signal(getattr(signal, name))
        _, err = process.communicate(timeout=120)
    assert process.returncode == status
    assert err in ("adv2e: interrupted\n", "adv2e: stopped by SIGTERM\n")


def test_a_closed_stdout_is_141_and_quiet():
    with subprocess.Popen(
        [sys.executable, "-m", "adv2e", "--help"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        process.stdout.close()
        err = process.stderr.read()
    assert process.returncode == 141
    assert err == b""


@pytest.mark.thorough
def test_a_stdout_that_was_closed_before_is_141_and_quiet(tmp_path):
    frames = tmp_path / "frames.npy"
    np.save(frames, np.full((3, 4, 6), 90, np.uint8))
    code = "import os, sys; os.close(1); os.execv(sys.executable, [sys.executable, *sys.argv[1:]])"
    command = ["-m", "adv2e", "convert", str(frames), "--fps", "100", "-o", "-", "-q"]
    done = subprocess.run(
        [sys.executable, "-c", code, *command], stderr=subprocess.PIPE, check=False
    )
    assert (done.returncode, done.stderr) == (141, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_full_disk_under_stdout_is_1_and_one_line():
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [sys.executable, "-m", "adv2e", "--version"],
            stdout=full,
            stderr=subprocess.PIPE,
            check=False,
        )
    assert done.returncode == 1
    assert done.stderr.startswith(b"adv2e: error: ")
    assert done.stderr.count(b"\n") == 1


HELP = """
import sys
from adv2e.cli import main
try:
    main(sys.argv[1:])
except SystemExit as stop:
    assert not stop.code, stop.code
heavy = {"numpy", "numba", "cv2", "h5py", "yaml", "tqdm"} & set(sys.modules)
assert not heavy, heavy
"""


@pytest.mark.parametrize("args", [["--help"], ["--version"], ["convert", "--help"]])
def test_help_imports_nothing_heavy(args):
    done = subprocess.run(
        [sys.executable, "-c", HELP, *args], capture_output=True, text=True, check=False
    )
    assert done.stderr == ""
    assert done.returncode == 0
    assert "adv2e" in done.stdout


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="threads are counted by Linux")
def test_importing_what_a_conversion_needs_starts_no_threads():
    code = """
import os
from adv2e.cli import main
main.get_command(None, "convert")
import adv2e.conversion.pipeline
print(len(os.listdir("/proc/self/task")))
"""
    environment = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout == "1\n"


@pytest.mark.parametrize(
    ("warning", "filename", "said"),
    [
        (Adv2eWarning("two\nlines"), np.__file__, "adv2e: warning: two\\nlines\n"),
        (UserWarning("of Python 2"), exit_status.__file__, ""),
        (RuntimeWarning("divided by zero"), np.__file__, ""),
        (UserWarning("too slow"), "/own/effect.py", "adv2e: warning: /own/effect.py:7: too slow\n"),
    ],
)
def test_warnings_are_ours_or_about_a_file_of_the_user(capsys, warning, filename, said):
    with warnings.catch_warnings(), exit_status.warnings_for_people():
        warnings.simplefilter("always")
        warnings.warn_explicit(warning, None, filename, 7)
    assert capsys.readouterr() == ("", said)

"""One command in a process of its own, and what is wrong with how it ended.

The process is a copy (fork) of one that has imported all there is, so that each takes a few
milliseconds to begin.
"""

from __future__ import annotations

import faulthandler
import os
import re
import resource
import signal
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

_LIBRARIES = re.compile(
    r"libpng|TIFF|JPEG|\[ ?(WARN|ERROR|INFO)|OpenCV|HDF5|ffmpeg|\] ?@ ?0x|\[[a-z0-9_,]+ @ 0x"
    r"|Traceback|Warning|Error:|terminate called|Assertion",
    re.IGNORECASE,
)
"""What libraries print for themselves."""


@dataclass(frozen=True)
class Limits:
    """What a command may take: computing time [s], time [s], memory beyond the start [MiB]."""

    cpu_s: float = 10.0
    wall_s: float = 60.0
    mib: int = 1024


@dataclass(frozen=True)
class Outcome:
    """How a command ended.

    Attributes
    ----------
    wrong : str
        What is wrong with that; empty: nothing.
    status : int
        Exit status; that of a signal is negative.
    said : str
        What it wrote to standard error.
    """

    wrong: str
    status: int
    said: str
    mib: float


def run(arguments: Sequence[str], folder: Path, limits: Limits) -> Outcome:
    """Run ``adv2e`` with `arguments` in a copy of this process and judge how it ends."""
    said = folder / "stderr"
    hears, tells = os.pipe()
    child = os.fork()
    if not child:
        # the copy itself: what is mapped from files counts in this process alone
        os.write(tells, str(_resident_mib()).encode())
        _become(lambda: _command(arguments), folder, said, limits)
    os.close(tells)
    status, usage, slow = _wait(child, limits)
    began_mib = float(os.read(hears, 64) or 0)
    os.close(hears)
    text = said.read_text("utf-8", errors="replace") if said.exists() else ""
    mib = usage.ru_maxrss / 1024
    code = os.waitstatus_to_exitcode(status)
    wrong = "too slow" if slow or code == -signal.SIGXCPU else judged(code, text)
    if not wrong and mib - began_mib > limits.mib:
        wrong = f"{mib:.0f} MiB"
    return Outcome(wrong, code, text, mib)


def judged(code: int, said: str) -> str:
    """Return what is wrong with an exit status and what was said with it."""
    lines = said.splitlines()
    told = [line for line in lines if line.startswith("adv2e: error:")]
    if code < 0:
        return f"ended by {signal.Signals(-code).name}"
    if code not in (0, 1):
        return f"exit status {code}"
    if "internal error" in said:
        return "internal error"
    if "not enough memory" in said:
        return "too much memory"
    if any(_LIBRARIES.search(line) for line in lines if line not in told):
        return "a library speaks"
    if (len(told), lines[-1:]) != (code, told[-1:] if code else lines[-1:]):
        return f"{len(told)} lines of error with exit status {code}"
    return ""


def _command(arguments: Sequence[str]) -> None:
    from adv2e.__main__ import main  # noqa: PLC0415 - imported already, in the process copied

    sys.argv = ["adv2e", *arguments]
    main()


def _become(action: Callable[[], None], folder: Path, said: Path, limits: Limits) -> None:
    """Be the process that runs one action; never returns."""
    code = 70
    try:
        nothing = os.open(os.devnull, os.O_RDWR)
        errors = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        for number, file in ((0, nothing), (1, nothing), (2, errors)):
            os.dup2(file, number)
        sys.stderr = open(2, "w", 1, closefd=False)  # noqa: SIM115 - pytest has its own
        faulthandler.disable()
        os.chdir(folder)
        seconds = int(time.process_time() + limits.cpu_s) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        most = _virtual_bytes() + (limits.mib << 20)
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        action()
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
    finally:
        os._exit(code)


def _wait(child: int, limits: Limits) -> tuple[int, resource.struct_rusage, bool]:
    """Wait for a process, killing it at the limit; return status, usage, whether it was killed."""
    until = time.monotonic() + limits.wall_s
    pause_s = 0.002
    while True:
        done, status, usage = os.wait4(child, os.WNOHANG)
        if done:
            return status, usage, False
        if time.monotonic() > until:
            os.kill(child, signal.SIGKILL)
            _, status, usage = os.wait4(child, 0)
            return status, usage, True
        time.sleep(pause_s)
        pause_s = min(0.05, 1.5 * pause_s)


def _virtual_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


def _resident_mib() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 2**20

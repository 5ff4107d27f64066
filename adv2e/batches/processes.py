"""Conversions in processes that stay alive over many of them.

Each process compiles and imports once.  If one ends by itself, its sequence has failed and a new
process goes on.  A signal to the program ends them all; where the program itself is killed, they
notice and end.

:func:`start` begins them all.  Not by :mod:`multiprocessing`: what that starts looks for modules in
the current folder first, which may be anybody's, and runs the script of the caller once more.
"""

from __future__ import annotations

import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from pathlib import Path
from typing import Any

from adv2e.batches.work import Job, do
from adv2e.files.workspace import remove_abandoned
from adv2e.process import python_command, signals
from adv2e.process.signals import Terminated, stop_on_signals
from adv2e.process.standard_error import keep_errors_for_ourselves

_LOST_S = 1.0
_END_S = 10.0
"""Time to end in: compiled code is loaded in one step that no signal interrupts."""


class EndedError(Exception):
    """A process ended while it converted."""


def start() -> subprocess.Popen[bytes]:
    """Begin a process of :func:`serve`, which runs no code of the current folder."""
    code = "from adv2e.batches import processes as p; p.serve()"
    return subprocess.Popen(
        python_command(code, str(os.getpid())), stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )


def serve() -> None:
    """Do the jobs that come through standard input, until it ends; answer each on the output.

    Signals end the process, and so does the end of its parent.
    """
    stop_on_signals(silent=True)
    keep_errors_for_ourselves()
    jobs, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    with open(os.devnull, "r+b") as nothing:  # noqa: PTH123
        os.dup2(nothing.fileno(), 0)
        os.dup2(nothing.fileno(), 1)  # what a library prints is no answer
    sys.stdout = sys.stderr  # what an effect of the user's prints is for the user
    threading.Thread(target=_watch, args=(int(sys.argv[1]),), daemon=True).start()
    try:
        with suppress(EOFError, BrokenPipeError):
            while True:
                pickle.dump(do(pickle.load(jobs)), answers)
                answers.flush()
    except KeyboardInterrupt:  # a signal that came while files came into place
        os._exit(128 + signal.SIGINT)
    except Terminated as ending:
        os._exit(ending.exit_status)


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_LOST_S)
    os.kill(os.getpid(), signal.SIGTERM)


def run(jobs: Iterable[Job], count: int) -> Iterator[tuple[Job, dict[str, Any]]]:
    """Yield each job with what :func:`do` returned, as they end; `count` at a time.

    See :data:`adv2e.batches.work.Engine`.
    """
    workers = Workers(count)
    pool = ThreadPoolExecutor(count)
    signals.add(workers)
    try:
        coming = iter(jobs)
        flying: dict[Future[dict[str, Any]], Job] = {}
        while True:
            while len(flying) < count and (job := next(coming, None)) is not None:
                flying[pool.submit(workers.do, job)] = job
            if not flying:
                break
            for future in wait(flying, return_when=FIRST_COMPLETED).done:
                try:
                    found = future.result()
                except EndedError as error:
                    found = {"error": str(error)}
                yield flying.pop(future), found
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        workers.remove_now()
        pool.shutdown()
        workers.close()
        signals.drop(workers)


class Workers(signals.Unfinished):
    """Processes, each of which does one job after the other."""

    def __init__(self, count: int) -> None:
        self._free: queue.SimpleQueue[_Worker] = queue.SimpleQueue()
        self._all = [_Worker() for _ in range(count)]
        self._is_ending = False
        for worker in self._all:
            self._free.put(worker)

    def do(self, job: Job, is_wanted: Callable[[], bool] = lambda: True) -> dict[str, Any]:
        """Return the result of a job by the next free process.

        Raises
        ------
        EndedError
            The process ended meanwhile: by itself, or because the job is no longer wanted.
        """
        worker = self._free.get()
        try:
            if self._is_ending:  # no process may begin that nobody ends
                return {"error": "not begun"}
            return worker.do(job, is_wanted)
        finally:
            self._free.put(worker)

    def remove_now(self) -> bool:
        """End the processes and wait for that: what each was writing is its own to remove."""
        self._is_ending = True
        for worker in self._all:
            worker.kill(signal.SIGTERM)
        until = time.monotonic() + _END_S
        while any(worker.is_there() for worker in self._all) and time.monotonic() < until:
            time.sleep(0.01)
        for worker in self._all:
            worker.kill(getattr(signal, "SIGKILL", signal.SIGTERM))  # Windows has but one
        return True

    def close(self) -> None:
        for worker in self._all:
            worker.close()


class _Worker:
    """One process, and the next where it ended."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def do(self, job: Job, is_wanted: Callable[[], bool]) -> dict[str, Any]:
        process = self._process = self._process or start()
        try:
            with ThreadPoolExecutor(1) as waiting:
                future = waiting.submit(_asked, process, job)
                while not wait([future], timeout=_LOST_S).done:
                    if not is_wanted():
                        self.kill(signal.SIGTERM)
                return future.result()
        except (OSError, EOFError, pickle.UnpicklingError):
            self.close()
            remove_abandoned(Path(job.output).parent)
            raise EndedError(
                f"{job.source}: the process that converted it was ended from outside"
            ) from None

    def close(self) -> None:
        """End the process, if it is there."""
        if self._process is not None:
            self._process.kill()
            with suppress(OSError), self._process:  # closes pipes, and waits
                pass
        self._process = None

    def kill(self, number: int) -> None:
        if self._process is not None:
            self._process.send_signal(number)

    def is_there(self) -> bool:
        return self._process is not None and self._process.poll() is None


def _asked(process: subprocess.Popen[bytes], job: Job) -> dict[str, Any]:
    assert process.stdin is not None and process.stdout is not None
    pickle.dump(job, process.stdin)
    process.stdin.flush()
    found: dict[str, Any] = pickle.load(process.stdout)
    return found

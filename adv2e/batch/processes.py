"""Conversions in processes that stay alive over many of them.

Each process compiles and imports once.  If one ends by itself, its sequence has failed and a new
process goes on.  A signal to the program ends them all; where the program itself is killed, they
notice and end.
"""

from __future__ import annotations

import multiprocessing
import os
import queue
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from pathlib import Path
from typing import Any

from adv2e.batch.work import Job, do
from adv2e.files.workspace import remove_abandoned
from adv2e.process import cleanup
from adv2e.process.signals import Terminated, stop_on_signals

_LOST_S = 1.0
_END_S = 10.0
"""Time to end in: compiled code is loaded in one step that no signal interrupts."""


class EndedError(Exception):
    """A process ended while it converted."""


def run(jobs: Iterable[Job | None], count: int) -> Iterator[tuple[Job, dict[str, Any]]]:
    """Yield each job with what :func:`do` returned, as they end; `count` at a time.

    See :data:`adv2e.batch.work.Engine`.
    """
    workers = Workers(count)
    pool = ThreadPoolExecutor(count)
    cleanup.add(workers)
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
        cleanup.drop(workers)


class Workers(cleanup.Unfinished):
    """Processes, each of which does one job after the other.

    Parameters
    ----------
    count : int
    """

    def __init__(self, count: int) -> None:
        self._free: queue.SimpleQueue[_Worker] = queue.SimpleQueue()
        self._all = [_Worker() for _ in range(count)]
        self._is_ending = False
        for worker in self._all:
            self._free.put(worker)

    def do(self, job: Job, is_wanted: Callable[[], bool] = lambda: True) -> dict[str, Any]:
        """Return what :func:`do` returned in a process that is free, once one is.

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
        """Let go of the processes."""
        for worker in self._all:
            worker.close()


class _Worker:
    """One process, and the next where it ended."""

    def __init__(self) -> None:
        self._pool: ProcessPoolExecutor | None = None
        self._process = 0

    def do(self, job: Job, is_wanted: Callable[[], bool]) -> dict[str, Any]:
        try:
            if self._pool is None:
                context = multiprocessing.get_context("spawn")
                self._pool = ProcessPoolExecutor(1, context, _begin, (os.getpid(),))
                self._process = self._pool.submit(os.getpid).result()
            future = self._pool.submit(_do, job)
            while not wait([future], timeout=_LOST_S).done:
                if not is_wanted():
                    self.kill(signal.SIGTERM)
            return future.result()
        except BrokenProcessPool:
            self.close()
            remove_abandoned(Path(job.output).parent)
            raise EndedError(
                f"{job.source}: the process that converted it was ended from outside"
            ) from None

    def close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
        self._pool, self._process = None, 0

    def kill(self, number: int) -> None:
        if self._process:
            with suppress(OSError):
                os.kill(self._process, number)

    def is_there(self) -> bool:
        if not self._process:
            return False
        try:
            ended, _ = os.waitpid(self._process, os.WNOHANG)
        except OSError:  # somebody else has seen its end
            ended = self._process
        if ended:
            self._process = 0
        return not ended


def _do(job: Job) -> dict[str, Any]:
    """Return what :func:`do` does, unless a signal came: then end this process.

    A signal that comes while files come into place arrives as an exception, see
    :mod:`adv2e.process.signals`.  The pool would take it for a result, and the process would stay.
    """
    try:
        return do(job)
    except KeyboardInterrupt:
        os._exit(128 + signal.SIGINT)
    except Terminated as ending:
        os._exit(ending.exit_status)


def _begin(parent: int) -> None:
    """Make a process of conversions ready: signals end it, and so does the end of its parent."""
    stop_on_signals()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_LOST_S)
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, daemon=True).start()

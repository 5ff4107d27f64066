"""Compression in threads, with results taken in the order in which the work was handed out."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any


def default_threads() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return max(1, len(os.sched_getaffinity(0)))
    return os.cpu_count() or 1


class OrderedWork:
    """Threads that work ahead by a bounded number of tasks.

    What comes out does not depend on the number of threads: results are taken one after the other,
    in the thread that submits, in the order of submission.

    Parameters
    ----------
    threads : int
        Number of threads.
    """

    def __init__(self, threads: int) -> None:
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="adv2e-sink")
        self._pending: deque[tuple[Future[Any], Callable[[Any], None]]] = deque()
        self._ahead = 2 * threads + 4

    def submit(
        self, task: Callable[..., Any], *arguments: Any, take: Callable[[Any], None]
    ) -> None:
        """Run ``task(*arguments)`` in a thread, and later hand its result to `take`."""
        while len(self._pending) >= self._ahead:
            self._take_one()
        self._pending.append((self._pool.submit(task, *arguments), take))

    def finish(self) -> None:
        """Wait for all tasks, take their results and end the threads."""
        while self._pending:
            self._take_one()
        self._pool.shutdown()

    def abandon(self) -> None:
        """Drop what has not begun and end the threads."""
        self._pool.shutdown(cancel_futures=True)

    def _take_one(self) -> None:
        future, take = self._pending.popleft()
        take(future.result())

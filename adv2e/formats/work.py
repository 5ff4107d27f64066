"""Compression in threads, with results taken in the order in which the work was handed out."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

PENDING_BYTES = 64 << 20
"""Memory for the arrays of tasks that were handed out and not taken yet."""


class OrderedWork:
    """Threads that work ahead by a bounded number of tasks, which hold a bounded amount of memory.

    What comes out does not depend on the number of threads: results are taken one after the other,
    in the thread that submits, in the order of submission.

    Parameters
    ----------
    threads : int
        Number of threads beside the one that submits; with none, that one does the work.
    """

    def __init__(self, threads: int) -> None:
        self._pool = (
            ThreadPoolExecutor(threads, thread_name_prefix="adv2e-sink") if threads else None
        )
        self._pending: deque[tuple[Future[Any], Callable[[Any], None], int]] = deque()
        self._held = 0  # bytes of their arrays
        self._ahead = 2 * threads + 4

    def submit(
        self, task: Callable[..., Any], *arguments: Any, take: Callable[[Any], None]
    ) -> None:
        """Run ``task(*arguments)``, and hand its result to `take`, later if in a thread."""
        if self._pool is None:
            take(task(*arguments))
            return
        size = sum(getattr(argument, "nbytes", 0) for argument in arguments)
        while self._pending and not self._has_room(size):
            self._take_one()
        self._pending.append((self._pool.submit(task, *arguments), take, size))
        self._held += size

    def _has_room(self, size: int) -> bool:
        return len(self._pending) < self._ahead and self._held + size <= PENDING_BYTES

    def finish(self) -> None:
        """Wait for all tasks, take their results and end the threads."""
        while self._pending:
            self._take_one()
        if self._pool is not None:
            self._pool.shutdown()

    def abandon(self) -> None:
        """Drop what has not begun and end the threads."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def _take_one(self) -> None:
        future, take, size = self._pending.popleft()
        self._held -= size
        take(future.result())

"""Work beside the main thread, in bounded memory: reading ahead, and tasks with results in order.

>>> with read_ahead(iter(range(3)), 2) as numbers, OrderedWork(1, limit=1 << 20) as work:
...     squares = []
...     for number in numbers:
...         work.submit(pow, number, 2, take=squares.append)
>>> squares
[0, 1, 4]

Both pass on what a thread raises, and both end their threads when their block is left, however it
is left.  Signals reach the main thread alone, which never waits but for these threads; so what can
block for as long as others please, such as a pipe, belongs in the main thread.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

Item = TypeVar("Item")

_END: Any = object()


def default_threads() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return max(1, len(os.sched_getaffinity(0)))
    return os.cpu_count() or 1


@contextmanager
def worker_pool(threads: int) -> Iterator[ThreadPoolExecutor]:
    """Give a pool of threads to a generator; leaving the block waits for them, but not always.

    A generator that nobody exhausts is closed where it becomes garbage.  That may be in any thread
    at any moment, one in which :mod:`threading` holds its own locks among them; who waits there for
    a thread to end, waits for ever.  The threads end by themselves then.
    """
    pool, abandoned = ThreadPoolExecutor(threads), False
    try:
        yield pool
    except GeneratorExit:
        abandoned = True
        raise
    finally:
        pool.shutdown(wait=not abandoned, cancel_futures=abandoned)


@contextmanager
def read_ahead(items: Iterator[Item], count: int) -> Iterator[Iterator[Item]]:
    """Give an iterator over `items`, of which up to `count` are made ahead, in a thread.

    What making an item raises is raised after the items before it.  The source is advanced, and
    closed if it can be, by that thread only.
    """
    pool = ThreadPoolExecutor(1, thread_name_prefix="adv2e-read")
    ahead: deque[Future[Item]] = deque()

    def more() -> None:
        while len(ahead) < count:
            ahead.append(pool.submit(next, items, _END))

    def made() -> Iterator[Item]:
        while True:
            more()
            item = ahead.popleft().result()
            if item is _END:
                return
            yield item
            del item  # or it would stay while the next one is waited for

    try:
        more()
        yield made()
    finally:
        for future in ahead:
            future.cancel()
        pool.submit(getattr(items, "close", int))
        pool.shutdown()


class OrderedWork:
    """Tasks in threads, a bounded number of them in a bounded amount of memory.

    What comes out does not depend on the number of threads: results are taken one after the other,
    in the thread that submits, in the order of submission.  When a task fails, those that have not
    begun are dropped, and the next call of :meth:`submit` or :meth:`finish` raises what it raised.

    As a context, it ends by :meth:`finish`, or by :meth:`abandon` where the block raises.

    Parameters
    ----------
    threads : int
        Number of threads beside the one that submits; with none, that one does the work.
    limit : int
        Memory of the tasks that were handed out and not taken yet [bytes]; one larger than that
        waits alone.
    count : int, optional
        Most tasks that were handed out and not taken yet; default: two a thread, and four.
    """

    def __init__(self, threads: int, *, limit: int = 64 << 20, count: int | None = None) -> None:
        self._pool = (
            ThreadPoolExecutor(threads, thread_name_prefix="adv2e-write") if threads else None
        )
        self._pending: deque[tuple[Future[Any], Callable[[Any], object], int]] = deque()
        self._held = 0
        self._limit, self._count = limit, count or 2 * threads + 4
        self._failed = False

    def submit(
        self,
        task: Callable[..., Any],
        *arguments: Any,
        take: Callable[[Any], object] = lambda result: None,
    ) -> None:
        """Run ``task(*arguments)``, and hand its result to `take`, later if in a thread."""
        if self._pool is None:
            take(task(*arguments))
            return
        size = sum(getattr(argument, "nbytes", 0) for argument in arguments)
        while self._pending and (self._pending[0][0].done() or not self._has_room(size)):
            self._take_one()
        self._pending.append((self._pool.submit(self._run, task, arguments), take, size))
        self._held += size

    def finish(self) -> None:
        """Wait for all tasks, take their results and end the threads."""
        try:
            while self._pending:
                self._take_one()
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Drop tasks that have not begun, and end the threads."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
        self._pending.clear()

    def _has_room(self, size: int) -> bool:
        return len(self._pending) < self._count and self._held + size <= self._limit

    def _run(self, task: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        if self._failed:
            return None
        try:
            return task(*arguments)
        except BaseException:
            self._failed = True
            raise

    def _take_one(self) -> None:
        future, take, size = self._pending.popleft()
        self._held -= size
        take(future.result())

    def __enter__(self) -> OrderedWork:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        (self.finish if kind is None else self.abandon)()

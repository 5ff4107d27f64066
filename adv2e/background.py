"""Work beside the main thread: reading ahead of it and writing behind it, in bounded memory.

>>> with ReadAhead(iter(range(3)), cost=lambda item: 1, limit=2) as numbers, WriteBehind(2) as late:
...     squares = []
...     for number in numbers:
...         late.call(1, squares.append, number * number)
>>> squares
[0, 1, 4]

Both pass on what the thread raises, and both end their thread when their block is left, however
it is left.  Signals reach the main thread alone, which never waits but for these threads; so what
can block for as long as others please, such as a pipe, belongs in the main thread.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from types import TracebackType
from typing import Any, Generic, TypeVar

Item = TypeVar("Item")


class _Channel(Generic[Item]):
    """Items from one thread to another, at most `limit` in cost; a dearer one passes alone.

    An item weighs until the one after it is asked for, so that what the taker works on counts.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._items: deque[tuple[Item, int]] = deque()
        self._held = 0
        self._in_work = 0
        self._closed = False
        self._changed = threading.Condition()

    def put(self, item: Item, cost: int) -> bool:
        """Hand `item` on, once there is room; tell whether it can still be taken."""
        with self._changed:
            self._changed.wait_for(
                lambda: self._closed or not self._held or self._held + cost <= self._limit
            )
            if not self._closed:
                self._items.append((item, cost))
                self._held += cost
                self._changed.notify_all()
            return not self._closed

    def take(self) -> Item | None:
        """Return the next item, once there is one; None when the channel is closed."""
        with self._changed:
            self._held -= self._in_work
            self._in_work = 0
            self._changed.notify_all()
            self._changed.wait_for(lambda: self._closed or bool(self._items))
            if self._closed:
                return None
            item, self._in_work = self._items.popleft()
            return item

    def close(self) -> None:
        """Drop what was not taken and let nobody wait any longer."""
        with self._changed:
            self._closed = True
            self._items.clear()
            self._changed.notify_all()


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


class ReadAhead(Generic[Item]):
    """An iterator whose items are made in a thread of its own.

    To be iterated over once, inside a ``with`` block.  What the iterator raises is raised here
    after the items before it; it is advanced, and closed if it is a generator, by its thread only.

    Parameters
    ----------
    items : iterator
    cost : callable
        Memory that an item takes, in the unit of `limit`.
    limit : int
        Most that the items made ahead, with the one at hand, may take.  One item is made ahead
        whatever it takes.
    """

    def __init__(self, items: Iterator[Item], *, cost: Callable[[Item], int], limit: int) -> None:
        self._source = items
        self._cost = cost
        self._channel: _Channel[tuple[Item | None, BaseException | None]] = _Channel(limit)
        self._thread = threading.Thread(target=self._run, name="adv2e-read", daemon=True)

    def _run(self) -> None:
        try:
            self._advance()
        except BaseException as error:  # whatever it is, the main thread is to end with it
            self._channel.put((None, error), 0)
        else:
            self._channel.put((None, StopIteration()), 0)

    def _advance(self) -> None:
        try:
            for item in self._source:
                if not self._channel.put((item, None), self._cost(item)):
                    return
                del item  # or it would stay while the next one is made
        finally:
            close = getattr(self._source, "close", None)
            if close is not None:
                close()

    def __iter__(self) -> Iterator[Item]:
        return self

    def __next__(self) -> Item:
        taken = self._channel.take()
        if taken is None:
            raise StopIteration
        item, end = taken
        if end is not None:
            self._channel.close()
            raise end
        return item  # type: ignore[return-value]  # there is one where there is no end

    def __enter__(self) -> ReadAhead[Item]:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._channel.close()
        self._thread.join()


class WriteBehind:
    """Carries out calls one after the other in a thread of its own.

    To be used inside a ``with`` block, which ends when all calls are done; if it ends by an
    exception, calls that have not begun are dropped.  When a call fails, those after it are
    dropped, and the next :meth:`call`, or the end of the block, raises what it raised.

    Parameters
    ----------
    limit : int
        Most that the calls waiting and at work may cost together, one dearer than that aside.
    """

    def __init__(self, limit: int) -> None:
        self._channel: _Channel[Callable[[], Any] | None] = _Channel(limit)
        self._failure: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="adv2e-write", daemon=True)

    def call(self, cost: int, function: Callable[..., Any], *arguments: Any) -> None:
        """Have ``function(*arguments)`` called; wait while there is no room for its `cost`."""
        if not self._channel.put(lambda: function(*arguments), cost):
            self._raise_failure()

    def _run(self) -> None:
        try:
            while (task := self._channel.take()) is not None:
                task()
                del task  # or what it holds would stay until the next one
        except BaseException as error:  # whatever it is, the main thread is to end with it
            self._failure = error
            self._channel.close()

    def _raise_failure(self) -> None:
        if self._failure is not None:
            failure, self._failure = self._failure, None
            raise failure

    def __enter__(self) -> WriteBehind:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if kind is None and self._channel.put(None, 0):
                self._thread.join()
        finally:
            self._channel.close()
            self._thread.join()
        if kind is None:
            self._raise_failure()

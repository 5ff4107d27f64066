"""Numba, and what is told to and by it.  Whoever imports this imports Numba."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import numba
from numba.core import event
from numba.extending import typeof_impl

from adv2e.compilation.code_cache import CodeCache

_numba: Any = numba
_event: Any = event
_typeof: Any = typeof_impl


def make_dispatcher(
    function: Callable[..., Any], cache: CodeCache, *, kept: bool, **options: Any
) -> Any:
    """Return Numba's stand-in for a function, whose code is kept in `cache`.

    Numba looks at its setting for the folder when a function is decorated; whoever else uses Numba
    in this process keeps his own.
    """
    config = _numba.config
    before, config.CACHE_DIR = config.CACHE_DIR, str(cache.folder or "")
    try:
        return _numba.njit(
            nogil=True,
            error_model="numpy",
            fastmath={"contract"},
            cache=kept and cache.folder is not None,
            **options,
        )(function)
    finally:
        config.CACHE_DIR = before


def warm_up() -> None:
    """Have Numba load all that it looks up when it compiles or loads for the first time."""
    _numba.njit(lambda: None)()


def know_type(of: type[Any]) -> None:
    """Have Numba take an object of a class for its attribute ``dispatcher``."""

    def type_of(value: Any, _: Any) -> Any:
        return _numba.typeof(value.dispatcher)

    _typeof.register(of)(type_of)


def listen(cache: CodeCache, watcher: Callable[[Callable[..., Any]], None]) -> None:
    """Hold the lock of `cache` while Numba writes to it; tell of what is about to be compiled.

    Parameters
    ----------
    cache : CodeCache
    watcher : callable
        Called with each Python function.
    """
    listener = _Listener(cache, watcher)
    for kind in ("numba:compiler_lock", "numba:compile"):
        _event.register(kind, listener)


class _Listener(_event.Listener):  # type: ignore[misc]
    """Numba tells before it takes its lock, around compiling, and after it has given the lock back.

    It writes the code of a function between the last two.  In its lock, other functions may be
    compiled and written, which those that are being compiled call.
    """

    def __init__(self, cache: CodeCache, watcher: Callable[[Callable[..., Any]], None]) -> None:
        self._cache, self._watcher = cache, watcher
        self._lock = threading.RLock()
        self._depth = self._writes_at = 0

    def on_start(self, event: Any) -> None:
        if event.kind == "numba:compile":
            self._watcher(event.data["dispatcher"].py_func)
            return
        self._lock.acquire()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        if event.kind == "numba:compile":
            self._cache.lock()
            self._writes_at = self._depth
            return
        if self._writes_at == self._depth:
            self._writes_at = 0
            self._cache.note_files()
            self._cache.unlock()
        self._depth -= 1
        self._lock.release()

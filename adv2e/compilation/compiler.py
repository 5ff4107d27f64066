"""Numba, and what is told to and by it.  Whoever imports this imports Numba.

By itself, Numba reads ``.numba_config.yaml`` in the current folder when it is imported, and again
before each function that it compiles.  That folder may be anybody's, and the file could choose
another processor, or none, without a word.  So the file has no name here: the settings are those of
the environment.  Where a program imported Numba before, that is left as it is.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType
from typing import Any

from adv2e.compilation.code_cache import CodeCache
from adv2e.errors import Adv2eError

_SETTINGS, _FILE = "numba.core.config", ".numba_config.yaml"


class _WithoutFile(SourceFileLoader):
    """Loads the module of Numba's settings with an empty name for the file: none is found."""

    def get_code(self, fullname: str) -> CodeType | None:
        code = super().get_code(fullname)
        if code is None or _FILE not in code.co_consts:  # Numba names it elsewhere
            if Path(_FILE).exists():
                raise Adv2eError(f"{_FILE}: would be read by Numba: remove or rename it")
            return code
        return code.replace(co_consts=tuple("" if c == _FILE else c for c in code.co_consts))


class _Finder(MetaPathFinder):
    """Finds that module alone."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: object = None
    ) -> ModuleSpec | None:
        found = PathFinder.find_spec(fullname, path) if fullname == _SETTINGS else None
        if found is not None and found.origin is not None:
            found.loader = _WithoutFile(fullname, found.origin)
        return found


def _import_numba() -> tuple[Any, Any, Any]:
    finder = _Finder()
    sys.meta_path = [finder, *sys.meta_path]
    try:
        names = "numba", "numba.core.event", "numba.extending"
        numba, event, extending = map(import_module, names)
    finally:
        # another thread may import meanwhile, and would miss a finder if its list became shorter
        sys.meta_path = [one for one in sys.meta_path if one is not finder]
    return numba, event, extending.typeof_impl


_numba: Any
_event: Any
_typeof: Any
_numba, _event, _typeof = _import_numba()


def make_dispatcher(
    function: Callable[..., Any],
    cache: CodeCache,
    *,
    kept: bool,
    called_from_python: bool,
    **options: Any,
) -> Any:
    """Return Numba's stand-in for a function, whose code is kept in `cache`.

    Numba looks at its setting for the folder when a function is decorated; whoever else uses Numba
    in this process keeps his own.  Code with and without a wrapper for Python has the same name
    there, and so a folder each.
    """
    config = _numba.config
    form = "entries" if called_from_python else "parts"
    before, config.CACHE_DIR = config.CACHE_DIR, str(cache.folder / form if cache.folder else "")
    try:
        return _numba.njit(
            nogil=True,
            error_model="numpy",
            fastmath={"contract"},
            no_cpython_wrapper=not called_from_python,
            no_cfunc_wrapper=True,
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

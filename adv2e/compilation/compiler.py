"""Numba, and what is told to and by it.  Whoever imports this imports Numba.

By itself, Numba reads ``.numba_config.yaml`` in the current folder when it is imported, and again
before each function that it compiles.  That folder may be anybody's, and the file could choose
another processor, or none, without a word.  So the file has no name here: the settings are those of
the environment.  Where a program imported Numba before, that is left as it is.
"""

from __future__ import annotations

import re
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
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
    """Finds that module, and no SciPy for the thread that makes it.

    Where SciPy is installed, Numba imports half of it, to tell whether it could compile linear
    algebra: as much as OpenCV and h5py together.  Nothing here needs that; functions of others that
    do, import it when they are compiled.
    """

    def __init__(self) -> None:
        self._thread = threading.get_ident()

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: object = None
    ) -> ModuleSpec | None:
        if f"{fullname}.".startswith("scipy.") and threading.get_ident() == self._thread:
            raise ModuleNotFoundError(f"No module named {fullname!r}", name=fullname)
        found = PathFinder.find_spec(fullname, path) if fullname == _SETTINGS else None
        if found is not None and found.origin is not None:
            found.loader = _WithoutFile(fullname, found.origin)
        return found


@contextmanager
def lean_imports() -> Iterator[None]:
    """Have this thread import Numba and what it loads later, but no SciPy and not that file."""
    finder = _Finder()
    sys.meta_path = [finder, *sys.meta_path]
    try:
        yield
    finally:
        # another thread may import meanwhile, and would miss a finder if its list became shorter
        sys.meta_path = [one for one in sys.meta_path if one is not finder]


with lean_imports():
    _numba: Any = import_module("numba")
    _event: Any = import_module("numba.core.event")
    _typeof: Any = import_module("numba.extending").typeof_impl

VERSION: str = _numba.__version__


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
    in this process keeps his own.
    """
    config = _numba.config
    folder = cache.checked(_folders(function)[not called_from_python]) if kept else None
    before, config.CACHE_DIR = config.CACHE_DIR, str(folder or "")
    try:
        return _numba.njit(
            nogil=True,
            error_model="numpy",
            fastmath={"contract"},
            no_cpython_wrapper=not called_from_python,
            no_cfunc_wrapper=True,
            cache=folder is not None,
            **options,
        )(function)
    finally:
        config.CACHE_DIR = before


def _folders(function: Callable[..., Any]) -> tuple[str, str]:
    """Return the folders of a function's code, with and without a wrapper for Python.

    Numba gives the files of both the same names.
    """
    name = re.sub(r"[^\w.]", "_", f"{function.__module__}.{function.__qualname__}")
    return f"entries/{name}", f"parts/{name}"


def is_kept(function: Callable[..., Any], cache: CodeCache) -> bool:
    """Tell whether the cache has code of a function that compiled functions call."""
    folder = cache.folder / _folders(function)[1] if cache.folder else None
    return folder is not None and any(folder.glob("*/*.nbi"))


def types_of(arguments: Sequence[Any]) -> tuple[Any, ...]:
    """Return the types that Numba gives arguments."""
    return tuple(map(_numba.typeof, arguments))


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
        self._written: Any = None

    def on_start(self, event: Any) -> None:
        if event.kind == "numba:compile":
            self._watcher(event.data["dispatcher"].py_func)
            return
        self._lock.acquire()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        if event.kind == "numba:compile":
            self._cache.lock()
            self._writes_at, self._written = self._depth, event.data["dispatcher"].py_func
            return
        if self._writes_at == self._depth:
            self._writes_at = 0
            for folder in _folders(self._written):
                self._cache.note_files(folder)
            self._cache.unlock()
        self._depth -= 1
        self._lock.release()

"""Decorators for compiled functions, and where their machine code is kept.

A compiled function is a :func:`kernel`, or an :func:`entry` where Python calls it: the code of an
entry is kept so that it runs without Numba, which is imported only to compile.

Numba's own cache looks only at the file that a function stands in, so a function that calls an
edited one from another file would run as its old self.  The cache folder is therefore named after
a digest of all sources that hold compiled code.  It lies in the user's cache folder (or below
``NUMBA_CACHE_DIR`` where that is set), so that a read-only installation starts fast too; see
:mod:`adv2e.compilation.kept`.  Folders of other sources are removed when they have not been used
for a month.

Compiled functions release the interpreter lock and run in ordinary threads, one tile each.
Fast-math is off, but for one flag: ``contract`` lets a product and a sum round once (FMA), which
halves the time of every polynomial here; sums are not reordered and NaN stays NaN.  Divisions
follow IEEE rules (``error_model="numpy"``), because Python's check for zero keeps a loop from
vectorising.
"""

from __future__ import annotations

import hashlib
import os
import sys
import threading
from collections.abc import Callable
from functools import cached_property, lru_cache, update_wrapper
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar

from adv2e.compilation.kept import Place, place_for
from adv2e.compilation.machine_code import file_of, lay_out, load, read_code, write_code

Function = TypeVar("Function", bound=Callable[..., Any])

_PACKAGE = Path(__file__).resolve().parent
_PLAIN = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
_LOADING, _PLACING = threading.Lock(), threading.Lock()


def sources() -> list[Path]:
    """Return every source file that compiled code, or the way it is kept, is made of.

    Those that use the decorator, and the whole kernel: offsets and sizes of rows, which compiled
    code takes in as constants, stand in files without a compiled function.
    """
    whole = {_PACKAGE / "kernel", _PACKAGE / "compilation"}
    return [
        path
        for path in sorted(_PACKAGE.rglob("*.py"))
        if path.stem == "compiled"
        or not whole.isdisjoint(path.parents)
        or b"adv2e.compiled" in path.read_bytes()
    ]


def _digest() -> str:
    """Return a digest of every source file that compiled code is made of."""
    digest = hashlib.sha256(f"{sys.version_info[:2]}".encode())
    spec = find_spec("numba")  # its version, without importing it
    if spec is not None and spec.origin is not None:
        digest.update(Path(spec.origin).with_name("_version.py").read_bytes())
    for path in sources():
        digest.update(path.relative_to(_PACKAGE).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def _place() -> Place:
    """Return where code is kept; found, and made, when code is first wanted."""
    with _PLACING:
        return _placed()


@lru_cache(maxsize=1)
def _placed() -> Place:
    return place_for(f"kernels-{_digest()}")


def announcement() -> str:
    """Return what is said before the pixel is compiled."""
    lost = _place().why_lost or _place().why_full
    when = f"in every run, as it cannot be kept: {lost}" if lost else "once"
    return f"compiling the pixel's kernel ({when}; about half a minute)"


def others_find_code() -> bool:
    """Tell whether other processes find what is compiled in this one, and it what they compile."""
    return not _place().why_full


def environment() -> dict[str, str]:
    """Return the environment in which another process keeps its code where this one does."""
    if not _place().why_lost:
        return dict(os.environ)
    return {**os.environ, "NUMBA_CACHE_DIR": str(_place().folder.parent.parent)}


def _numba() -> Any:
    """Return the module that imports Numba, which takes as long as all else together."""
    from adv2e.compilation import translation  # noqa: PLC0415

    return translation


class _Compiled:
    """A function for other compiled functions, and for whoever calls it seldom.

    All that Numba wants to know of a compiled function is asked of `dispatcher`, which is made,
    and Numba imported, when it is first wanted.
    """

    def __init__(self, function: Callable[..., Any], **options: Any) -> None:
        update_wrapper(self, function)
        self._function = function
        self._options = options

    def __getattr__(self, name: str) -> Any:
        if name == "dispatcher":
            # without a lock: whoever compiles another function may ask for it, and wait for Numba's
            options = {**self._options, "cached": self._options["cached"] and self._is_of_package()}
            made = _numba().make_dispatcher(self._function, _place().folder, **options)
            return self.__dict__.setdefault(name, made)
        if name.startswith("__"):  # asked of all objects, by whoever copies or inspects
            raise AttributeError(name)
        return getattr(self.dispatcher, name)

    def _is_of_package(self) -> bool:
        """Tell whether its source is one of those that the folder's name stands for."""
        return _PACKAGE in Path(self._function.__code__.co_filename).resolve().parents

    def __call__(self, *arguments: Any) -> Any:
        return self.dispatcher(*arguments)


class _Entry(_Compiled):
    """A function that Python calls: with code that is there, Numba is not needed."""

    def __init__(self, function: Callable[..., Any], **options: Any) -> None:
        super().__init__(function, **options)
        self._calls: dict[Any, Callable[[list[Any]], Any] | None] = {}

    def __call__(self, *arguments: Any) -> Any:
        kind, contents = lay_out(arguments)
        if kind not in self._calls:
            with _LOADING:
                if kind not in self._calls:
                    self._calls[kind] = self._code(kind, arguments)
        call = self._calls[kind]
        return call(contents) if call else self.dispatcher(*arguments)

    def _code(self, kind: Any, arguments: tuple[Any, ...]) -> Callable[[list[Any]], Any] | None:
        if not self._is_of_package():
            return load(_numba().translate(self.dispatcher, arguments), kind)
        name = f"{self._function.__module__}.{self._function.__qualname__}"
        path = file_of(_place().folder, name, kind)
        code = read_code(path)
        if code is None:
            code = _numba().translate(self.dispatcher, arguments)
            write_code(path, code)
        return load(code, kind)


class _Intrinsic:
    """A function that writes code for LLVM itself."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.__doc__ = function.__doc__
        self._function = function

    @cached_property
    def _numba_type_(self) -> Any:
        return _numba().type_of_intrinsic(self._made)

    @cached_property
    def _made(self) -> Any:
        # Numba knows it as long as it is there
        return _numba().make_intrinsic(self._function)


def kernel(function: Function) -> Function:
    """Compile `function`, kept for the next run; it must not make arrays."""
    return _wrapped(_Compiled, function, cached=True)


def entry(function: Function) -> Function:
    """Compile a kernel that Python calls often, or at the start: Numba is imported to compile only.

    It takes numbers, arrays, and tuples and named tuples of these, all by position, and returns
    numbers or nothing; what returns anything else, Numba calls.
    """
    return _wrapped(_Entry, function, cached=True)


def inlined(function: Function) -> Function:
    """Compile `function` into each of its callers: for long functions with one caller."""
    return _wrapped(_Compiled, function, cached=False, inline="always")


def intrinsic(plainly: Function) -> Callable[[Callable[..., Any]], Function]:
    """Make a function an intrinsic; `plainly` does the same where nothing is compiled."""

    def make(function: Callable[..., Any]) -> Any:
        return plainly if _PLAIN else _Intrinsic(function)

    return make


def _wrapped(how: type[_Compiled], function: Function, **options: Any) -> Function:
    return function if _PLAIN else how(function, **options)  # type: ignore[return-value]


def is_cached(name: str) -> bool:
    """Tell whether there is compiled code of the function `name`, of these sources."""
    folder = _place().folder
    return any(folder.glob(f"*.{name}-*.code")) or any(folder.rglob(f"*.{name}-*.nbc"))

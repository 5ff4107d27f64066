"""Decorators for compiled functions: Numba compiles them, and keeps their code for later runs.

A compiled function is a :func:`kernel`; an :func:`inlined` one becomes part of each of its callers.
The compiler optimises all code below a function with that function, so what is called by one that
is called by one is compiled three times: those near the top, with one caller, are inlined.  A
second process compiles parts that take long (:func:`in_parts`).
Numba is imported when the first of them is called, as it takes as long as a small conversion:
what computes nothing, such as ``adv2e info``, does without, and ``adv2e convert`` imports it
while the input is opened (:func:`import_ahead`).

Numba's cache looks only at the file that a function stands in, so a function that calls an edited
one from another file would run as its old self.  The cache folder is therefore named after a
digest of all sources that hold compiled code; see :mod:`adv2e.compilation.code_cache`.

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
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache, update_wrapper
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from adv2e.background import default_threads
from adv2e.compilation.ahead import compiled_beside
from adv2e.compilation.code_cache import CodeCache

Function = TypeVar("Function", bound=Callable[..., Any])
Part = tuple[Any, tuple[Any, ...]]
"""Compiled function, and arguments of the types that it is called with."""

_PACKAGE = Path(__file__).resolve().parent
_PLAIN = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
_MAKING = threading.RLock()
_AHEAD = threading.Lock()
_EXTENDING = threading.Lock()
_extensions: list[Callable[[], None]] = []
_is_imported = threading.Event()
_watchers: list[Callable[[Callable[..., Any]], None]] = []


def sources() -> dict[str, bytes]:
    """Return every source file that compiled code is made of, by its name below the package.

    Those that use a decorator, what compiles them, the whole kernel, and the causes: offsets, sizes
    and numbers, which compiled code takes in as constants, stand in files without a compiled
    function.
    """
    whole, found = ("compiled.py", "causes.py", "kernel/", "compilation/"), {}
    for folder, _, files in os.walk(_PACKAGE):  # in a third of the time of Path.rglob
        below = folder[len(str(_PACKAGE)) + 1 :].replace(os.sep, "/")
        for file in files:
            if not file.endswith(".py"):
                continue
            name = f"{below}/{file}" if below else file
            with open(f"{folder}/{file}", "rb") as opened:  # noqa: PTH123
                source = opened.read()
            if name.startswith(whole) or (below != "cli" and b"adv2e.compiled" in source):
                found[name] = source
    return dict(sorted(found.items()))


@cache
def code_cache() -> CodeCache:
    """Return the cache of compiled code; its folder is made when code is first wanted."""
    from adv2e.compilation.compiler import VERSION  # noqa: PLC0415

    digest = hashlib.sha256(f"{sys.version_info[:2]} {VERSION}".encode())
    for name, source in sources().items():
        digest.update(name.encode() + b"\0" + source)
    return CodeCache(f"kernels-{digest.hexdigest()[:16]}")


class Compiled:
    """Compiled function, in two forms.

    Python calls its `entry`, compiled functions its `dispatcher`, of which Numba's attributes are
    those of this.  The latter has no wrapper that unpacks Python's objects: for records of arrays
    that takes longer to compile than the rest.
    """

    def __init__(self, function: Callable[..., Any], **options: Any) -> None:
        update_wrapper(self, function)
        self.function = function
        self.is_inlined = "inline" in options
        self.parts: Callable[..., tuple[Sequence[Part], Sequence[Part]]] | None = None
        self._options = options

    def __call__(self, *arguments: Any) -> Any:
        """Call it; it is compiled for each new kind of arguments."""
        if "entry" not in self.__dict__:
            return _with_room(self, arguments)
        return self.entry(*arguments)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):  # asked of all objects, by whoever copies or inspects
            raise AttributeError(name)
        if name not in ("dispatcher", "entry"):
            return getattr(self.dispatcher, name)
        with _MAKING:
            if name not in self.__dict__:
                path = Path(self.function.__code__.co_filename).resolve()
                self.__dict__[name] = _compiler().make_dispatcher(
                    self.function,
                    code_cache(),
                    # the name of the folder stands for the sources of this package alone
                    kept=not self.is_inlined and _PACKAGE in path.parents,
                    called_from_python=name == "entry",
                    **self._options,
                )
        return self.__dict__[name]


def _with_room(function: Compiled, arguments: tuple[Any, ...]) -> Any:
    """Call a function that may have to be compiled, with room on Python's stack.

    Python takes memory for its stack in small chunks, and gives each back at once.  The compiler
    goes back and forth over the border of one half a million times.
    """
    _compile_parts(function, arguments)
    return function.entry(*arguments)


# a frame this large gets a chunk of its own, of which the next frames have the rest, some 300 kB
_with_room.__code__ = _with_room.__code__.replace(co_stacksize=90_000)


def in_parts(
    function: Function, parts: Callable[..., tuple[Sequence[Part], Sequence[Part]]]
) -> None:
    """Have parts of a function compiled in two processes, before it is compiled for the first time.

    `parts`, called with its arguments, returns those for a second process, and those for this one:
    compiled functions, with arguments of the types that they will be called with.
    """
    if isinstance(function, Compiled):
        function.parts = parts


def _compile_parts(function: Compiled, arguments: tuple[Any, ...]) -> None:
    """Compile parts of a function in two processes, if it has such and their code is not kept."""
    if function.parts is None or default_threads() < 2 or code_cache().folder is None:
        return
    compiler = _compiler()
    with _AHEAD:
        theirs, ours = function.parts(*arguments)
        if any(compiler.is_kept(part.function, code_cache()) for part, _ in theirs):
            return
        told = [
            (part.__module__, part.__qualname__, compiler.types_of(samples))
            for part, samples in theirs
        ]
        with compiled_beside(told):
            for part, samples in ours:
                part.dispatcher.compile(compiler.types_of(samples))
        for part, _ in theirs:
            for one in parts_of(part.function):
                _tell(one)


def _compiler() -> Any:
    with _MAKING:
        return _import_compiler()


@cache
def _import_compiler() -> Any:
    """Return the module that imports Numba, told of the functions here."""
    from adv2e.compilation import compiler  # noqa: PLC0415

    compiler.know_type(Compiled)
    compiler.listen(code_cache(), _tell)
    with _EXTENDING:
        while _extensions:
            _extensions.pop(0)()
        _is_imported.set()
    return compiler


def import_ahead() -> None:
    """Begin to import Numba, in a thread, while the caller goes on.

    Other functions that Numba compiles in this process may then lack SciPy's linear algebra, or sum
    in another order: so for a process that compiles nothing of others.
    """

    def load() -> None:
        # what is raised will come again where a compiled function is called
        with suppress(Exception), _compiler().lean_imports():
            _nothing()

    if not _PLAIN:
        threading.Thread(target=load, name="import of Numba").start()


def kernel(function: Function) -> Function:
    """Compile `function` when it is first called, and keep its code for later runs."""
    return function if _PLAIN else Compiled(function)  # type: ignore[return-value]


def inlined(function: Function) -> Function:
    """Compile `function` into each of its callers: for long functions with one caller."""
    return function if _PLAIN else Compiled(function, inline="always")  # type: ignore[return-value]


def embedded(function: Function) -> Function:
    """Compile `function`, and have LLVM put its code into that of each caller.

    For short functions that are called for single pixels: records in their arguments are passed
    number by number, which takes longer than what they do.
    """
    return function if _PLAIN else Compiled(function, forceinline=True)  # type: ignore[return-value]


@kernel
def _nothing() -> None:
    """Do nothing: the first function that is loaded has Numba load what it needs for all."""


def extension(extend: Callable[[], None]) -> None:
    """Have `extend`, which tells Numba more by its extension interface, called before the rest.

    Numba may have come already, in its own thread, while this module is still imported.
    """
    with _EXTENDING:
        if _is_imported.is_set():
            extend()
        else:
            _extensions.append(extend)


@contextmanager
def watched(watcher: Callable[[Callable[..., Any]], None]) -> Iterator[None]:
    """Have `watcher` called, in any thread, with each Python function before it is compiled."""
    _watchers.append(watcher)
    try:
        yield
    finally:
        _watchers.remove(watcher)


def parts_of(function: Callable[..., Any]) -> set[Callable[..., Any]]:
    """Return the Python functions that are compiled with one, itself among them."""
    seen, unseen, inlined = {function}, [function], set()
    while unseen:
        one = unseen.pop()
        names = one.__code__.co_names
        known = [one.__globals__.get(name) for name in names]
        for module in [value for value in known if isinstance(value, ModuleType)]:
            known += [vars(module).get(name) for name in names]
        for value in known:
            if isinstance(value, Compiled) and value.function not in seen:
                seen.add(value.function)
                unseen.append(value.function)
                if value.is_inlined:
                    inlined.add(value.function)
    return seen - inlined


def _tell(function: Callable[..., Any]) -> None:
    for watcher in tuple(_watchers):
        watcher(function)

"""Machine code in files: Numba's cache, made to bear what happens to files, and quick to load.

What is quick relies on how Numba keeps code, which it may change: it is done with the releases of
Numba that were tried, and with any other the cache works as Numba's own.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba
from numba.core import caching
from numba.core.runtime import nrt

_FunctionCache: Any = caching.FunctionCache  # it has no types
_Implementation: Any = caching.CompileResultCacheImpl
_nrt: Any = nrt
_llvm = _nrt.ll

_TRIED = numba.version_info[:2] <= (0, 68)
_PROCESS = secrets.token_hex(4)


def _provide_runtime(context: Any) -> None:
    """Let code from the cache find what it calls of Numba's run-time.

    It brings along what counts references and calls functions in C for the rest.  Numba would
    compile the former first, for what it may compile itself, which takes longer than to load the
    pixel; it does so when it compiles.  A function that is not found would end the process.
    """
    if not _TRIED:
        _nrt.rtsys.initialize(context)
        return
    for name, address in _nrt._nrt.c_helpers.items():
        _llvm.add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


class Cache(_FunctionCache):  # type: ignore[misc]
    """Numba's cache of one function, made to bear what happens to files.

    What cannot be read counts as missing, what cannot be written is not kept.  Machine code lies
    under names that no other process gives: two processes that fill the cache at once would else
    number the code of two signatures alike, and one of them would later run as the other.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        files = self._cache_file
        files._data_name_pattern = files._data_name_pattern.replace(
            "{number:d}", f"{_PROCESS}-{{number:d}}"
        )

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Return the compiled code for a signature, or None.

        Numba first gets ready to compile, as long as all other imports take; code that is there
        needs only the run-time.  If more is to be compiled, Numba sees to that by itself.
        """
        try:
            _provide_runtime(context)
            return self._load_overload(signature, context)
        except Exception:  # a file cut short may raise anything, another Numba may do it otherwise
            with suppress(Exception):
                return super().load_overload(signature, context)
            return None

    def save_overload(self, signature: Any, code: Any) -> None:
        """Keep the compiled code for a signature, if that is possible."""
        with suppress(OSError):
            try:
                super().save_overload(signature, code)
            except OSError:
                raise
            except Exception:  # the index is damaged: begin a new one
                self.flush()
                super().save_overload(signature, code)


class _MachineCodeOnly(_Implementation):  # type: ignore[misc]
    """Keeps of a compiled function what running it takes.

    Numba keeps the code before its translation, too, for other functions to be compiled with, and
    what Numba's own functions in it see by name, which is for functions that call Python; reading
    the one and importing the modules of the other takes three quarters of loading.
    """

    def reduce(self, code: Any) -> Any:
        """Return what is written."""
        kept = super().reduce(code)
        if not _TRIED:
            return kept
        (name, kind, (machine_code, _)), *others, environments = kept
        own = tuple(one for one in environments if not _is_numbas(one))
        # names that Numba asks the machine code for, once it has found them here
        known = code.fndesc.llvm_cpython_wrapper_name, code.fndesc.llvm_func_name
        lines = [f'define void @"{name}"() {{ ret void }}' for name in known]
        places = {code.fndesc.env_name, *(one.env_name for one in own)}
        lines += [f'@"{place}" = common global i8* null' for place in sorted(places)]
        stub = _llvm.parse_assembly("\n".join(lines)).as_bitcode()
        library = name, kind, (machine_code, stub)
        return (library, *others, own)


def _is_numbas(environment: Any) -> bool:
    return str(environment.globals["__name__"]).startswith("numba.")


class _CacheAlone(Cache):
    """The cache of a function that no other compiled function calls."""

    _impl_class = _MachineCodeOnly


class LateCache:
    """A :class:`Cache` made when something is asked of it: of most functions nothing ever is.

    Parameters
    ----------
    function : callable
    folder : Path
        Where all caches are.
    alone : bool
        No compiled function calls it.
    """

    def __init__(self, function: Callable[..., Any], folder: Path, *, alone: bool = False) -> None:
        self._function = function
        self._folder = folder
        self._class = _CacheAlone if alone else Cache

    def __getattr__(self, name: str) -> Any:
        if name == "_made":
            config: Any = numba.config  # its attributes are made at run time
            before = config.CACHE_DIR
            config.CACHE_DIR = str(self._folder)
            try:
                self._made = self._class(self._function)  # as the option `cache` does
            finally:
                config.CACHE_DIR = before
            return self._made
        return getattr(self._made, name)

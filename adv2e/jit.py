"""The one decorator for compiled functions, and where their machine code is kept.

Numba's own cache looks only at the file that a function stands in, so a function that calls an
edited one from another file would run as its old self.  The cache folder is therefore named after
a digest of all sources that hold compiled code.  It lies in the user's cache folder (or below
``NUMBA_CACHE_DIR`` where that is set), so that a read-only installation starts fast too.  Folders
of other sources are removed when they have not been used for a month.

Compiled functions release the interpreter lock and run in ordinary threads, one tile each.
Fast-math is off, but for one flag: ``contract`` lets a product and a sum round once (FMA), which
halves the time of every polynomial here; sums are not reordered and NaN stays NaN.  Divisions
follow IEEE rules (``error_model="numpy"``), because Python's check for zero keeps a loop from
vectorising.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core.caching import FunctionCache
from numba.core.runtime.nrt import rtsys

Function = TypeVar("Function", bound=Callable[..., Any])

_FunctionCache: Any = FunctionCache  # it has no types
_PACKAGE = Path(__file__).resolve().parent
_UNUSED_S = 30 * 24 * 3600.0
_USE_NOTED_S = 24 * 3600.0


def sources() -> list[Path]:
    """Return every source file that compiled code is made of.

    Those that use the decorator, and the whole kernel: offsets and sizes of rows, which compiled
    code takes in as constants, stand in files without a compiled function.
    """
    return [
        path
        for path in sorted(_PACKAGE.rglob("*.py"))
        if path.parent == _PACKAGE / "kernel" or b"adv2e.jit" in path.read_bytes()
    ]


def _digest() -> str:
    """Return a digest of every source file that compiled code is made of."""
    digest = hashlib.sha256(f"{numba.__version__} {sys.version_info[:2]}".encode())
    for path in sources():
        digest.update(path.relative_to(_PACKAGE).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def cache_folder() -> Path:
    """Return the folder for compiled code, made if need be; the first that can be written to."""
    bases: list[Path] = []
    if os.environ.get("NUMBA_CACHE_DIR"):
        bases.append(Path(os.environ["NUMBA_CACHE_DIR"]) / "adv2e")
    if os.environ.get("XDG_CACHE_HOME"):
        bases.append(Path(os.environ["XDG_CACHE_HOME"]) / "adv2e")
    if sys.platform == "win32" and os.environ.get("LOCALAPPDATA"):
        bases.append(Path(os.environ["LOCALAPPDATA"]) / "adv2e" / "Cache")
    home = Path(os.path.expanduser("~"))  # noqa: PTH111 - Path.home() raises where there is none
    bases.append(home / ("Library/Caches" if sys.platform == "darwin" else ".cache") / "adv2e")
    user = os.getuid() if hasattr(os, "getuid") else "user"
    bases.append(Path(tempfile.gettempdir()) / f"adv2e-{user}")
    name = f"kernels-{_digest()}"
    for base in bases:
        if _writable(base / name):
            note_use(base / name)
            return base / name
    return Path(tempfile.mkdtemp(prefix="adv2e-"))


def note_use(folder: Path) -> None:
    """Remember that the code in `folder` is in use; once a day, remove what nobody has used.

    A process that still runs with the code in a folder removed here has it in memory.
    """
    now = time.time()
    with suppress(OSError):  # of no matter to whoever wants to compute
        noted = folder / "used"
        if noted.exists() and now - noted.stat().st_mtime < _USE_NOTED_S:
            return
        noted.touch()
        for other in folder.parent.glob("kernels-*"):
            last = max(path.stat().st_mtime for path in (other, *other.glob("used")))
            if now - last > _UNUSED_S:
                shutil.rmtree(other, ignore_errors=True)


class _Cache(_FunctionCache):  # type: ignore[misc]
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
            rtsys.initialize(context)
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


class _LateCache:
    """A :class:`_Cache` made when something is asked of it: of most functions nothing ever is."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    def __getattr__(self, name: str) -> Any:
        if name == "_made":
            config: Any = numba.config  # its attributes are made at run time
            before = config.CACHE_DIR
            config.CACHE_DIR = str(_FOLDER)
            try:
                self._made = _Cache(self._function)  # as the option `cache` does
            finally:
                config.CACHE_DIR = before
            return self._made
        return getattr(self._made, name)


_FOLDER = cache_folder()
_PROCESS = secrets.token_hex(4)


def _compile(function: Function, *, cache: bool = False, **options: Any) -> Function:
    compiled: Any = numba.njit(nogil=True, error_model="numpy", fastmath={"contract"}, **options)(
        function
    )
    if cache:
        compiled._cache = _LateCache(function)
    return compiled  # type: ignore[no-any-return]


def kernel(function: Function) -> Function:
    """Compile `function`, cached in :func:`cache_folder`; it must not make arrays.

    Without Numba's run-time (``_nrt``) there is no counting of references to arrays, which costs
    more than the arithmetic of a short function.
    """
    return _compile(function, cache=True, _nrt=False)


def allocating_kernel(function: Function) -> Function:
    """Compile a `function` that makes arrays, cached likewise."""
    return _compile(function, cache=True)


def inlined(function: Function) -> Function:
    """Compile `function` into each of its callers: for long functions with one caller."""
    return _compile(function, inline="always", _nrt=False)


def is_cached(name: str) -> bool:
    """Tell whether there is compiled code of the function `name`, of these sources."""
    return any(_FOLDER.rglob(f"*{name}*.nbc"))

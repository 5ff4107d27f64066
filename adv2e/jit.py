"""The one decorator for compiled functions, and where their machine code is kept.

Numba's own cache looks only at the file that a function stands in, so a function that calls an
edited one from another file would run as its old self.  The cache folder is therefore named after
a digest of all sources that hold compiled code.  It lies in the user's cache folder (or below
``NUMBA_CACHE_DIR`` where that is set), so that a read-only installation starts fast too.

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
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

Function = TypeVar("Function", bound=Callable[..., Any])

_PACKAGE = Path(__file__).resolve().parent


def _digest() -> str:
    """Return a digest of every source file that uses the decorator."""
    digest = hashlib.sha256(f"{numba.__version__} {sys.version_info[:2]}".encode())
    for path in sorted(_PACKAGE.rglob("*.py")):
        text = path.read_bytes()
        if b"adv2e.jit" in text:
            digest.update(path.relative_to(_PACKAGE).as_posix().encode() + b"\0" + text)
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
        bases.append(Path(os.environ["NUMBA_CACHE_DIR"]))
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
            return base / name
    return Path(tempfile.mkdtemp(prefix="adv2e-"))


_FOLDER = cache_folder()


def _compile(function: Function, **options: Any) -> Function:
    config: Any = numba.config  # its attributes are made at run time
    before = config.CACHE_DIR
    config.CACHE_DIR = str(_FOLDER)
    try:
        compiled: Function = numba.njit(
            nogil=True, error_model="numpy", fastmath={"contract"}, **options
        )(function)
    finally:
        config.CACHE_DIR = before
    return compiled


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

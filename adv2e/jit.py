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
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

import numba

from adv2e.machine_code import LateCache

Function = TypeVar("Function", bound=Callable[..., Any])

_PACKAGE = Path(__file__).resolve().parent
_UNUSED_S = 30 * 24 * 3600.0
_USE_NOTED_S = 24 * 3600.0


def sources() -> list[Path]:
    """Return every source file that compiled code, or the way it is kept, is made of.

    Those that use the decorator, and the whole kernel: offsets and sizes of rows, which compiled
    code takes in as constants, stand in files without a compiled function.
    """
    ours = _PACKAGE / "jit.py", _PACKAGE / "machine_code.py"
    return [
        path
        for path in sorted(_PACKAGE.rglob("*.py"))
        if path in ours or path.parent == _PACKAGE / "kernel" or b"adv2e.jit" in path.read_bytes()
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


_FOLDER = cache_folder()


def _compile(
    function: Function, *, cache: bool = False, alone: bool = False, **options: Any
) -> Function:
    compiled: Any = numba.njit(nogil=True, error_model="numpy", fastmath={"contract"}, **options)(
        function
    )
    if cache:
        compiled._cache = LateCache(function, _FOLDER, alone=alone)
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


def driver(function: Function) -> Function:
    """Compile a `function` that may make arrays and that no compiled function calls.

    It is loaded in a quarter of the time, as nothing is kept of it but its machine code.
    """
    compiled: Any = _compile(function, cache=True, alone=True)

    def refuse(*_: Any) -> None:
        raise TypeError(f"{function.__name__} is a driver, which compiled code cannot call")

    compiled.get_call_template = refuse
    return compiled  # type: ignore[no-any-return]


def inlined(function: Function) -> Function:
    """Compile `function` into each of its callers: for long functions with one caller."""
    return _compile(function, inline="always", _nrt=False)


def is_cached(name: str) -> bool:
    """Tell whether there is compiled code of the function `name`, of these sources."""
    return any(_FOLDER.rglob(f"*{name}*.nbc"))


def keeps_code() -> bool:
    """Tell whether other processes find what is compiled in this one."""
    return _FOLDER.name.startswith("kernels-")

"""Versions of what computes events, stored with them: the same bytes are promised for the same."""

from __future__ import annotations

import platform
import zlib
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version

_OPENCV = (
    *("opencv-python-headless", "opencv-python"),
    *("opencv-contrib-python-headless", "opencv-contrib-python"),
)
"""Packages that bring cv2, of which any does."""


def versions(optional: Iterable[str] = ()) -> dict[str, str | None]:
    """Return the version of Python and of each package; None for what has none.

    Parameters
    ----------
    optional : iterable of str
        Optional packages that take part, by the names under which they are installed.
    """
    opencv = next((found for name in _OPENCV if (found := _version(name))), None)
    return {
        "python": platform.python_version(),
        "numpy": _version("numpy"),
        "numba": _version("numba"),
        "opencv": opencv,
        "zlib": zlib.ZLIB_RUNTIME_VERSION,
        **{name: _version(name) for name in optional},
    }


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None

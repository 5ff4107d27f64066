"""Deflate: by libdeflate where the extra ``fast`` is installed, else by zlib.

What either writes any inflate reads; how many bytes it takes differs.  Either gives the same bytes
for the same data, which not every library does: ISA-L, several times faster, does not always.
"""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

try:
    import deflate
except ImportError:
    PACKAGES: tuple[str, ...] = ()
    """Packages that compress, beside the standard library."""
else:
    PACKAGES = ("deflate",)


def compress(array: NDArray[Any]) -> bytes:
    """Return the bytes of an array as deflate leaves them."""
    data = np.ascontiguousarray(array).data
    if PACKAGES:
        return bytes(deflate.zlib_compress(data, 1))
    return zlib.compress(data, 1)


def compress_shuffled(values: NDArray[Any]) -> bytes:
    """Return the bytes of values as HDF5's filters shuffle and deflate leave them.

    Bytes of equal rank go together.
    """
    return compress(np.ascontiguousarray(values).view(np.uint8).reshape(values.size, -1).T)

"""Room for events: arrays that grow while compiled code fills them.

Their memory is Python's raw memory, which any thread may ask for.  Numba's own arrays would need
its run-time, and with it Numba, in every process that converts.
"""

from __future__ import annotations

import ctypes
import weakref
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import intrinsic, kernel

_reallocate: Any = ctypes.pythonapi.PyMem_RawRealloc
_reallocate.restype = ctypes.c_void_p
_reallocate.argtypes = ctypes.c_void_p, ctypes.c_size_t
_free: Any = ctypes.pythonapi.PyMem_RawFree
_free.restype = None
_free.argtypes = (ctypes.c_void_p,)


def _array_at(address: int, entries: int, dtype: Any) -> NDArray[Any]:
    size = entries * np.dtype(dtype).itemsize
    return np.ndarray(entries, dtype, (ctypes.c_char * size).from_address(address))


def _resize_plainly(array, entries):
    """Do the same where Numba is told not to compile."""
    address = _reallocate(array.ctypes.data, entries * array.itemsize)
    if address is None:
        raise MemoryError
    return _array_at(address, entries, array.dtype)


@intrinsic(_resize_plainly)
def _resize(_, array, entries):
    """Return `array`, which lies in raw memory, with so many entries; the old one is gone."""
    from numba.core import cgutils  # noqa: PLC0415 - for the compiler only
    from numba.np.arrayobj import populate_array  # noqa: PLC0415

    def generate(context, builder, signature, arguments):
        of_kind = context.make_array(signature.args[0])
        old, new = of_kind(context, builder, arguments[0]), of_kind(context, builder)
        kind = cgutils.ir.FunctionType(cgutils.voidptr_t, [cgutils.voidptr_t, cgutils.intp_t])
        reallocate = cgutils.get_or_insert_function(builder.module, kind, "PyMem_RawRealloc")
        before = builder.bitcast(old.data, cgutils.voidptr_t)
        size = builder.mul(arguments[1], old.itemsize)
        address = builder.call(reallocate, [before, size])
        with builder.if_then(cgutils.is_null(builder, address), likely=False):
            context.call_conv.return_user_exc(builder, MemoryError, ("no memory for events",))
        populate_array(
            new,
            data=builder.bitcast(address, old.data.type),
            shape=[arguments[1]],
            strides=[old.itemsize],
            itemsize=old.itemsize,
            meminfo=None,
        )
        return new._getvalue()

    return array(array, entries), generate


@kernel
def with_room(keys, times, used, needed):
    """Return the two arrays of events, longer where they cannot hold `needed`."""
    if needed > keys.shape[0]:
        entries = 2 * keys.shape[0] + needed
        if times.shape[0] > 0:
            times = _resize(times, entries)
        keys = _resize(keys, entries)
    return keys, times


@kernel
def tell_where(keys, times, places):
    """Tell whoever called where the arrays of events are now; see :class:`Room`."""
    places[0] = keys.ctypes.data
    places[1] = keys.shape[0]
    places[2] = times.ctypes.data
    places[3] = times.shape[0]


class Room:
    """Arrays of events that outlive the calls that fill them.

    Parameters
    ----------
    exact_times : bool
        Whether there are unrounded times.

    Attributes
    ----------
    places : (4,) int64
        For :func:`tell_where`: addresses and lengths of `keys` and `times`.
    """

    def __init__(self, exact_times: bool, entries: int = 4096) -> None:
        length = entries if exact_times else 0
        self.places = np.array([0, entries, 0, length])
        for k, dtype in ((0, np.int64), (2, np.float64)):
            size = max(1, int(self.places[k + 1])) * np.dtype(dtype).itemsize
            self.places[k] = _reallocate(None, size) or 0
            if not self.places[k]:
                raise MemoryError("no memory for events")
        weakref.finalize(self, _free_all, self.places)

    def lend(self) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
        """Return (keys, times, places) for a kernel, which may move the arrays.

        If the call fails, nobody knows where they are, and their memory is lost.
        """
        lent = self.keys, self.times
        self.places[::2] = 0
        return *lent, self.places

    @property
    def keys(self) -> NDArray[np.int64]:
        """Packed events; not to be kept beyond the next call."""
        return _array_at(int(self.places[0]), int(self.places[1]), np.int64)

    @property
    def times(self) -> NDArray[np.float64]:
        """Their unrounded times [us], likewise; none where they are not kept."""
        return _array_at(int(self.places[2]), int(self.places[3]), np.float64)


def _free_all(places: NDArray[np.int64]) -> None:
    for address in places[::2].tolist():
        _free(address or None)

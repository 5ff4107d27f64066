"""Structure of MPEG transport streams: packets of one size, counted for each stream in it.

References
----------
.. [1] ISO/IEC 13818-1, 2.4.3.2 (transport packet) and 2.4.3.4 (adaptation field).
"""

from __future__ import annotations

import mmap

import numpy as np
from numpy.typing import NDArray

from adv2e.sources.video.containers.base import Container, DamagedError, cut_short

_SYNC, _NULL = 0x47, 0x1FFF
_LAYOUTS = ((188, 0), (192, 4), (204, 0))
"""Bytes of a packet, and where in them it begins: as sent, on discs, with parity."""
_LOOKED_AT = 100
_CHUNK = 1 << 16


def layout_of(data: mmap.mmap) -> tuple[int, int] | None:
    """Return the bytes of a packet and where in them it begins; None if it is another file."""
    for size, lead in _LAYOUTS:
        begins = data[lead : lead + _LOOKED_AT * size : size]
        if len(data) >= 2 * size and 2 * begins.count(_SYNC) > len(begins):
            return size, lead
    return None


def examine(data: mmap.mmap, size: int, lead: int, found: Container) -> None:
    """Doubt where packets are missing; DamagedError if some are no packets."""
    count, rest = divmod(len(data), size)
    breaks, last = 0, np.full(_NULL + 1, -1)
    for begin in range(0, count, _CHUNK):
        end = min(begin + _CHUNK, count)
        chunk = np.frombuffer(data[begin * size : end * size], np.uint8).reshape(-1, size)
        heads = chunk[:, lead : lead + 6]
        wrong = np.flatnonzero(heads[:, 0] != _SYNC)
        if wrong.size:
            raise DamagedError(f"damaged at byte {(begin + int(wrong[0])) * size}")
        breaks += _breaks(heads.astype(np.int64), last)
    if rest > lead and data[count * size + lead] == _SYNC:
        raise cut_short((count + 1) * size, len(data))
    if breaks:
        places = f"{breaks} places" if breaks > 1 else "a place"
        told = f"packets are missing at {places}: pictures may be missing or spoilt there"
        found.doubts.append(told)


def _breaks(heads: NDArray[np.int64], last: NDArray[np.int64]) -> int:
    """Return how often counters jump; `last` has that of each stream before, and is brought on."""
    streams = ((heads[:, 1] & 0x1F) << 8) | heads[:, 2]
    control = heads[:, 3] >> 4 & 3
    announced = (control & 2 > 0) & (heads[:, 4] > 0) & (heads[:, 5] & 0x80 > 0)
    breaks = 0
    for stream in np.unique(streams):
        chosen = (streams == stream) & (control & 1 > 0)
        if stream == _NULL or not chosen.any():
            continue
        counters = heads[chosen, 3] & 15
        steps = np.diff(np.append(last[stream] if last[stream] >= 0 else counters[0] - 1, counters))
        jumped = ~np.isin(steps % 16, (0, 1)) & ~announced[chosen]
        breaks += int(np.count_nonzero(jumped))
        last[stream] = counters[-1]
    return breaks

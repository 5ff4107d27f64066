"""Huffman codes of limited length, as deflate wants them.

References
----------
.. [1] RFC 1951, section 3.2.2 (canonical codes).
.. [2] A. Moffat, J. Katajainen, "In-place calculation of minimum-redundancy codes", WADS 1995.
"""

from __future__ import annotations

from typing import Any

from adv2e.compiled import kernel

LONGEST = 15
"""Bits of the longest code."""


@kernel
def _sort(keys: Any, count: int) -> None:
    """Sort the first `count` keys (Shell's method, gaps after Ciura)."""
    for gap in (132, 57, 23, 10, 4, 1):
        for k in range(gap, count):
            key = keys[k]
            at = k
            while at >= gap and keys[at - gap] > key:
                keys[at] = keys[at - gap]
                at -= gap
            keys[at] = key


@kernel
def _depths(weights: Any, count: int) -> None:
    """Turn sorted weights into depths of the tree's inner nodes, of which the last is the root."""
    leaf = 0
    root = 0
    for node in range(count - 1):
        total = 0
        for _ in range(2):
            if leaf >= count or (root < node and weights[root] < weights[leaf]):
                total += weights[root]
                weights[root] = node  # its parent
                root += 1
            else:
                total += weights[leaf]
                leaf += 1
        weights[node] = total
    weights[count - 2] = 0
    for node in range(count - 3, -1, -1):
        weights[node] = weights[weights[node]] + 1


@kernel
def _count_lengths(depths: Any, count: int, of_length: Any) -> None:
    """Fill `of_length` (LONGEST + 1,) with the number of codes of each length."""
    for length in range(LONGEST + 1):
        of_length[length] = 0
    available = 1
    length = 0
    node = count - 2
    while available > 0:
        inner = 0
        while node >= 0 and depths[node] == length:
            inner += 1
            node -= 1
        of_length[min(length, LONGEST)] += available - inner
        available = 2 * inner
        length += 1
    # those that were too long take too much room now: lengthen others until all fit
    room = 0
    for length in range(1, LONGEST + 1):
        room += of_length[length] << (LONGEST - length)
    while room > 1 << LONGEST:
        of_length[LONGEST] -= 1
        length = LONGEST - 1
        while of_length[length] == 0:
            length -= 1
        of_length[length] -= 1
        of_length[length + 1] += 2
        room -= 1


@kernel
def make_code(counts: Any, lengths: Any, codes: Any, keys: Any, weights: Any) -> None:
    """Fill `lengths` and `codes` (symbols,) with a Huffman code of at most LONGEST bits.

    Parameters
    ----------
    counts : (symbols,) int64
        How often each symbol occurs; two at least must.
    lengths, codes : (symbols,) int64
        Bits of each symbol, 0 where it does not occur; the code, its first bit lowest.
    keys, weights : (symbols,) int64
        To work with.
    """
    used = 0
    for symbol in range(counts.shape[0]):
        lengths[symbol] = 0
        if counts[symbol] > 0:
            keys[used] = (counts[symbol] << 9) | symbol
            used += 1
    _sort(keys, used)
    for k in range(used):
        weights[k] = keys[k] >> 9
    _depths(weights, used)
    of_length = codes  # its memory; the codes come last
    _count_lengths(weights, used, of_length)
    k = 0
    for length in range(LONGEST, 0, -1):  # the rarest get the longest
        for _ in range(of_length[length]):
            lengths[keys[k] & 511] = length
            k += 1
    # the first code of each length; numbers of codes are no longer needed
    first = weights
    code = 0
    first[0] = 0
    for length in range(1, LONGEST + 1):
        code = (code + (of_length[length - 1] if length > 1 else 0)) << 1
        first[length] = code
    for symbol in range(counts.shape[0]):
        length = lengths[symbol]
        if length:
            code = first[length]
            first[length] += 1
            turned = 0
            for _ in range(length):
                turned = (turned << 1) | (code & 1)
                code >>= 1
            codes[symbol] = turned

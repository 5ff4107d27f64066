"""Deflate for columns of events: streams that any inflate reads, in a fraction of zlib's time.

zlib searches for repetitions at any distance.  Columns of events have them in one place: where a
value repeats the one before it.  Only that is looked for here, and what is left is given a Huffman
code of its own in every block.

References
----------
.. [1] RFC 1950 (zlib), RFC 1951 (deflate).
"""

from __future__ import annotations

import sys
import threading
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import entry, kernel
from adv2e.formats.huffman import make_code

_SYMBOLS = 286
_END = 256
_LONGEST = 258
_SHORTEST = 3
"""Of a match [bytes]."""

_RUN = 16
"""Repetitions of a byte that are worth a match; where there are only two, one takes a bit."""

_MATCH = 256
"""A token below it is a literal; from it on, a match of that many bytes more."""

_KINDS = _MATCH + _LONGEST + 1
_SIZE_BITS = 5

_ORDER = np.array([16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15], np.int64)
_ADLER = 65521
_ADLER_PART = 2048  # bytes whose sums fit in 32 bits


def _length_symbols() -> NDArray[np.int64]:
    """Return symbol, number of extra bits and extra bits of every length of a match."""
    table = np.zeros((_LONGEST + 1, 3), np.int64)
    symbol, length = _END + 1, _SHORTEST
    for extra in (0, 0, 1, 2, 3, 4, 5):
        for _ in range(4):
            for rest in range(min(1 << extra, _LONGEST - length)):
                table[length + rest] = symbol, extra, rest
            length += 1 << extra
            symbol += 1
    table[_LONGEST] = _SYMBOLS - 1, 0, 0
    return table


_LENGTHS = _length_symbols()


class _Memory(NamedTuple):
    """What a thread works with.

    Attributes
    ----------
    tokens : uint16
        Literals and matches of a block.
    plane : uint8
        Bytes of a block.
    counts, lengths, codes, keys, weights : (symbols,) int64
        See :func:`adv2e.formats.huffman.make_code`.
    tokens_of, codes_of : (2, kinds of tokens) int64, (kinds of tokens,) uint64
        How many there are of each (odd and even places apart); what is written for each: its
        bits, and below them how many these are.
    out : uint32
        The stream.
    place : (3,) uint64
        Words written, bits not written yet, and how many these are.
    """

    tokens: NDArray[np.uint16]
    plane: NDArray[np.uint8]
    counts: NDArray[np.int64]
    lengths: NDArray[np.int64]
    codes: NDArray[np.int64]
    keys: NDArray[np.int64]
    weights: NDArray[np.int64]
    tokens_of: NDArray[np.int64]
    codes_of: NDArray[np.uint64]
    out: NDArray[np.uint32]
    place: NDArray[np.uint64]


def _memory(size: int) -> _Memory:
    """Return memory for streams of up to `size` bytes."""
    counts, lengths, codes, keys, weights = (np.zeros(_SYMBOLS, np.int64) for _ in range(5))
    return _Memory(
        tokens=np.empty(size + 8, np.uint16),
        plane=np.empty(size, np.uint8),
        counts=counts,
        lengths=lengths,
        codes=codes,
        keys=keys,
        weights=weights,
        tokens_of=np.zeros((2, _KINDS), np.int64),
        codes_of=np.zeros(_KINDS, np.uint64),
        # a code of equal lengths would take 9 bits a literal; headers, one a block, 200 bytes
        out=np.empty((size + size // 4) // 4 + 1024, np.uint32),
        place=np.zeros(3, np.uint64),
    )


@kernel
def _put(memory: Any, bits: Any, size: Any) -> None:
    """Write up to 32 bits, the lowest first."""
    place = memory.place
    waiting = place[1] | (np.uint64(bits) << place[2])
    held = place[2] + np.uint64(size)
    if held >= np.uint64(32):
        memory.out[place[0]] = np.uint32(waiting & np.uint64(0xFFFFFFFF))
        place[0] += np.uint64(1)
        waiting >>= np.uint64(32)
        held -= np.uint64(32)
    place[1] = waiting
    place[2] = held


@kernel
def _put_tokens(tokens: Any, memory: Any) -> None:
    """Write the codes of tokens."""
    codes, out = memory.codes_of, memory.out
    at, waiting, held = memory.place[0], memory.place[1], memory.place[2]
    for k in range(tokens.shape[0]):
        code = codes[tokens[k]]
        waiting |= (code >> np.uint64(_SIZE_BITS)) << held
        held += code & np.uint64((1 << _SIZE_BITS) - 1)
        # without a branch, which could not be predicted
        out[at] = np.uint32(waiting & np.uint64(0xFFFFFFFF))
        full = held >> np.uint64(5)
        at += full
        waiting >>= full << np.uint64(5)
        held &= np.uint64(31)
    memory.place[0] = at
    memory.place[1] = waiting
    memory.place[2] = held


@kernel
def _put_block(tokens: Any, memory: Any, last: bool, distance: int, extra: int) -> None:
    """Write tokens as a block with a code of its own.

    `distance` is the symbol of the one distance there is, `extra` the number of its extra bits,
    all of them set.
    """
    counts, lengths, codes = memory.counts, memory.lengths, memory.codes
    tokens_of, codes_of = memory.tokens_of, memory.codes_of
    for token in range(_KINDS):
        tokens_of[0, token] = 0
        tokens_of[1, token] = 0
    size = tokens.shape[0]
    for k in range(0, size - 1, 2):  # two, as one would wait for the other
        tokens_of[0, tokens[k]] += 1
        tokens_of[1, tokens[k + 1]] += 1
    if size % 2:
        tokens_of[0, tokens[size - 1]] += 1
    for symbol in range(_SYMBOLS):
        counts[symbol] = 0
    for token in range(_KINDS):
        symbol = token if token < _MATCH else _LENGTHS[token - _MATCH, 0]
        counts[symbol] += tokens_of[0, token] + tokens_of[1, token]
    counts[_END] = 1
    make_code(counts, lengths, codes, memory.keys, memory.weights)

    symbols = _END + 1
    for symbol in range(_END + 1, _SYMBOLS):
        if lengths[symbol]:
            symbols = symbol + 1
    _put(memory, np.int64(last) | 2 << 1, 3)
    _put(memory, symbols - 257 | distance << 5 | (_ORDER.shape[0] - 4) << 10, 14)
    for k in range(_ORDER.shape[0]):  # lengths are given in four bits each
        _put(memory, 4 if _ORDER[k] < 16 else 0, 3)
    for symbol in range(symbols + distance + 1):
        length = lengths[symbol] if symbol < symbols else np.int64(symbol == symbols + distance)
        turned = (length & 1) << 3 | (length & 2) << 1 | (length & 4) >> 1 | (length & 8) >> 3
        _put(memory, turned, 4)

    for token in range(_KINDS):
        symbol = token if token < _MATCH else _LENGTHS[token - _MATCH, 0]
        bits, length = codes[symbol], lengths[symbol]
        if token >= _MATCH:
            bits |= _LENGTHS[token - _MATCH, 2] << length
            length += _LENGTHS[token - _MATCH, 1] + 1  # the distance's code is a single 0
            bits |= ((1 << extra) - 1) << length
            length += extra
        codes_of[token] = bits << _SIZE_BITS | length
    _put_tokens(tokens, memory)
    _put(memory, codes[_END], lengths[_END])


@kernel
def _add_match(tokens: Any, count: int, size: int) -> int:
    """Append matches of `size` bytes together; return the number of tokens."""
    while size > 0:
        part = min(size, _LONGEST)
        if 0 < size - part < _SHORTEST:
            part -= _SHORTEST
        tokens[count] = _MATCH + part
        count += 1
        size -= part
    return count


@kernel
def _has_runs(plane: Any) -> Any:
    """Tell whether one in sixteen parts of the bytes, or more, repeats one byte all through."""
    constant = 0
    parts = plane.shape[0] // _RUN
    for part in range(parts):
        first = plane[_RUN * part]
        differ = np.uint8(0)
        for k in range(_RUN):
            differ |= plane[_RUN * part + k] ^ first
        constant += differ == 0
    return 16 * constant >= parts


@kernel
def _runs(plane: Any, tokens: Any) -> int:
    """Fill `tokens` with those of the bytes, runs as matches; return how many."""
    count = 0
    size = plane.shape[0]
    k = 0
    while k < size:
        byte = plane[k]
        begin = k
        k += 1
        while k < size and plane[k] == byte:
            k += 1
        literals = k - begin if k - begin <= _RUN else 1
        for _ in range(literals):
            tokens[count] = byte
            count += 1
        count = _add_match(tokens, count, k - begin - literals)
    return count


@kernel
def _repeats(words: Any, tokens: Any) -> int:
    """Fill `tokens` with those of the 64-bit words; return how many.

    The upper bytes that a word shares with the one before are a match with it, and so are words
    that repeat it.
    """
    count = 0
    size = words.shape[0]
    before = ~words[0]
    k = 0
    while k < size:
        word = words[k]
        changed = word ^ before
        literals = 0
        for byte in range(8):
            literals += changed >> np.uint64(8 * byte) != 0
        before = word
        k += 1
        begin = k
        while k < size and words[k] == word:
            k += 1
        match = 8 - literals + 8 * (k - begin)
        if match < _SHORTEST:
            literals += match
            match = 0
        for byte in range(8):  # those too many are written over
            tokens[count + byte] = word & np.uint64(255)
            word >>= np.uint64(8)
        count = _add_match(tokens, count + literals, match)
    return count


@kernel
def _adler(data: Any, sums: Any) -> None:
    """Carry the two sums of Adler-32 on over some bytes."""
    low, high = sums[0], sums[1]
    for begin in range(0, data.shape[0], _ADLER_PART):
        size = min(_ADLER_PART, data.shape[0] - begin)
        plain = np.uint32(0)
        weighted = np.uint32(0)
        for k in range(size):
            byte = np.uint32(data[begin + k])
            plain += byte
            weighted += np.uint32(np.uint32(size - k) * byte)
        high = (high + size * low + np.int64(weighted)) % _ADLER
        low = (low + np.int64(plain)) % _ADLER
    sums[0], sums[1] = low, high


@kernel
def _begin(memory: Any) -> None:
    for k in range(3):
        memory.place[k] = 0
    _put(memory, 0x0178, 16)  # deflate with a window of 32 KiB, fastest


@kernel
def _end(memory: Any, sums: Any) -> Any:
    """Write the checksum; return the length of the stream [bytes]."""
    held = np.int64(memory.place[2])
    _put(memory, 0, -held % 8)
    for part in (sums[1] >> 8, sums[1] & 255, sums[0] >> 8, sums[0] & 255):
        _put(memory, part, 8)
    size = 4 * np.int64(memory.place[0]) + np.int64(memory.place[2]) // 8
    _put(memory, 0, 31)
    return size


@entry
def _deflate_planes(ranks: Any, memory: Any, sums: Any) -> Any:
    """Make a stream of the columns of `ranks` (values, bytes), one block each."""
    _begin(memory)
    size, count = ranks.shape
    plane = memory.plane[:size]
    for rank in range(count):
        for k in range(size):
            plane[k] = ranks[k, rank]
        _adler(plane, sums)
        last = rank == count - 1
        if _has_runs(plane):
            _put_block(memory.tokens[: _runs(plane, memory.tokens)], memory, last, 0, 0)
        else:
            _put_block(plane, memory, last, 0, 0)
    return _end(memory, sums)


@entry
def _deflate_words(words: Any, data: Any, memory: Any, sums: Any) -> Any:
    """Make a stream of 64-bit words; `data` are their bytes."""
    _begin(memory)
    _adler(data, sums)
    _put_block(memory.tokens[: _repeats(words, memory.tokens)], memory, True, 5, 1)
    return _end(memory, sums)


class _Threads(threading.local):
    """The memory of each thread."""

    memory: _Memory | None = None

    def of(self, size: int) -> _Memory:
        if self.memory is None or self.memory.plane.size < size:
            self.memory = _memory(size)
        return self.memory


_THREADS = _Threads()


def deflate_shuffled(column: NDArray[Any]) -> bytes:
    """Return the column, shuffled (bytes of equal rank together), as a zlib stream.

    Parameters
    ----------
    column : (values,) array
        One value at least.  Best are whole numbers: a block for each rank, runs of a byte as
        matches.
    """
    ranks = np.ascontiguousarray(column).view(np.uint8).reshape(column.size, column.itemsize)
    memory = _THREADS.of(ranks.size)
    return _stream(memory, _deflate_planes(ranks, memory, np.array([1, 0])))


def deflate_words(column: NDArray[Any]) -> bytes:
    """Return the column as a zlib stream.

    Parameters
    ----------
    column : (values,) array of 8 bytes each
        One value at least.  Best are times, of which many repeat the one before and all share its
        upper bytes.
    """
    words = np.ascontiguousarray(column, column.dtype.newbyteorder("<")).view(np.uint64)
    memory = _THREADS.of(words.nbytes)
    size = _deflate_words(words, words.view(np.uint8), memory, np.array([1, 0]))
    return _stream(memory, size)


def _stream(memory: _Memory, size: int) -> bytes:
    words = memory.out if sys.byteorder == "little" else memory.out.byteswap()
    return words.view(np.uint8)[:size].tobytes()

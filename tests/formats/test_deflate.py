import zlib
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.formats.deflate import deflate_shuffled, deflate_words
from adv2e.formats.huffman import LONGEST, make_code


def shuffled(column):
    ranks = column.view(np.uint8).reshape(column.size, column.itemsize)
    return np.ascontiguousarray(ranks.T).tobytes()


def rng():
    return np.random.default_rng(7)


COLUMNS = {
    "one value": np.array([5], np.int16),
    "constant": np.full(65536, 3, np.int16),
    "constant but one": np.r_[np.full(65535, 3), 4].astype(np.uint16),
    "columns of a sensor": rng().integers(0, 346, 65536).astype(np.int16),
    "rows of a narrow sensor": rng().integers(0, 180, 65536).astype(np.int16),
    "polarities": rng().integers(0, 2, 65536).astype(np.bool_),
    "every byte once": np.arange(256, dtype=np.uint8),
    "noise": rng().integers(0, 1 << 32, 9999).astype(np.uint32),
    "runs of every length": np.repeat(np.arange(700), np.arange(700)).astype(np.uint8),
    "lengths around two matches": np.repeat([1, 2, 3, 4, 5], [517, 518, 519, 520, 521]).astype(
        "u1"
    ),
}
TIMES = {
    "one time": np.array([-1.5]),
    "all equal": np.full(65536, 0.25),
    "zeros": np.zeros(100),
    "many at once": np.sort(rng().integers(0, 9000, 65536)) / 1e6,
    "far apart": np.cumsum(rng().integers(0, 10**6, 65536)) / 1e6,
    "negative to positive": np.arange(-3000, 3000) / 1e6,
    "noise": rng().normal(size=5000),
    "agreeing in any number of bytes": np.cumsum(
        rng().integers(0, 2, 20000) << rng().integers(0, 63, 20000)
    ).view(np.float64),
}


@pytest.mark.parametrize("name", COLUMNS)
def test_inflate_returns_the_shuffled_bytes(name):
    assert zlib.decompress(deflate_shuffled(COLUMNS[name])) == shuffled(COLUMNS[name])


@pytest.mark.parametrize("name", TIMES)
def test_inflate_returns_the_words(name):
    assert zlib.decompress(deflate_words(TIMES[name])) == TIMES[name].tobytes()


def test_a_column_may_be_a_view_with_gaps():
    table = np.arange(300, dtype=np.int64).reshape(100, 3)
    assert zlib.decompress(deflate_shuffled(table[:, 1])) == shuffled(table[:, 1].copy())
    assert zlib.decompress(deflate_words(table[:, 1])) == table[:, 1].tobytes()


def test_a_stream_that_is_not_whole_is_noticed():
    data = bytearray(deflate_shuffled(COLUMNS["columns of a sensor"]))
    data[-1] ^= 1
    with pytest.raises(zlib.error):
        zlib.decompress(data)


@settings(deadline=None, max_examples=200)
@given(
    st.lists(st.tuples(st.integers(0, 255), st.integers(1, 600)), min_size=1, max_size=40),
    st.sampled_from([np.uint8, np.uint16, np.float64]),
)
def test_any_bytes_come_back(runs, dtype):
    data = np.repeat(*np.array(runs).T).astype(np.uint8)
    data = data[: max(8, data.size // 8 * 8)]
    data = np.pad(data, (0, -data.size % 8))
    column = data.view(dtype)
    assert zlib.decompress(deflate_shuffled(column)) == shuffled(column)
    words = data.view(np.float64)
    assert zlib.decompress(deflate_words(words)) == data.tobytes()


@pytest.mark.parametrize("name", ["columns of a sensor", "rows of a narrow sensor", "polarities"])
def test_whole_numbers_take_about_as_few_bytes_as_with_zlib(name):
    column = COLUMNS[name]
    assert len(deflate_shuffled(column)) < 1.06 * len(zlib.compress(shuffled(column), 1))


def test_times_of_many_events_take_fewer_bytes_than_with_zlib():
    times = TIMES["many at once"]
    assert len(deflate_words(times)) < 0.8 * len(zlib.compress(shuffled(times), 1))


def code_of(counts):
    counts = np.array(counts, np.int64)
    lengths, codes, keys, weights = (np.zeros(max(counts.size, 17), np.int64) for _ in range(4))
    make_code(counts, lengths[: counts.size], codes, keys, weights)
    return lengths[: counts.size], codes[: counts.size]


@pytest.mark.parametrize(
    "counts",
    [
        [1, 1],
        [0, 5, 0, 1],
        [1, 1, 2, 3, 5, 8, 13, 21, 34],
        [int(1.62**k) + 1 for k in range(40)],  # would take codes of 39 bits
        [1 << k for k in range(30)],
        list(range(286)),
    ],
)
def test_a_code_is_complete_and_no_code_begins_another(counts):
    lengths, codes = code_of(counts)
    assert [bool(length) for length in lengths] == [bool(count) for count in counts]
    assert lengths.max() <= LONGEST
    assert sum(2.0 ** -int(length) for length in lengths if length) == 1
    texts = [
        format(code, "b").zfill(length)[::-1]
        for code, length in zip(codes.tolist(), lengths.tolist(), strict=True)
        if length
    ]
    assert len(set(texts)) == len(texts)
    texts.sort()
    assert not any(b.startswith(a) for a, b in pairwise(texts))


def test_a_code_is_as_short_as_can_be_where_no_code_is_too_long():
    import heapq

    counts = rng().integers(1, 1000, 286).tolist()
    heap, best = sorted(counts), 0
    while len(heap) > 1:
        both = heapq.heappop(heap) + heapq.heappop(heap)
        best += both
        heapq.heappush(heap, both)
    lengths, _ = code_of(counts)
    assert int(lengths @ np.array(counts)) == best

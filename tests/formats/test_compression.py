import zlib

import h5py
import numpy as np
import pytest

from adv2e.events import make_events
from adv2e.formats import writing
from adv2e.formats.writing import compress, compress_shuffled, open_sink


@pytest.fixture(params=["deflate", "zlib"])
def packages(request, monkeypatch):
    monkeypatch.setattr(writing, "PACKAGES", ("deflate",) if request.param == "deflate" else ())


@pytest.mark.parametrize("dtype", [np.bool_, np.int16, np.float64])
def test_inflate_returns_the_bytes_by_rank(packages, dtype):
    column = np.random.default_rng(7).integers(0, 346, 3000).astype(dtype)[::3]
    ranks = column.copy().view(np.uint8).reshape(1000, -1)
    assert zlib.decompress(compress_shuffled(column)) == ranks.T.tobytes()


def columns(kind):
    """A column of one kind, as chunks have it: the last one ends in zeros."""
    rng = np.random.default_rng(5)
    x = rng.integers(0, 346, 1 << 16).astype(np.int16)
    if kind == "partly filled":
        x[9000:] = 0
    elif kind == "repeated from afar":
        x = np.resize(x[:20_000], x.size)
    elif kind == "row by row":
        x = np.resize(np.arange(346, dtype=np.int16), x.size)
    elif kind == "a small thing":
        x = (100 + x % 20).astype(np.int16)
    elif kind == "times far apart":
        return np.cumsum(rng.exponential(100.0, x.size)).astype(np.int64) / 1e6
    elif kind == "noise alone":
        return rng.integers(0, 1 << 16, x.size).astype(np.uint16)
    return x


KINDS = [
    *("noise", "noise alone", "partly filled", "repeated from afar", "row by row"),
    *("a small thing", "times far apart"),
]


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_stored_as_it_is_makes_files_no_larger(packages, kind):
    column = columns(kind)
    ranks = column.view(np.uint8).reshape(column.size, -1).T.tobytes()
    packed = compress_shuffled(column)
    assert zlib.decompress(packed) == ranks
    assert len(packed) < 1.01 * len(zlib.compress(ranks, 1))


def test_inflate_returns_the_bytes(packages):
    image = np.arange(600, dtype=np.uint8).reshape(20, 30)[:, ::-1]
    assert zlib.decompress(compress(image)) == image.tobytes()


def test_datasets_do_not_depend_on_what_compresses(tmp_path, monkeypatch):
    count = 100_000
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.integers(0, 4, count))
    x, y = rng.integers(0, 346, count), rng.integers(0, 260, count)
    events = make_events(t, x, y, rng.integers(0, 2, count))
    image = rng.integers(0, 256, (260, 346), dtype=np.uint8)

    def written(name):
        options = {"width": 346, "height": 260, "metadata": {}, "with_frames": True}
        with open_sink(tmp_path / name, **options) as sink:
            sink.write_frame(0, image)
            sink.write_events(events)
        with h5py.File(tmp_path / name) as file:
            sets = {**file["events"], **file["images"]}
            return {name: sets[name][()].tobytes() for name in sets}

    assert writing.PACKAGES == ("deflate",)  # of the extra `test`
    fast = written("fast.h5")
    monkeypatch.setattr(writing, "PACKAGES", ())
    assert written("standard.h5") == fast
    assert len(fast) == 5

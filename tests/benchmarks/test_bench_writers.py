"""Time of writing events; see test_bench_pixel.py for how to run."""

import numpy as np
import pytest

from adv2e.events import make_events, sort_events
from adv2e.formats.text_writer import text_blocks
from adv2e.formats.writing import open_sink

COUNT = 300_000


@pytest.fixture(scope="module")
def events():
    rng = np.random.default_rng(0)
    t = rng.integers(0, 150_000, COUNT)
    x, y, p = (rng.integers(0, top, COUNT) for top in (346, 260, 2))
    return sort_events(make_events(t, x, y, p))


def write(path, events, threads):
    with open_sink(
        path, width=346, height=260, metadata={}, overwrite=True, threads=threads
    ) as sink:
        sink.write_events(events)
    return path.stat().st_size


@pytest.mark.benchmark(group="writing 300,000 events")
def test_text_in_memory(benchmark, events):
    size = benchmark(lambda: sum(len(block) for block in text_blocks(events)))
    assert size > 20 * COUNT


@pytest.mark.benchmark(group="writing 300,000 events")
@pytest.mark.parametrize(
    ("suffix", "threads"), [(".txt", 1), (".h5", 1), (".h5", 2), (".zip", 1), (".zip", 2)]
)
def test_file(benchmark, events, tmp_path, suffix, threads):
    size = benchmark.pedantic(
        write,
        (tmp_path / f"events{suffix}", events, threads),
        rounds=3,
        iterations=1,
        warmup_rounds=1,
    )
    assert size > 2 * COUNT

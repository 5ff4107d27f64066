import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from adv2e.errors import OutputError, UsageError
from adv2e.events import empty_events, make_events
from adv2e.formats.text_writer import text_blocks
from adv2e.formats.writing import open_sink

METADATA = {"adv2e": "1.2.3", "config": {"seed": 5}, "seed": 5}


def names(folder):
    return sorted(entry.name for entry in folder.iterdir())


def slow_text(events):
    lines = []
    for t, x, y, p in events.tolist():
        whole, micro = divmod(abs(t), 1_000_000)
        lines.append(f"{'-' if t < 0 else ''}{whole}.{micro:06d}000 {x} {y} {p}\n")
    return "".join(lines).encode()


def formatted(events):
    return b"".join(bytes(block) for block in text_blocks(events))


def write(path, events, **options):
    with open_sink(path, width=240, height=180, metadata=METADATA, **options) as sink:
        sink.write_events(events)


def test_lines_are_seconds_column_row_polarity():
    events = make_events([3811, 3820], [96, 127], [133, 171], [0, 1])

    assert formatted(events) == b"0.003811000 96 133 0\n0.003820000 127 171 1\n"


def test_formatter_agrees_with_plain_python():
    rng = np.random.default_rng(3)
    edges = [0, 1, 999, 1000, 999_999, 1_000_000, 1_000_001, 9_999_999, 10_000_000]
    epoch = 1_468_941_032_229_165
    t = np.concatenate(
        [
            np.negative(edges),
            edges,
            rng.integers(-3_000_000, 3_000_000, 3000),
            np.arange(epoch, epoch + 3_000_000, 997),
            [-epoch, 9_000_000_000_000_000_000, -9_000_000_000_000_000_000],
        ]
    )
    x = rng.choice([0, 9, 10, 99, 100, 999, 1000, 9999, 10000, 65535, 345], t.size)
    events = make_events(t, x, rng.permutation(x), rng.integers(0, 2, t.size))

    assert formatted(events) == slow_text(events)


def test_formatter_takes_more_events_than_a_block():
    t = np.arange(100_000) * 37
    events = make_events(t, t % 346, t % 260, t % 2)

    assert formatted(events) == slow_text(events)


def test_formatter_takes_strided_and_read_only_events():
    events = make_events(np.arange(10), np.arange(10), np.arange(10), np.arange(10) % 2)
    events.flags.writeable = False

    assert formatted(events[::2]) == slow_text(events[::2])


def test_no_events_make_an_empty_file(tmp_path):
    write(tmp_path / "out.txt", empty_events())

    assert (tmp_path / "out.txt").read_bytes() == b""


def test_metadata_lie_beside_the_text(tmp_path):
    write(tmp_path / "out.txt", empty_events())

    beside = json.loads((tmp_path / "out.txt.json").read_text())
    assert beside == {**METADATA, "width": 240, "height": 180}
    assert names(tmp_path) == ["out.txt", "out.txt.json"]


def test_text_is_read_by_numpy_as_it_was(tmp_path):
    t = np.array([0, 1, 999_999, 1_468_941_032_229_165])
    write(tmp_path / "out.txt", make_events(t, [0, 239, 0, 239], [0, 0, 179, 179], [1, 0, 0, 1]))

    table = np.loadtxt(tmp_path / "out.txt")
    assert np.array_equal(np.rint(table[:, 0] * 1e6).astype(np.int64), t)
    assert table[:, 1:].tolist() == [[0, 0, 1], [239, 0, 0], [0, 179, 0], [239, 179, 1]]


def test_format_chosen_by_name_ignores_the_suffix(tmp_path):
    write(tmp_path / "out.events", make_events([1], [2], [3], [1]), format="txt")

    assert (tmp_path / "out.events").read_bytes() == b"0.000001000 2 3 1\n"
    assert (tmp_path / "out.events.json").exists()


def test_metadata_beside_that_exist_are_not_overwritten(tmp_path):
    (tmp_path / "out.txt.json").write_text("mine")

    with pytest.raises(OutputError, match=r"out\.txt\.json: exists already"):
        open_sink(tmp_path / "out.txt", width=2, height=2, metadata={})
    assert (tmp_path / "out.txt.json").read_text() == "mine"


def test_dash_streams_to_standard_output(monkeypatch, tmp_path):
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw))
    monkeypatch.chdir(tmp_path)

    with open_sink("-", width=240, height=180, metadata=METADATA) as sink:
        sink.write_events(make_events([1], [2], [3], [1]))
        assert raw.getvalue() == b"0.000001000 2 3 1\n"  # at once, not at the end
        assert not sink.wants_frames
    assert names(tmp_path) == []


def test_closed_pipe_raises_broken_pipe(monkeypatch):
    reader, writer = os.pipe()
    os.close(reader)
    pipe = os.fdopen(writer, "w")
    monkeypatch.setattr(sys, "stdout", pipe)
    try:
        with (
            pytest.raises(BrokenPipeError),
            open_sink("-", width=2, height=2, metadata={}) as sink,
        ):
            sink.write_events(make_events([1], [0], [0], [1]))
    finally:
        with pytest.raises(BrokenPipeError):
            pipe.close()  # what is left in its buffer


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_full_disk_under_standard_output_is_named(monkeypatch):
    with (
        pytest.raises(OSError, match="No space"),  # what is left in its buffer, at the end
        Path("/dev/full").open("w") as full,
    ):
        monkeypatch.setattr(sys, "stdout", full)
        with (
            pytest.raises(OutputError, match=r"standard output: .*No space"),
            open_sink("-", width=2, height=2, metadata={}) as sink,
        ):
            sink.write_events(make_events([1], [0], [0], [1]))


@pytest.mark.parametrize("options", [{"format": "h5"}, {"layout": "monash"}])
def test_standard_output_takes_text_only(options):
    with pytest.raises(UsageError, match="standard output"):
        open_sink("-", width=2, height=2, metadata={}, **options)


def test_kernel_runs_without_compilation():
    code = (
        "from adv2e.events import make_events; from adv2e.formats.text_writer import text_blocks;"
        "events = make_events([-5, 1_500_000], [0, 345], [10, 259], [1, 0]);"
        "print(b''.join(map(bytes, text_blocks(events))).decode(), end='')"
    )
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stdout == "-0.000005000 0 10 1\n1.500000000 345 259 0\n"

"""The five bytes an event of N-MNIST and N-Caltech101."""

import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.events import make_events
from adv2e.formats.reading import read_events


def written(path, events):
    """Write (time, column, row, polarity), as the authors' description has it."""
    path.write_bytes(b"".join(
        bytes([x, y]) + (p << 23 | t).to_bytes(3, "big") for t, x, y, p in events
    ))  # fmt: skip
    return path


SOME = [(0, 0, 0, 1), (1, 33, 33, 0), (70_000, 5, 6, 1), (2**23 - 1, 5, 6, 0)]


def test_columns_rows_polarities_and_times_of_23_bits(tmp_path):
    recording = read_events(written(tmp_path / "a.bin", SOME))

    assert recording.events.tolist() == SOME
    assert (recording.width, recording.height, recording.problems) == (34, 34, [])
    assert recording.layout == "nmnist"


def test_other_pictures_are_as_large_as_their_events_need(tmp_path):
    recording = read_events(written(tmp_path / "a.bin", [*SOME[:3], (80_000, 231, 171, 1)]))

    assert (recording.width, recording.height) == (232, 172)
    assert recording.problems == ["no geometry stated: 232x172 from the largest coordinates"]


def test_a_row_of_240_counts_time_on(tmp_path):
    events = [
        (5, 1, 2, 1),
        (6, 0, 240, 0),
        (7, 3, 4, 0),
        (8, 0, 240, 1),
        (8, 0, 240, 0),
        (9, 1, 1, 1),
    ]

    recording = read_events(written(tmp_path / "a.bin", events))

    assert recording.events.tolist() == [
        (5, 1, 2, 1), (7 + 8192, 3, 4, 0), (9 + 3 * 8192, 1, 1, 1),
    ]  # fmt: skip
    assert (recording.width, recording.height) == (34, 34)


def test_nothing_a_rest_and_something_else(tmp_path):
    (tmp_path / "none.bin").write_bytes(b"")
    assert read_events(tmp_path / "none.bin").problems == ["no events"]
    written(tmp_path / "cut.bin", SOME)
    with (tmp_path / "cut.bin").open("ab") as file:
        file.write(b"\1\2")
    cut = read_events(tmp_path / "cut.bin")
    assert cut.events.tolist() == SOME
    assert any("2 bytes at the end" in problem for problem in cut.problems)
    noise = np.random.default_rng(0).integers(0, 256, 5000, np.uint8)
    for data in (noise.tobytes(), bytes(range(256)) * 40):
        (tmp_path / "noise.bin").write_bytes(data)
        with pytest.raises(DataError, match=r"noise\.bin: no file of N-MNIST .* times go back"):
            read_events(tmp_path / "noise.bin")


@pytest.mark.thorough
def test_many_come_back(tmp_path):
    draw = np.random.default_rng(1)
    t = np.sort(draw.integers(0, 310_000, 300_000))
    x, y, p = (draw.integers(0, most, 300_000) for most in (34, 34, 2))
    bits = p << 23 | t
    data = np.stack([x, y, bits >> 16, bits >> 8 & 255, bits & 255], axis=1).astype(np.uint8)
    (tmp_path / "a.bin").write_bytes(data.tobytes())

    recording = read_events(tmp_path / "a.bin")

    assert np.array_equal(np.sort(recording.events), np.sort(make_events(t, x, y, p)))

import zipfile

import numpy as np
import pytest

from adv2e.events import make_events
from adv2e.formats.reading import read_events
from adv2e.formats.writing import open_sink

METADATA = {"adv2e": "9", "seed": 3}
CORNERS = make_events(
    [0, 0, 999, 1000, 2**24 + 1, 2**32 + 1], [0, 345, 0, 345, 7, 10], [0, 0, 259, 259, 3, 99],
    [1, 0, 0, 1, 1, 0],
)  # fmt: skip


def write(path, events, cuts=()):
    with open_sink(path, width=346, height=260, metadata=METADATA, format="e2vid") as sink:
        for part in np.split(events, cuts):
            sink.write_events(part)
    return path


@pytest.mark.parametrize("name", ["urban.txt", "urban.zip"])
@pytest.mark.parametrize("count", [0, 1, 6])
def test_it_is_read_as_rpg_e2vid_does(tmp_path, name, count):
    """As FixedSizeEventReader and run_reconstruction.py do, with today's name of the separator."""
    pandas = pytest.importorskip("pandas")
    path = write(tmp_path / name, CORNERS[:count])

    if name.endswith(".zip"):
        with zipfile.ZipFile(path) as archive:
            assert archive.namelist() == ["urban.txt"]
    header = pandas.read_csv(
        path, sep=r"\s+", header=None, names=["width", "height"],
        dtype={"width": int, "height": int}, nrows=1,
    )  # fmt: skip
    assert header.values[0].tolist() == [346, 260]
    if not count:
        return
    windows = pandas.read_csv(
        path, sep=r"\s+", header=None, names=["t", "x", "y", "pol"],
        dtype={"t": np.float64, "x": np.int16, "y": np.int16, "pol": np.int16},
        engine="c", skiprows=1, chunksize=4, nrows=None, memory_map=True,
    )  # fmt: skip
    table = np.concatenate([window.values for window in windows])
    table[:, 0] = np.rint(table[:, 0] * 1e6)

    assert table.astype(int).tolist() == [list(event) for event in CORNERS[:count].tolist()]


@pytest.mark.parametrize("name", ["a.txt", "a.zip"])
@pytest.mark.parametrize("count", [0, 1, 6])
def test_what_is_written_is_read(tmp_path, name, count):
    recording = read_events(write(tmp_path / name, CORNERS[:count]))

    assert recording.events.tolist() == CORNERS[:count].tolist()
    assert (recording.width, recording.height) == (346, 260)
    assert recording.metadata == {**METADATA, "width": 346, "height": 260}
    assert recording.problems == ([] if count else ["no events"])


def test_without_what_lies_beside_it_the_first_line_tells_the_size(tmp_path):
    path = write(tmp_path / "a.zip", CORNERS)
    (tmp_path / "a.zip.json").unlink()

    recording = read_events(path)

    assert recording.events.tolist() == CORNERS.tolist()
    assert (recording.width, recording.height) == (346, 260)


@pytest.mark.parametrize("name", ["a.txt", "a.zip"])
def test_bytes_do_not_depend_on_parts(tmp_path, name):
    draw = np.random.default_rng(0)
    events = make_events(np.arange(90_000), *draw.integers(0, 200, (2, 90_000)), np.ones(90_000))
    whole = write(tmp_path / name, events).read_bytes()
    (tmp_path / "b").mkdir()

    assert write(tmp_path / "b" / name, events, [1, 2, 50_000]).read_bytes() == whole

import tempfile
from pathlib import Path

import numpy as np
import pytest
from damage import damages, read_or_refused
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.errors import DataError
from adv2e.events import make_events
from adv2e.formats.reading import read_events
from adv2e.formats.writing import open_sink, write_events

CORNERS = make_events(
    [-5, 0, 2**24 + 1, 2**32 + 1, 1_468_941_032_229_165], [0, 345, 0, 345, 7], [0, 0, 259, 259, 3],
    [1, 0, 0, 1, 1],
)  # fmt: skip


@pytest.mark.parametrize("count", [0, 1, 5])
def test_numpy_alone_reads_it(tmp_path, count):
    write_events(tmp_path / "a.npz", CORNERS[:count], (346, 260))

    with np.load(tmp_path / "a.npz", allow_pickle=False) as file:
        assert file["t_us"].tolist() == CORNERS["t"][:count].tolist()
        assert [file[name].tolist() for name in "xyp"] == [
            CORNERS[name][:count].tolist() for name in "xyp"
        ]
        assert [file[name].dtype for name in ("t_us", *"xyp")] == ["i8", "u2", "u2", "u1"]
        assert (int(file["width"]), int(file["height"])) == (346, 260)
        assert '"width": 346' in str(file["adv2e"])


def test_bytes_do_not_depend_on_parts(tmp_path):
    draw = np.random.default_rng(0)
    events = make_events(np.arange(300_000), *draw.integers(0, 200, (2, 300_000)), np.ones(300_000))
    for name, cuts in (("a.npz", []), ("b.npz", [1, 2, 70_001, 200_000])):
        with open_sink(tmp_path / name, width=200, height=200, metadata={}) as sink:
            for part in np.split(events, cuts):
                sink.write_events(part)

    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    path = tmp_path_factory.mktemp("good") / "a.npz"
    write_events(path, CORNERS, (346, 260))
    return path.read_bytes()


@settings(max_examples=200, deadline=None)
@given(data=st.data())
def test_damaged_archives(good, data):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a.npz")
        path.write_bytes(data.draw(damages(good)))
        read_or_refused(path, 5)


# arrays of events alone, as libraries save them

DTYPES = {
    "metavision": [("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")],
    "dv": [("timestamp", "<i8"), ("x", "<i2"), ("y", "<i2"), ("polarity", "i1")],
    "tonic": [("x", "<i2"), ("y", "<i2"), ("t", "<i8"), ("p", "?")],
    "aedat": [("t", "<u8"), ("x", "<u2"), ("y", "<u2"), ("on", "?")],
    "faery": [("t", "<u8"), ("x", "<u2"), ("y", "<u2"), (("p", "on"), "?")],
    "big": [("t_us", ">i8"), ("x", ">u2"), ("y", ">u2"), ("p", "u1"), ("more", "<f8")],
}
KNOWN = ("t", "timestamp", "t_us"), ("x",), ("y",), ("p", "polarity", "on")


@pytest.mark.parametrize("dtype", DTYPES.values(), ids=DTYPES)
def test_an_array_of_named_fields_is_events(tmp_path, adv2e, dtype):
    draw = np.random.default_rng(0)
    t, xy, p = np.cumsum(draw.integers(0, 900, 500)), draw.integers(0, 90, (2, 500)), np.arange(500)
    events = make_events(t, *xy, p % 2)
    array = np.zeros(500, dtype)
    for names, column in zip(KNOWN, ("t", "x", "y", "p"), strict=True):
        (name,) = [name for name in array.dtype.names if name in names]
        array[name] = events[column]
    np.save(tmp_path / "a.npy", array)

    recording = read_events(tmp_path / "a.npy", time_unit="us")

    assert np.array_equal(recording.events, events)
    assert recording.layout == "npy"
    for _ in range(2):
        made = adv2e(
            "convert",
            tmp_path / "a.npy",
            "-o",
            tmp_path / "b.csv",
            "--overwrite",
            "--time-unit",
            "us",
        )
        assert (made.status, "nothing was simulated" in made.out) == (0, True)
    assert adv2e("info", tmp_path / "a.npy").status == 0
    part = adv2e("convert", tmp_path / "a.npy", "-o", tmp_path / "c.csv", "--from", "frames")
    assert (part.status, "holds events and no frames" in part.err) == (1, True)


def test_arrays_of_fields_that_are_no_events(tmp_path):
    for array, why in (
        (np.zeros(3, [("t", "i8"), ("x", "i2"), ("y", "i2")]), "no column for polarity"),
        (np.zeros((3, 2), [(n, "i8") for n in "txyp"]), r"one dimension, not of shape \(3, 2\)"),
        (np.zeros(3, [(n, "U2") for n in "txyp"]), "x must hold numbers, not <U2"),
        (np.zeros(3, [("x", "i2"), ("y", "i2"), ("p", "i2"), ("t", "U2")]), "t must hold numbers"),
    ):
        np.save(tmp_path / "a.npy", array)
        with pytest.raises(DataError, match=rf"a\.npy: .*{why}"):
            read_events(tmp_path / "a.npy")
    np.save(tmp_path / "a.npy", np.zeros(9, [(n, "i8") for n in "txyp"]))
    (tmp_path / "a.npy").write_bytes((tmp_path / "a.npy").read_bytes()[:-5])
    with pytest.raises(DataError, match=r"a\.npy: "):
        read_events(tmp_path / "a.npy")
    np.save(tmp_path / "a.npy", np.zeros(0, [(n, "i8") for n in "txyp"]))
    assert read_events(tmp_path / "a.npy").events.size == 0

import tempfile
from pathlib import Path

import numpy as np
import pytest
from damage import damages, read_or_refused
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.events import make_events
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

"""Events of one's own written to files of every format, and what is no events refused."""

from __future__ import annotations

import numpy as np
import pytest

import adv2e
from adv2e.errors import DataError, OutputError
from adv2e.events import make_events, sort_events


def events():
    rng = np.random.default_rng(1)
    t = rng.integers(0, 10**6, 500)
    return make_events(t, rng.integers(0, 40, 500), rng.integers(0, 30, 500), t % 2)


@pytest.mark.parametrize("name", ["a.txt", "a.h5", "a.zip", "a"])
def test_what_is_written_is_read(tmp_path, name):
    adv2e.write_events(tmp_path / name, events(), (40, 30), metadata={"of": "a test"})
    recording = adv2e.read_events(tmp_path / name)
    assert recording.events.dtype == adv2e.EVENT_DTYPE
    assert recording.events.tobytes() == sort_events(events()).tobytes()
    assert (recording.width, recording.height) == (40, 30)
    assert recording.problems == []
    assert recording.metadata["of"] == "a test"


def test_fields_of_other_types_in_another_order_do(tmp_path):
    ours = sort_events(events())
    other = np.zeros(ours.size, [("p", "i1"), ("y", "i4"), ("x", "i4"), ("t", "u8"), ("id", "u4")])
    for name in ("t", "x", "y"):
        other[name] = ours[name]
    other["p"] = np.where(ours["p"] > 0, 1, -1)
    adv2e.write_events(tmp_path / "a.h5", other, (40, 30))
    assert adv2e.read_events(tmp_path / "a.h5").events.tobytes() == ours.tobytes()


def test_none_at_all_are_a_file_too(tmp_path):
    adv2e.write_events(tmp_path / "a.h5", events()[:0], (40, 30))
    assert adv2e.read_events(tmp_path / "a.h5").events.size == 0


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (np.zeros((3, 4)), "must be a structured array"),
        (np.zeros(3, [("t", "i8"), ("x", "i4"), ("y", "i4")]), "with the fields t, x, y, p"),
        (np.zeros(3, [("t", "f8"), ("x", "i4"), ("y", "i4"), ("p", "u1")]), "t in microseconds"),
        (make_events([1, 2], [0, 40], [0, 0], [1, 1]), "number 1 has x 40, outside"),
        (make_events([1], [0], [30], [1]), "number 0 has y 30, outside a sensor of 40x30 pixels"),
    ],
)
def test_what_is_no_events_is_refused(tmp_path, given, text):
    with pytest.raises(DataError, match=text):
        adv2e.write_events(tmp_path / "a.h5", given, (40, 30))
    assert list(tmp_path.iterdir()) == []


def test_what_exists_is_replaced_when_told(tmp_path):
    for _ in range(2):
        adv2e.write_events(tmp_path / "a.h5", events(), (40, 30), overwrite=True)
    with pytest.raises(OutputError, match="exists"):
        adv2e.write_events(tmp_path / "a.h5", events(), (40, 30))

"""Clocks that wrap or were set back: counted on where that is sure, else refused."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from adv2e.errors import DataError, UsageError
from adv2e.formats import hdf5
from adv2e.formats.clock import Clock
from adv2e.formats.event_file import Facts
from adv2e.formats.reading import read_events

COUNT = 400
TRUE = np.sort(np.random.default_rng(1).integers(0, 1_000_000, COUNT))
"""Times from the first event on [us]."""
X, Y = (np.random.default_rng(seed).integers(0, 40, COUNT) for seed in (2, 3))
P = np.random.default_rng(4).integers(0, 2, COUNT)
BEFORE = 400_000
"""How long before the wrap events begin [us]."""


def written(path, layout, t):
    """Write the events with times `t`, as they are."""
    whole = np.issubdtype(np.asarray(t).dtype, np.integer)
    rows = [f"{t if whole else format(t, '.6f')}" for t in t.tolist()]
    if layout == "npz":
        np.savez(path, t=t, x=X, y=Y, p=P)
    elif layout == "txt":
        lines = zip(rows, X, Y, P, strict=True)
        path.write_text("".join(f"{t} {x} {y} {p}\n" for t, x, y, p in lines))
    elif layout == "csv":
        lines = zip(rows, X, Y, P, strict=True)
        path.write_text("t,x,y,p\n" + "".join(f"{t},{x},{y},{p}\n" for t, x, y, p in lines))
    else:
        names = {"monash": "events/{}s", "dsec": "events/{}", "m3ed": "prophesee/left/{}"}
        with h5py.File(path, "w") as file:
            if layout == "v2e":
                file["events"] = np.stack([t, X, Y, P], axis=1)
            else:
                for name, column in zip("txyp", (t, X, Y, P), strict=True):
                    file[names[layout].format(name)] = column
    return path


def suffix(layout):
    return layout if layout in ("npz", "txt", "csv") else "h5"


LAYOUTS = ("npz", "txt", "csv", "monash", "dsec", "m3ed", "v2e")


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize(
    ("end", "kind"), [(2**31, np.int32), (2**32, np.uint32), (2**32, np.int64)]
)
def test_times_that_wrap_are_counted_on(layout, end, kind, tmp_path, monkeypatch):
    monkeypatch.setattr(hdf5, "PART", 150)  # the wrap lies in a part of its own
    t = end - BEFORE + TRUE
    narrow = t % 2**32 if kind is np.int64 else t.astype(kind)
    path = written(tmp_path / f"a.{suffix(layout)}", layout, narrow)

    recording = read_events(path)

    assert recording.events["t"].tolist() == t.tolist()
    at = int(np.searchsorted(TRUE, BEFORE))
    assert f"the clock wrapped at 2^32 us at event {at}: counted on" in recording.problems
    assert not any("in the order" in problem for problem in recording.problems)


@pytest.mark.parametrize("layout", ["npz", "txt", "monash"])
@pytest.mark.parametrize("bits", [24, 31])
def test_clocks_of_fewer_bits(layout, bits, tmp_path):
    t = 2**bits - BEFORE + TRUE
    recording = read_events(written(tmp_path / f"a.{suffix(layout)}", layout, t % 2**bits))
    assert recording.events["t"].tolist() == t.tolist()
    assert any(f"wrapped at 2^{bits} us" in problem for problem in recording.problems)


@pytest.mark.parametrize("layout", ["npz", "txt", "monash"])
def test_seconds_of_a_clock_that_wraps(layout, tmp_path):
    t = 2**32 - BEFORE + TRUE
    path = written(tmp_path / f"a.{suffix(layout)}", layout, t % 2**32 / 1e6)
    assert read_events(path).events["t"].tolist() == t.tolist()


@pytest.mark.parametrize("kind", [np.int32, np.uint32])
def test_nanoseconds_wrap_every_four_seconds(kind, tmp_path):
    t_ns = (TRUE * 12_000).astype(np.int64)
    path = tmp_path / "a.npz"
    np.savez(path, timestamp_ns=t_ns.astype(kind), x=X, y=Y, p=P)
    recording = read_events(path)
    assert recording.events["t"].tolist() == (TRUE * 12).tolist()
    assert any("wrapped" in problem and "2^32 ns" in problem for problem in recording.problems)


def test_packets_out_of_order_at_the_wrap(tmp_path):
    t = 2**32 - BEFORE + TRUE
    order = np.argsort(t + np.random.default_rng(5).integers(0, 20_000, COUNT))
    recording = read_events(written(tmp_path / "a.npz", "npz", t[order].astype(np.uint32)))
    assert recording.events["t"].tolist() == t.tolist()
    assert any("steps back, the largest 1" in problem for problem in recording.problems)


def set_back(path, layout="npz"):
    """Events whose clock begins anew at zero, half of the way."""
    begun = TRUE[COUNT // 2]
    t = np.where(begun <= TRUE, TRUE - begun, TRUE)
    return written(path, layout, t), begun


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_clock_that_was_set_back_is_refused(layout, tmp_path):
    path, _ = set_back(tmp_path / f"a.{suffix(layout)}", layout)
    with pytest.raises(DataError, match=rf"clock was set back by 0\.\d+ s at event {COUNT // 2}"):
        read_events(path)


def test_what_the_user_says_of_it_is_done_and_told(tmp_path):
    path, begun = set_back(tmp_path / "a.npz")
    on = read_events(path, set_back="continue")
    assert on.events["x"].tolist() == X.tolist()
    assert np.all(np.diff(on.events["t"]) >= 0)
    assert on.events["t"][-1] - on.events["t"][COUNT // 2] == TRUE[-1] - begun
    assert any("times go on from those before" in problem for problem in on.problems)
    by_time = read_events(path, set_back="sort")
    assert by_time.events["t"].tolist() == sorted(np.where(begun <= TRUE, TRUE - begun, TRUE))
    assert any("(1 steps back, the largest" in problem for problem in by_time.problems)
    with pytest.raises(UsageError, match="set_back: must be continue or sort"):
        read_events(path, set_back="forwards")


def test_it_is_the_same_where_the_file_is_not_kept_in_memory(adv2e, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path, _ = set_back(tmp_path / "a.npz")
    told = adv2e("convert", path, "-o", "b.txt")
    assert (told.status, "--set-back continue" in told.err) == (1, True)
    assert not (tmp_path / "b.txt").exists()
    for how in ("continue", "sort"):
        told = adv2e("convert", path, "-o", f"{how}.npz", "--set-back", how)
        assert told.status == 0, told.err
        found, expected = read_events(tmp_path / f"{how}.npz"), read_events(path, set_back=how)
        assert np.array_equal(found.events, expected.events)


def test_a_single_time_far_ahead_is_named(tmp_path):
    t = TRUE.copy()
    t[7] = 3_600_000_000
    path = written(tmp_path / "a.npz", "npz", t)
    with pytest.raises(DataError, match=r"at event 8 \(3600 to 0\.\d+ s\)"):
        read_events(path, time_unit="us")


def test_a_mark_in_the_file_lets_times_go_on():
    clock = Clock(Facts("a"))
    assert clock.ticks(np.array([100, 900]), "t").tolist() == [100, 900]
    clock.announced = True
    assert clock.ticks(np.array([30, 40]), "t").tolist() == [930, 940]
    assert clock.offset == 900


@pytest.mark.parametrize("parts", [1, 3, 50])
def test_parts_make_no_difference(parts):
    t = (2**31 - BEFORE + TRUE * 3).astype(np.int32)
    facts = Facts("a")
    clock = Clock(facts)
    found = np.concatenate([clock.ticks(part, "t") for part in np.array_split(t, parts)])
    clock.tell()
    assert np.array_equal(found, 2**31 - BEFORE + TRUE * 3)
    assert len(facts.problems) == 1

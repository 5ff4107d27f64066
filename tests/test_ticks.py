"""Times become 64 bits exactly, or are refused: one check, whatever they come from."""

from decimal import ROUND_FLOOR, Decimal

import h5py
import numpy as np
import pytest

from adv2e import simulate
from adv2e.errors import DataError
from adv2e.formats.reading import read_events
from adv2e.sources import open_source
from adv2e.ticks import LARGEST_NS, NS, US, S, to_ticks

FAR = [1e13, -1e13, 1e300, 5e9]
"""Seconds beyond 146 years."""


@pytest.mark.parametrize("dtype", ["i8", "u8", "i4", "u1", "f8", "f4", ">i8", ">f8"])
@pytest.mark.parametrize(("unit", "tick"), [(S, US), (US, US), (NS, US), (S, NS), (NS, NS)])
def test_ticks_are_those_of_exact_arithmetic(dtype, unit, tick):
    times = np.array([0, 1, 2, 77, 100, 251.5, 1.5e5, 1.4e9 + 0.123456], np.float64)
    times = np.clip(times, 0, 255).astype(dtype) if dtype in ("u1",) else times.astype(dtype)
    for t, found in zip(times, to_ticks(times, unit, tick, "a").tolist(), strict=True):
        exact = Decimal(t.item()) * unit / tick
        assert abs(exact - found) <= Decimal("0.5000001")
        if dtype[-2] in "iu":
            assert found == int((exact + Decimal("0.5")).to_integral_value(ROUND_FLOOR))


@pytest.mark.parametrize("t", [2**63, 2**64 - 1, LARGEST_NS // 1000 + 1])
@pytest.mark.parametrize("unit", [US, S])
def test_whole_numbers_beyond_the_limit(t, unit):
    with pytest.raises(DataError, match=r"^a: a time of"):
        to_ticks(np.array([0, t], np.uint64), unit, US, "a")


def test_the_limit_itself():
    assert to_ticks(np.array([LARGEST_NS, -LARGEST_NS]), NS, NS, "a").tolist() == [
        LARGEST_NS,
        -LARGEST_NS,
    ]


@pytest.mark.parametrize("t", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite(t):
    with pytest.raises(DataError, match="NaN or infinite"):
        to_ticks(np.array([0.0, t, 1.0]), S, US, "a")


def text(path, t_s):
    path = path.with_suffix(".txt")
    path.write_text(f"# t x y p\n\n0.1 1 1 1\n  # again\n{t_s:f} 1 1 1\n")
    return path


def npz(path, t_s):
    np.savez(path.with_suffix(".npz"), t=[0.1, t_s], x=[1, 1], y=[1, 1], p=[1, 1])
    return path.with_suffix(".npz")


def hdf5(path, t_s, stamp=0.0):
    path = path.with_suffix(".h5")
    with h5py.File(path, "w") as file:
        file["events/ts"] = np.array([0.1, t_s])
        for name in ("xs", "ys", "ps"):
            file[f"events/{name}"] = np.ones(2, np.int16)
        file["images/image0"] = np.zeros((2, 2), np.uint8)
        file["images/image0"].attrs["timestamp"] = stamp
    return path


@pytest.mark.parametrize("write", [text, npz, hdf5])
@pytest.mark.parametrize("t_s", FAR)
def test_no_event_file_gives_a_wrong_time(tmp_path, write, t_s):
    path = write(tmp_path / "a", t_s)
    with pytest.raises(DataError) as caught:
        read_events(path)
    assert str(caught.value).startswith(f"{path}")
    if write is text:
        assert "line 5" in str(caught.value)


def test_stamps_of_images(tmp_path):
    with pytest.raises(DataError, match=r"image0: timestamp: a time of 1e\+13 s"):
        read_events(hdf5(tmp_path / "a", 0.2, stamp=1e13))


@pytest.mark.parametrize("t_s", FAR)
@pytest.mark.parametrize("kind", ["npy", "txt"])
def test_times_of_frames(tmp_path, t_s, kind):
    np.save(tmp_path / "a.npy", np.zeros((5, 3, 4), np.uint8))
    times = [0.0, 0.01, 0.02, 0.03, t_s]
    if kind == "npy":
        np.save(tmp_path / "a_ts.npy", np.array(times))
    else:
        (tmp_path / "a.timestamps.txt").write_text("".join(f"{t:f}\n" for t in times))
    with pytest.raises(DataError, match=r"a_ts\.npy|timestamps\.txt line 5"):
        open_source(tmp_path / "a.npy")


def test_a_rate_that_leads_out_of_64_bits(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros((5000, 1, 1), np.uint8))
    with pytest.raises(DataError, match=r"a\.npy: frame 4612: a time of"):
        list(open_source(tmp_path / "a.npy", fps=1e-6).frames())


@pytest.mark.parametrize("start", [1e13, -1e13, 1e300])
def test_simulate(start):
    frames = [np.zeros((2, 2), np.float32)] * 3
    with pytest.raises(DataError, match=r"^frame 0: a time of"):
        list(simulate(frames, [start, start + 0.01, start + 0.02]))

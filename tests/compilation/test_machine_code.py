"""Arguments laid out for machine code, and what comes back, beside Numba's own calls."""

from typing import NamedTuple

import numpy as np
import pytest

from adv2e import compiled as jit
from adv2e.compilation.machine_code import Refused, lay_out
from adv2e.kernel.event_buffer import Room, tell_where, with_room


class Inner(NamedTuple):
    flag: bool
    values: np.ndarray
    last: bool


class Outer(NamedTuple):
    small: np.float32
    inner: Inner
    count: int
    pair: tuple


@jit.entry
def seen(flag, outer, byte, table, big):
    """Return a number that every part of the arguments changes."""
    total = 0.0
    inner = outer.inner
    for k in range(inner.values.shape[0]):
        total += (k + 1) * inner.values[k]
    for i in range(table.shape[0]):
        for j in range(table.shape[1]):
            total += (i + 2) * (j + 3) * float(table[i, j])
    total += 1e3 * flag + 2e3 * inner.flag + 4e3 * inner.last + 8e3 * float(byte)
    total += (
        1e5 * outer.count + 1e7 * float(outer.small) + 1e9 * outer.pair[0] + 1e10 * outer.pair[1]
    )
    return total, big, table.strides[0], inner.values.shape[0]


def arguments(**other):
    table = other.get("table", np.arange(12, dtype=np.int16).reshape(3, 4))
    values = other.get("values", np.array([1.5, -2.0, 4.0]))
    inner = Inner(other.get("flag", True), values, other.get("last", False))
    outer = Outer(np.float32(0.5), inner, other.get("count", -3), (True, 2.5))
    return (
        other.get("first", False), outer, other.get("byte", np.uint8(7)), table,
        other.get("big", 1),
    )  # fmt: skip


@pytest.mark.parametrize(
    "other",
    [
        {},
        {"flag": False, "last": True, "first": True},
        {"flag": np.True_, "count": np.int64(12)},
        {"byte": np.int32(-5)},
        {"byte": np.uint16(65535)},
        {"byte": 0.25},
        {"big": 2**63 + 12345},
        {"big": np.uint64(2**64 - 1)},
        {"values": np.empty(0)},
        {"values": np.arange(10.0)[::3]},
        {"values": np.arange(10.0)[::-2]},
        {"table": np.arange(24.0).reshape(4, 6).T},
        {"table": np.asfortranarray(np.arange(6, dtype=np.uint8).reshape(2, 3))},
        {"table": np.broadcast_to(np.float32(3.0), (2, 5))},
    ],
)
def test_all_that_is_handed_over_arrives(other):
    given = arguments(**other)
    assert seen(*given) == seen.py_func(*given)
    if given[-1] < 2**63:  # beyond, Numba overflows
        assert seen(*given) == seen.dispatcher(*given)


def test_records_are_read_and_written():
    events = np.zeros(4, [("t", np.int64), ("x", np.uint16), ("p", np.uint8)])

    @jit.entry
    def fill(records, step):
        for k in range(records.shape[0]):
            records[k]["t"] = k * step
            records[k]["x"] = 2 * k
            records[k]["p"] = k & 1

    assert fill(events[1:], 1 << 40) is None
    assert events["t"].tolist() == [0, 0, 1 << 40, 2 << 40]
    assert events["x"].tolist() == [0, 0, 2, 4]
    assert events["p"].tolist() == [0, 0, 1, 0]


def test_an_array_that_must_not_be_written_to_is_not():
    values = np.ones(3)
    values.flags.writeable = False

    @jit.entry
    def clear(values):
        values[0] = 0.0

    with pytest.raises(Exception, match="annot modify"):
        clear(values)
    assert values.tolist() == [1.0, 1.0, 1.0]


def test_arrays_that_differ_get_code_of_their_own():
    a, b = np.ones(3), np.ones(3, np.float32)
    read_only = np.ones(3)
    read_only.flags.writeable = False
    unaligned = np.frombuffer(b"x" + bytes(24), np.uint8)[1:].view(np.float64)
    arrays = (a, b, read_only, unaligned, a[::2], np.ones((1, 3)), np.ones(3, ">f8"))
    kinds = {lay_out((one,))[0] for one in arrays}
    assert len(kinds) == len(arrays)
    assert lay_out((a,))[0] == lay_out((np.zeros(99),))[0]


@pytest.mark.parametrize("value", ["text", None, [1, 2], {}, 1j, np.complex128(1), object()])
def test_what_machine_code_cannot_take_is_refused(value):
    with pytest.raises(Refused, match="neither a number nor an array"):
        lay_out((1, (2.0, value)))


def test_code_of_functions_outside_the_package_is_not_kept():
    folder = jit._place().folder
    before = set(folder.iterdir())

    @jit.entry
    def outside(x):
        return x + 1

    assert outside(2) == 3
    assert not [path for path in set(folder.iterdir()) - before if "outside" in path.name]


@jit.entry
def write(keys, times, places, count):
    """Write `count` events, as the kernel does; return how many."""
    for k in range(count):
        keys, times = with_room(keys, times, k, k + 1)
        keys[k] = 3 * k
        if times.shape[0] > 0:
            times[k] = 0.5 * k
    tell_where(keys, times, places)
    return count


@pytest.mark.parametrize("exact_times", [False, True])
def test_room_grows_and_keeps_what_was_written(exact_times):
    room = Room(exact_times, 4)
    for count in (3, 4, 5, 100_000, 17):
        assert write(*room.lend(), count) == count
        assert room.keys.size >= count
        assert np.array_equal(room.keys[:count], 3 * np.arange(count))
        assert room.times.size == (room.keys.size if exact_times else 0)
        if exact_times:
            assert np.array_equal(room.times[:count], 0.5 * np.arange(count))


def test_no_memory_for_events_is_an_error_and_no_crash():
    @jit.entry
    def demand(keys, times, entries):
        keys, times = with_room(keys, times, 0, entries)
        return keys.shape[0]

    room = Room(False)
    with pytest.raises(MemoryError):
        demand(*room.lend()[:2], 1 << 57)
    assert room.places.tolist()[::2] == [0, 0]  # nobody frees what may have moved

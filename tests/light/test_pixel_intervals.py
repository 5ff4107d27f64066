"""Frames cut into parts: together they hold every instant once, whatever the sizes."""

import itertools
import tracemalloc

import numpy as np
import pytest
from harness import quiet

from adv2e import simulate
from adv2e.config.model import Config, Frames, Sampling
from adv2e.errors import DataError
from adv2e.light import intervals as module
from adv2e.light.interpolation import make_upsampler
from adv2e.light.intervals import Intervals

SHAPE = (3, 5)
T0_NS = 5_000_000_123


def clip(count, dtype=np.float32, shape=SHAPE, seed=0):
    """Frames that change everywhere but in the first row."""
    draw = np.random.default_rng(seed)
    frames = (255 * draw.random((count, *shape))).astype(dtype)
    frames[:, 0] = frames[0, 0]
    return frames


def clock(count):
    """Times in ns that are neither even nor multiples of anything."""
    return [T0_NS + 4_166_667 * k + 1_001 * (k % 3) for k in range(count)]


def sampling(L, *, printed=False, interpolation="linear"):
    last = "printed" if printed else "corrected"
    return Sampling(L=L, last_interval=last, interpolation=interpolation)


def cut(frames, times, settings, events=0, threads=1):
    """Return the parts, each with a copy of its frames, as the next one overwrites them.

    events : int or iterable of int
        What each part is said to have given.
    """
    told = itertools.repeat(events) if isinstance(events, int) else iter(events)
    cutter = Intervals(times[0], frames[0], settings, threads=threads)
    parts = []
    for part in cutter.parts(zip(times[1:], frames[1:], strict=True)):
        parts.append(copy_of(part))
        cutter.expect(next(told))
    return parts


def copy_of(part):
    return module.Part(part.frames.copy(), part.before, part.share, part.times_ns, part.last.copy())


def light_at(part, k):
    """Light at instant k of a part, as the documentation says."""
    share, before = part.share[k], int(part.before[k])
    b = part.frames[before + 1].astype(np.float32)
    if share == 1.0:
        return b
    assert before >= 0
    a = part.frames[before].astype(np.float32)
    return a + (b - a) * share


def expected_instants(frames, times, L):
    """Return light and times [ns] of all instants: the first frame, and L of each interval."""
    light, at = [frames[0].astype(np.float32)], [times[0]]
    for a, b, ta, tb in zip(frames[:-1], frames[1:], times[:-1], times[1:], strict=True):
        a, b = a.astype(np.float32), b.astype(np.float32)  # noqa: PLW2901
        light += [a + (b - a) * np.float32(step / L) for step in range(1, L)] + [b]
        # rounded to whole ns, in whole numbers: half of L is added before the division
        at += [ta + ((tb - ta) * step + L // 2) // L for step in range(1, L + 1)]
    return light, at


def check_parts(parts, light, at, L, printed):
    """Check what parts hold against all instants; returns the number of intervals in each."""
    done = 0
    for number, part in enumerate(parts):
        count = len(part.times_ns) - 1
        assert count >= 1
        ahead = 1 if printed and number < len(parts) - 1 else 0
        assert part.before.shape == part.share.shape == (count + 1 + ahead,)
        # the first instant is the last of the part before
        assert part.times_ns == at[done : done + count + 1]
        for k in range(count + 1 + ahead):
            assert np.array_equal(light_at(part, k), light[done + k])
        ends = [
            printed and done + k + 1 < len(at) and (done + k + 1) % L == 0 for k in range(count)
        ]
        following = done + count + 1
        ends.append(printed and following < len(at) and following % L == 0)
        assert part.last.dtype == np.bool_
        assert part.last.tolist() == ends
        done += count
    assert done == len(at) - 1
    return [len(part.times_ns) - 1 for part in parts]


SIZES = [
    {},
    {"_MOST": 1, "_FIRST": 1},
    {"_MOST": 2, "_FIRST": 1},
    {"_MOST": 5, "_FIRST": 4},
    {"_MOST": 7, "_FIRST": 7},
    {"_MOST": 64, "_FIRST": 1},
    {"FRAME_BYTES": 1},
    {"FRAME_BYTES": 4 * 60, "_MOST": 30},
]


def force(monkeypatch, sizes):
    for name, value in sizes.items():
        monkeypatch.setattr(module, name, value)


@pytest.mark.parametrize("sizes", SIZES, ids=str)
@pytest.mark.parametrize("L", [1, 3, 10])
@pytest.mark.parametrize("printed", [False, True])
@pytest.mark.parametrize("dtype", [np.uint8, np.float32, np.float64])
def test_parts_hold_every_instant_once(monkeypatch, sizes, L, printed, dtype):
    force(monkeypatch, sizes)
    for count in (2, 3, 9, 24):
        frames, times = clip(count, dtype), clock(count)
        parts = cut(frames, times, sampling(L, printed=printed))
        check_parts(parts, *expected_instants(frames, times, L), L, printed)
        assert all(
            part.frames.dtype == (dtype if dtype == np.uint8 else np.float32) for part in parts
        )


@pytest.mark.parametrize("sizes", SIZES, ids=str)
@pytest.mark.parametrize("printed", [False, True])
@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("L", [1, 4])
def test_parts_hold_every_frame_made_along_the_motion(monkeypatch, sizes, printed, threads, L):
    force(monkeypatch, sizes)
    still = np.add.outer(np.hanning(24), np.hanning(32)).astype(np.float32) * 100
    frames, times = [np.roll(still, 2 * k, 1) for k in range(6)], clock(6)
    settings = sampling(L, printed=printed, interpolation="flow")
    parts = cut(frames, times, settings, threads=threads)
    upsampler = make_upsampler(Sampling(interpolation="flow", L=L))
    light = [frames[0]]
    for a, b in itertools.pairwise(frames):
        light += list(upsampler.between(a, b))
    check_parts(parts, light, expected_instants(frames, times, L)[1], L, printed)
    assert all(np.all(part.share == 1.0) for part in parts)


@pytest.mark.parametrize("L", [1, 3, 10])
@pytest.mark.parametrize("printed", [False, True])
def test_sizes_that_change_all_the_time(L, printed):
    """Bursts and lulls, in any order, lose no instant."""
    draw = np.random.default_rng(L)
    count = 60 + 300 // L
    frames, times = clip(count), clock(count)
    told = draw.choice([0, 10, 300_000, 1_000_000, 30_000_000], 1000)
    parts = cut(frames, times, sampling(L, printed=printed), told)
    counts = check_parts(parts, *expected_instants(frames, times, L), L, printed)
    assert len(set(counts)) > 4


# --- sizes ---------------------------------------------------------------------------------------


def sizes_after(events, frames=400, L=1):
    """Intervals in each part but the last; `events` gives those of a part of so many intervals."""
    times = clock(frames)
    cutter = Intervals(times[0], clip(1)[0], sampling(L), threads=1)
    counts = []
    still = itertools.repeat(clip(1)[0])
    for part in cutter.parts(zip(times[1:], still, strict=False)):
        counts.append(len(part.times_ns) - 1)
        cutter.expect(events(len(counts), counts[-1]))
    return counts[:-1]


def test_parts_grow_while_little_happens():
    counts = sizes_after(lambda number, count: 0)
    assert counts[:3] == [module._FIRST, 4 * module._FIRST, 16 * module._FIRST]
    assert set(counts[3:]) == {module._MOST}


@pytest.mark.parametrize("L", [1, 10])
def test_parts_shrink_under_a_burst_and_grow_back(L):
    """As many intervals as the last part's events allow; after the burst, four times as many."""
    per_interval = module.EVENTS // 8

    def events(number, count):
        return per_interval * count if 5 <= number < 12 else 0

    counts = sizes_after(events, L=L)
    assert counts[4] == module._MOST
    assert counts[5:12] == [8] * 7
    assert counts[12:14] == [32, module._MOST]


def test_a_burst_beyond_any_measure_leaves_one_interval():
    counts = sizes_after(lambda number, count: 10**12)
    assert counts[0] == module._FIRST
    assert set(counts[1:]) == {1}


def test_frames_that_fill_their_memory_shorten_the_parts(monkeypatch):
    frame_bytes = clip(1)[0].nbytes
    monkeypatch.setattr(module, "FRAME_BYTES", 7 * frame_bytes)
    assert max(sizes_after(lambda number, count: 0)) == 6
    assert max(sizes_after(lambda number, count: 0, L=10)) == 60


@pytest.mark.parametrize("interpolation", ["linear", "flow"])
@pytest.mark.parametrize("L", [1, 10])
def test_memory_does_not_grow_with_the_length(interpolation, L):
    shape = (40, 50)
    frame = clip(1, shape=shape)[0]

    def peak(count):
        times = clock(count)
        cutter = Intervals(times[0], frame, sampling(L, interpolation=interpolation), threads=1)
        held = set()
        tracemalloc.start()
        for part in cutter.parts((t, frame.copy()) for t in times[1:]):
            held.add(part.frames.base.shape[0])
            cutter.expect(0)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert len(held) == 1
        assert held.pop() * frame.nbytes <= module.FRAME_BYTES + 3 * frame.nbytes
        return most

    short, long = peak(30), peak(300)
    assert long < 1.2 * short + 8 * frame.nbytes


# --- frames that are not ours --------------------------------------------------------------------


def reused(frames):
    """Yield the frames in one and the same buffer, which is wiped after each."""
    buffer = np.empty_like(frames[0])
    for frame in frames:
        buffer[:] = frame
        yield buffer
        buffer[:] = 77


@pytest.mark.parametrize("sizes", SIZES[:4], ids=str)
@pytest.mark.parametrize("L", [1, 3])
@pytest.mark.parametrize("printed", [False, True])
def test_frames_may_be_overwritten_once_the_next_is_asked_for(monkeypatch, sizes, L, printed):
    force(monkeypatch, sizes)
    frames, times = clip(15), clock(15)
    source = zip(times, reused(frames), strict=True)
    t_ns, first = next(source)
    cutter = Intervals(t_ns, first, sampling(L, printed=printed), threads=1)
    parts = [copy_of(part) for part in cutter.parts(source)]
    check_parts(parts, *expected_instants(frames, times, L), L, printed)


@pytest.mark.parametrize("interpolation", ["linear", "flow"])
@pytest.mark.parametrize("L", [1, 4])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
def test_a_generator_that_reuses_its_buffer_gives_the_same_events(interpolation, L, dtype):
    still = np.add.outer(np.hanning(24), np.hanning(32)) * 100
    frames = np.array([np.roll(still, 2 * k, 1) for k in range(6)]).astype(dtype)
    times = 0.01 * np.arange(6)
    config = Config(
        pixel=quiet(),
        sampling=sampling(L, interpolation=interpolation),
        frames=Frames(encoding="linear", full_scale=255.0),
    )
    kept, overwritten = (
        np.concatenate(list(simulate(source, times, config, threads=1)))
        for source in (frames, reused(frames))
    )
    assert kept.size > 100
    assert np.array_equal(kept, overwritten)


@pytest.mark.parametrize("L", [1, 3, 10])
@pytest.mark.parametrize("printed", [False, True])
@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
@pytest.mark.quick_cases(1)
def test_events_do_not_depend_on_the_parts(monkeypatch, L, printed, dtype):
    frames, times = clip(12, dtype, (6, 9)), 1e-9 * np.array(clock(12))
    config = Config(
        sampling=sampling(L, printed=printed), frames=Frames(encoding="linear", full_scale=255.0)
    )
    found = []
    for sizes in SIZES:
        with monkeypatch.context() as patch:
            force(patch, sizes)
            found.append(np.concatenate(list(simulate(frames, times, config, threads=2))))
    with monkeypatch.context() as patch:
        patch.setattr(module, "EVENTS", 20)  # every part is a burst
        found.append(np.concatenate(list(simulate(frames, times, config, threads=1))))
    assert found[0].size > 200
    assert all(np.array_equal(found[0], other) for other in found[1:])


# --- errors --------------------------------------------------------------------------------------


@pytest.mark.parametrize("interpolation", ["linear", "flow"])
def test_a_single_frame_is_refused(interpolation):
    cutter = Intervals(0, clip(1)[0], sampling(3, interpolation=interpolation), threads=1)
    with pytest.raises(DataError, match=r"^a single frame: at least two are needed$"):
        next(cutter.parts(iter([])))


@pytest.mark.parametrize("step_ns", [0, -1_000])
@pytest.mark.parametrize("at", [1, 5])
@pytest.mark.parametrize("L", [1, 10])
def test_times_that_do_not_increase_name_the_frame(step_ns, at, L):
    frames, times = clip(8), clock(8)
    times[at] = times[at - 1] + step_ns
    named = (
        rf"^frame {at}: its time {times[at] * 1e-9:.9f} s is not after the one before"
        rf" \({times[at - 1] * 1e-9:.9f} s\)$"
    )
    with pytest.raises(DataError, match=named):
        cut(frames, times, sampling(L))


@pytest.mark.parametrize(
    ("step_ns", "L", "refused"), [(9, 10, True), (10, 10, False), (1, 1, False)]
)
def test_frames_too_near_for_the_instants_between_them_are_refused(step_ns, L, refused):
    frames, times = clip(4), [0, step_ns, 2 * step_ns, 3 * step_ns]
    if not refused:
        assert len(cut(frames, times, sampling(L))) > 0
        return
    with pytest.raises(DataError, match=r"^frame 1: 9 ns after the one before, too near for 10 in"):
        cut(frames, times, sampling(L))

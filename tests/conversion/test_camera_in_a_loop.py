"""A camera in a loop makes what `simulate` makes of the same frames, and says what it cannot."""

from __future__ import annotations

import gc
import multiprocessing
import os
import pickle
import subprocess
import sys
import threading

import numpy as np
import pytest
from threads import wait_until

import adv2e
from adv2e import Camera, ConfigError, DataError, UsageError, load_config, simulate, write_events
from adv2e.effects.hooks import Hooks
from adv2e.events import empty_events

ROWS, COLUMNS, COUNT = 24, 32, 16
SIZE = (COLUMNS, ROWS)
TIMES = [3.0 + 0.003 * k + 0.0004 * (k % 3) for k in range(COUNT)]
LIGHT = "frames.encoding=linear"
CAMERA = ["davis240c", {"frames": {"encoding": "linear"}}]
READOUT = "readout={arbiter: {event_ns: 3000, row_ns: 9000}, double_read: {on: 0.1, off: 0.2}}"
CONFIGS = {
    "usual": [],
    "one instant": ["sampling.L=1"],
    "printed": ["pixel.low_pass.update=paper", "sampling.last_interval=printed"],
    "arbiter": [READOUT],
    "tick": ["readout={tick_us: 250, loss: {fraction: 0.3}}"],
    "coupling": ["readout.frame_coupling={amplitude: 0.3, tau_us: 900, delay_us: 300}"],
    "lamp": ["readout.frame_coupling={amplitude: 0.3, tau_us: 900, period_us: 7000}"],
    "clocks": ["frames.clock_drift_ppm=2000", "frames.clock_offset_us=-1500"],
    "picture": ["frames.black_level_dn=4", "frames.shift_px=[0.4, -1]", "pixel.dark_current.dn=3"],
    "noise": ["pixel.photoreceptor_noise.rms=0.05", "pixel.shot_noise.rate_hz=40"],
    "steps": ["pixel.high_pass.cutoff_hz=3", "frames.flicker={frequency_hz: 120, depth: 0.3}"],
    "many": ["pixel.refractory=null", "pixel.hot_pixels={fraction: 0.1, rate_hz: 90}"],
}


def clip(dtype=np.uint8, rows=ROWS, columns=COLUMNS, colour=False, speed=0.8):
    y, x = np.mgrid[:rows, :columns]
    made = []
    for k in range(COUNT):
        grey = 110 + 90 * np.sin(0.5 * (x - speed * k)) * np.cos(0.4 * y)
        made.append(np.stack([grey, 0.5 * grey, grey[::-1]], -1) if colour else grey)
    scale = {"u": np.iinfo(dtype).max if np.dtype(dtype).kind == "u" else 0, "f": 1.0}
    return [(f / 255 * scale[np.dtype(dtype).kind]).astype(dtype) for f in made]


def pushed(camera, frames, times=TIMES):
    return [camera.push(frame, t) for frame, t in zip(frames, times, strict=True)]


def whole(frames, config, times=TIMES, **options):
    return np.concatenate(list(simulate(frames, times, config, **options)))


def together(parts):
    return np.concatenate(parts).tobytes()


@pytest.mark.parametrize("name", CONFIGS)
def test_all_pushes_are_what_simulate_makes(name):
    config, frames = load_config([], [LIGHT, *CONFIGS[name]], seed=4), clip()
    camera = Camera(config=config)
    parts = pushed(camera, frames)
    expected = whole(frames, config, threads=1)
    assert expected.size > 100
    assert parts[0].size == 0
    assert together([*parts, camera.close()]) == expected.tobytes()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize("colour", [False, True])
@pytest.mark.filterwarnings("ignore")
def test_frames_of_all_types_are_fitted_as_by_simulate(dtype, colour):
    frames = clip(dtype, colour=colour)
    camera = Camera((20, 18), CAMERA, 3)
    parts = pushed(camera, frames)
    expected = whole(frames, CAMERA, seed=3, size=(20, 18))
    assert together([*parts, camera.close()]) == expected.tobytes()
    assert expected.size > 100


def test_it_makes_what_convert_writes(tmp_path):
    np.save(tmp_path / "clip.npy", np.stack(clip()))
    config = load_config("davis346", [LIGHT, "sensor=null"], seed=2)
    adv2e.convert(tmp_path / "clip.npy", tmp_path / "clip.h5", config, fps="1000/7")
    camera = Camera(config=config)
    parts = pushed(camera, clip(), [0.007 * k for k in range(COUNT)])
    events = np.concatenate([*parts, camera.close()])
    write_events(tmp_path / "camera.h5", events, SIZE)
    written = adv2e.read_events(tmp_path / "clip.h5").events
    assert events.size > 100
    assert written.tobytes() == events.tobytes()


def test_events_come_with_the_frame_that_ends_their_interval():
    camera = Camera(config=load_config("ideal", LIGHT))
    for events, before, now in zip(pushed(camera, clip())[1:], TIMES, TIMES[1:], strict=False):
        assert events.size
        assert np.all(events["t"] >= round(before * 1e6))
        assert np.all(events["t"] < round(now * 1e6))
    late = camera.close()
    assert np.all(late["t"] == round(TIMES[-1] * 1e6))


@pytest.mark.parametrize("name", CONFIGS)
def test_reset_begins_anew_with_the_same_seed_or_another(name):
    config, frames = load_config([], [LIGHT, *CONFIGS[name]]), clip()
    camera = Camera(config=config)
    pushed(camera, frames[:7], TIMES[:7])
    camera.reset()
    assert together(pushed(camera, frames)) == together(pushed(Camera(config=config), frames))
    camera.reset(seed=9)
    other = pushed(Camera(config=config, seed=9), frames)
    assert together(pushed(camera, frames)) == together(other)


@pytest.mark.parametrize("name", CONFIGS)
def test_a_state_goes_on_byte_for_byte(name):
    config, frames = load_config([], [LIGHT, *CONFIGS[name]]), clip()
    camera = Camera(config=config, seed=6)
    before = pushed(camera, frames[:9], TIMES[:9])
    kept = pickle.dumps(camera.state())
    expected = together([*pushed(camera, frames[9:], TIMES[9:]), camera.close()])
    assert expected
    another = Camera(config=config)
    state = pickle.loads(kept)
    for _ in range(2):  # a state is good for more than once
        another.load(state)
        again = [*pushed(another, frames[9:], TIMES[9:]), another.close()]
        assert together(again) == expected
    assert together(before + again) == whole(frames, config, seed=6).tobytes()


def test_several_cameras_are_each_one_of_its_seed():
    streams = [clip(speed=0.3 + 0.4 * k) for k in range(3)]
    camera = Camera(SIZE, CAMERA, 5, count=3)
    parts = [
        camera.push(np.stack(f), t) for f, t in zip(zip(*streams, strict=True), TIMES, strict=True)
    ]
    parts.append(camera.close())
    for k, frames in enumerate(streams):
        expected = whole(frames, CAMERA, seed=5 + k, size=SIZE)
        assert expected.size
        assert together([part[k] for part in parts]) == expected.tobytes()


def test_one_of_several_begins_anew_while_the_others_go_on():
    frames, late = clip(), [t + 1 for t in TIMES]
    camera = Camera(SIZE, CAMERA, 5, count=2)
    for k in range(6):
        camera.push([frames[k], frames[k]], TIMES[k])
    camera.reset(seed=40, where=np.array([False, True]))
    parts = [camera.push([frames[6 + k], frames[k]], [TIMES[6 + k], late[k]]) for k in range(8)]
    alone = Camera(SIZE, CAMERA, 41)
    expected = pushed(alone, frames[:8], late[:8])
    assert together([part[1] for part in parts]) == together(expected)
    assert together([part[0] for part in parts]) == together(
        pushed_after(Camera(SIZE, CAMERA, 5), frames, 6, 14)
    )


def pushed_after(camera, frames, begin, end):
    return pushed(camera, frames[:end], TIMES[:end])[begin:]


class OneByOne(Hooks):
    """Doubles the light; of each call, holds the last event back until the next one."""

    def begin(self, view):
        super().begin(view)
        self._held = empty_events()

    def light_now(self, t_ns, light):
        return t_ns, 2 * light

    def events_now(self, events):
        known = np.concatenate([self._held, events])
        self._held = known[-1:]
        return known[:-1]

    def events_left(self):
        return self._held


class Ahead(Hooks):
    def events(self, chunks):
        yield from list(chunks)


def test_own_effects_take_part_where_they_do_not_look_ahead():
    frames = clip()
    camera = Camera(SIZE, CAMERA, effects=[OneByOne()])
    parts = pushed(camera, frames)
    expected = whole(frames, CAMERA, size=SIZE, effects=[OneByOne()])
    camera_left = camera.close()
    assert together([*parts, camera_left]) == expected.tobytes()
    assert camera_left.size == 1
    with pytest.raises(ConfigError, match=r"effect ahead: needs what is still to come"):
        Camera(effects=[Ahead()])


def test_causes_come_as_with_simulate():
    frames, config = clip(), load_config([], [LIGHT, "pixel.shot_noise.rate_hz=30"])
    camera = Camera(config=config, causes=True)
    parts = pushed(camera, frames)
    expected = whole(frames, config, causes=True)
    assert together([*parts, camera.close()]) == expected.tobytes()
    assert np.unique(expected["cause"]).size > 1


@pytest.mark.parametrize(
    ("key", "text"),
    [
        ("sampling.interpolation=flow", "sampling.interpolation: flow needs frames"),
        ("frames.exposure_us=900", "effect exposure_blur: needs what is still to come"),
        (
            "readout.frame_coupling={amplitude: 0.1, tau_us: 900, delay_us: -50}",
            "effect frame_coupling: needs",
        ),
    ],
)
def test_what_needs_later_frames_is_refused(key, text):
    with pytest.raises(ConfigError, match=text):
        Camera(config=load_config([], [key]))


@pytest.mark.parametrize(
    ("frame", "t", "text"),
    [
        (np.zeros((ROWS, COLUMNS), np.uint8), TIMES[2], r"frame 3: its time 3.006800000 s is not"),
        (np.zeros((ROWS, COLUMNS), np.uint8), np.nan, "frame 3: its time is nan"),
        (np.zeros((ROWS, COLUMNS), np.uint8), "now", "frame 3: its time is now, must be a number"),
        (np.zeros((ROWS, COLUMNS + 1), np.uint8), 9.0, r"frame 3: uint8 \(24, 33\), but the first"),
        (np.zeros((ROWS, COLUMNS), np.float32), 9.0, "frame 3: float32"),
        (object(), 9.0, "frame 3: object"),
    ],
)
def test_a_frame_that_is_refused_changes_nothing(frame, t, text):
    frames = clip()
    camera = Camera(SIZE, CAMERA)
    parts = pushed(camera, frames[:3], TIMES[:3])
    with pytest.raises(DataError, match=text):
        camera.push(frame, t)
    parts += pushed(camera, frames[3:], TIMES[3:])
    expected = whole(frames, CAMERA, size=SIZE)
    assert together([*parts, camera.close()]) == expected.tobytes()


@pytest.mark.parametrize(
    ("first", "text"),
    [
        (np.full((4, 4), np.nan), "NaN"),
        (np.zeros((4, 4, 4), np.uint8), r"frame 0: shape \(4, 4, 4\)"),
        (np.zeros((4, 4), np.int32), "int32"),
    ],
)
def test_wrong_first_frames_are_refused(first, text):
    with pytest.raises(DataError, match=text):
        Camera().push(first, 0.0)


def test_what_failed_within_a_frame_goes_on_only_after_reset():
    camera = Camera(config=load_config("ideal", [LIGHT, "sampling.L=10"]))
    camera.push(clip()[0], 1.0)
    with pytest.raises(DataError, match="too near for 10 instants"):
        camera.push(clip()[1], 1.0 + 3e-9)
    with pytest.raises(UsageError, match=r"in the midst of a frame: reset\(\) begins anew"):
        camera.push(clip()[1], 2.0)
    with pytest.raises(UsageError, match="in the midst"):
        camera.close()
    camera.reset()
    assert together(pushed(camera, clip())) == together(
        pushed(Camera(config=camera.config), clip())
    )
    camera.close()
    with pytest.raises(UsageError, match=r"was closed: reset\(\)"):
        camera.push(clip()[0], 99.0)


def test_a_limit_of_events_holds():
    with pytest.raises(DataError, match="max_events: more than 3 events"):
        pushed(Camera(config=load_config([], [LIGHT, "max_events=3"])), clip())


def test_states_of_other_cameras_are_refused():
    camera = Camera(SIZE, CAMERA)
    pushed(camera, clip()[:4], TIMES[:4])
    state = camera.state()
    for other, text in [
        (Camera((31, 24), CAMERA), "sensor.width: 32, where this camera has 31"),
        (Camera(SIZE, [*CAMERA, {"pixel": {"leak": {"rate_hz": 1}}}]), r"state: pixel.leak"),
        (Camera(SIZE, CAMERA, count=2), "count: None, where this camera has 2"),
        (
            Camera(SIZE, CAMERA, effects=[OneByOne()]),
            r"effects: \[\], where this camera has \[.one_by_one",
        ),
    ]:
        with pytest.raises(DataError, match=text):
            other.load(state)
    with pytest.raises(DataError, match=r"adv2e: 0\.0, where"):
        camera.load({**state, "adv2e": "0.0"})
    with pytest.raises(DataError, match="must be what state"):
        camera.load(None)
    free, large = (Camera(config=[*CAMERA, {"sensor": None}]) for _ in range(2))
    pushed(free, clip()[:2], TIMES[:2])
    pushed(large, clip(rows=30)[:2], TIMES[:2])
    with pytest.raises(DataError, match=r"of frames of uint8 \(30, 32\)"):
        free.load(large.state())


def test_wrong_arguments_are_one_line():
    with pytest.raises(UsageError, match="count: must be a whole number"):
        Camera(count=0)
    with pytest.raises(UsageError, match="threads"):
        Camera(threads=0)
    with pytest.raises(
        UsageError, match="size: must be columns x rows, such as 346x260, got '0x3'"
    ):
        Camera((0, 3))
    with pytest.raises(UsageError, match=r"^seed: must be at least 0"):
        Camera(seed=-1)
    camera = Camera(SIZE, count=2)
    with pytest.raises(DataError, match="frames for 2 cameras"):
        camera.push(clip()[0], 0.0)
    with pytest.raises(DataError, match=r"times of shape \(3,\) for 2 cameras"):
        camera.push(clip()[:2], [0.0, 1.0, 2.0])
    with pytest.raises(DataError, match="camera 1: frame 0: pixels that are NaN"):
        camera.push([np.zeros((4, 4)), np.full((4, 4), np.nan)], 0.0)
    with pytest.raises(UsageError, match="where: must be 2 of bool"):
        camera.reset(where=[0, 1])


class Exporting:
    """What DLPack hands on, and nothing else."""

    def __init__(self, array):
        self._array = array
        self.__dlpack__ = array.__dlpack__

    def __dlpack_device__(self):
        return self._array.__dlpack_device__()


class OnDevice:
    """As a tensor that lies elsewhere answers NumPy."""

    def __array__(self, *_, **__):
        raise TypeError("can't convert cuda:0 device type tensor to numpy")


def test_arrays_of_others_are_taken():
    frames = clip()
    expected = together(pushed(Camera(SIZE, CAMERA), frames))
    shared = [Exporting(frame) for frame in frames]
    assert together(pushed(Camera(SIZE, CAMERA), shared)) == expected
    still = [frame.copy() for frame in frames]
    for frame in still:
        frame.flags.writeable = False
    assert together(pushed(Camera(SIZE, CAMERA), still)) == expected
    with pytest.raises(DataError, match="frame 0: no array in the memory of the CPU: can't"):
        Camera().push(OnDevice(), 0.0)


def test_tensors_are_taken():
    torch = pytest.importorskip("torch")
    frames = clip()
    tensors = [torch.from_numpy(frame) for frame in frames]
    expected = together(pushed(Camera(SIZE, CAMERA), frames))
    assert together(pushed(Camera(SIZE, CAMERA), tensors)) == expected
    pair = Camera(SIZE, CAMERA, count=2)
    parts = [pair.push(torch.stack([one, one]), t) for one, t in zip(tensors, TIMES, strict=True)]
    assert together([part[0] for part in parts]) == expected


def test_a_frame_may_be_overwritten_after_its_push():
    buffer, parts = np.empty((ROWS, COLUMNS), np.uint8), []
    camera = Camera(config=load_config("ideal", [LIGHT, "sampling.L=1"]))
    for frame, t in zip(clip(), TIMES, strict=True):
        buffer[:] = frame
        parts.append(camera.push(buffer, t))
        buffer[:] = 0
    assert together(parts) == together(pushed(Camera(config=camera.config), clip()))


def _in_child(camera, frames, answers):
    answers.put(together(pushed(camera, frames[5:], TIMES[5:])))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="without fork")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_camera_works_on_in_a_process_that_was_forked():
    camera, frames = Camera(SIZE, CAMERA, threads=2), clip()
    pushed(camera, frames[:5], TIMES[:5])
    fork = multiprocessing.get_context("fork")
    answers = fork.Queue()
    child = fork.Process(target=_in_child, args=(camera, frames, answers))
    child.start()
    try:
        assert answers.get(timeout=60) == together(pushed(camera, frames[5:], TIMES[5:]))
    finally:
        child.kill()
        child.join()


def test_threads_end_with_the_camera():
    before = {*threading.enumerate()}
    camera = Camera(SIZE, CAMERA, threads=2)
    pushed(camera, clip()[:5], TIMES[:5])
    own = {*threading.enumerate()} - before
    assert own
    del camera
    gc.collect()
    wait_until(lambda: not any(thread.is_alive() for thread in own))


COMPILED = """
import sys
import numpy as np
from numba.core import event
import adv2e

name, dtype, rest = sys.argv[1], np.dtype(sys.argv[2]), sys.argv[3:]
camera = adv2e.Camera((48, 40), adv2e.load_config(name, rest))
camera.warm(np.zeros((1, 1), dtype))
ready = event.RecordingListener()
event.register("numba:compile", ready)
y, x = np.mgrid[:40, :48]
white = 1.0 if dtype.kind == "f" else np.iinfo(dtype).max
count = 0
for k in range(8):
    frame = (white * (0.5 + 0.4 * np.sin(0.4 * (x - 2 * k)) * np.cos(0.3 * y))).astype(dtype)
    count += camera.push(frame, 0.01 * k).size
count += camera.close().size
assert count > 1000, count
print(len(ready.buffer))
"""


@pytest.mark.parametrize(
    ("name", "dtype", "sets"),
    [
        ("ideal", "u1", []),
        ("davis346", "f4", ["frames.black_level_dn=3"]),
        ("adv2e", "u1", ["sampling.L=1", READOUT, "pixel.shot_noise.rate_hz=40"]),
    ],
)
@pytest.mark.quick_cases(1)
def test_a_warm_camera_compiles_nothing_more(name, dtype, sets, tmp_path):
    run = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", COMPILED, name, dtype, *sets],
        env={**os.environ, "XDG_CACHE_HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.stderr == ""
    assert run.stdout.split() == ["0"]

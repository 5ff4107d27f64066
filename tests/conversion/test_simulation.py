"""The Python entry point, and the stages between source and kernel."""

import subprocess
import sys
from contextlib import suppress

import numpy as np
import pytest
from harness import quiet

import adv2e
from adv2e.config import Config
from adv2e.config.model import Frames, Sampling
from adv2e.errors import Adv2eError, ConfigError, DataError, UsageError
from adv2e.events import is_sorted, sort_events
from adv2e.light import intervals

LINEAR, SRGB = (Frames(encoding=name) for name in ("linear", "srgb"))


def numbers(dtype, count=7, shape=(20, 30)):
    y, x = np.mgrid[: shape[0], : shape[1]]
    scale = 1 if dtype == np.uint8 else 257
    return [
        ((120 + 100 * np.sin(0.4 * (x - 2 * k)) * np.cos(0.3 * y)) * scale).astype(dtype)
        for k in range(count)
    ]


def frames(count=7, shape=(20, 30)):
    """Return light of 0..1, of as many levels as 8 bits have."""
    return [one / np.float32(255) for one in numbers(np.uint8, count, shape)]


def times(count=7, start=0.0):
    return [start + k / 30 for k in range(count)]


def run(images, at, config=None, **options):
    return np.concatenate(list(adv2e.simulate(images, at, config or Config(), **options)))


def test_sorted_and_the_same_for_any_chunk_and_thread_count(monkeypatch):
    whole = run(frames(), times(), threads=1)
    assert len(whole) > 500
    assert whole.tobytes() == sort_events(whole).tobytes()
    for size in (1, 3):
        monkeypatch.setattr(intervals, "_MOST", size)
        assert run(frames(), times(), threads=2).tobytes() == whole.tobytes()


@pytest.mark.parametrize("L", [1, 4])
def test_printed_last_interval_for_any_chunk(monkeypatch, L):
    config = Config(
        sampling=Sampling(L=L, K=3, last_interval="printed"), pixel=quiet(low_pass=None)
    )
    whole = run(frames(), times(), config)
    corrected = run(frames(), times(), Config(sampling=Sampling(L=L, K=3), pixel=config.pixel))
    assert whole.tobytes() != corrected.tobytes()
    for size in (1, 2, 5):
        monkeypatch.setattr(intervals, "_MOST", size)
        assert run(frames(), times(), config).tobytes() == whole.tobytes()


def test_epoch_times_shift_events_exactly():
    config = Config(pixel=quiet())
    early = run(frames(), [k * 0.04 for k in range(7)], config)
    late = run(frames(), [1_468_941_032 + k * 0.04 for k in range(7)], config)
    early["t"] += 1_468_941_032_000_000
    # float64 seconds hold an epoch time to 0.2 us only
    assert np.abs(early["t"] - late["t"]).max() <= 1


def test_sixteen_bit_and_float_are_not_cut_to_eight():
    config = Config(pixel=quiet(), frames=LINEAR)
    deep = run(numbers(np.uint16), times(), config)
    light = [f.astype(np.float64) / 65535 for f in numbers(np.uint16)]
    assert np.abs(deep["t"] - run(light, times(), config)["t"]).max() <= 1
    shallow = [(f // 257).astype(np.uint8) for f in numbers(np.uint16)]
    assert run(shallow, times(), config).tobytes() != deep.tobytes()


def test_8_bits_are_srgb_unless_told():
    grey = numbers(np.uint8)
    colour = [np.repeat(f[:, :, None], 3, axis=2) for f in grey]
    by_default = Config(pixel=quiet())
    srgb, linear = (Config(pixel=quiet(), frames=one) for one in (SRGB, LINEAR))
    assert run(colour, times(), by_default).tobytes() == run(colour, times(), srgb).tobytes()
    with pytest.warns(UserWarning, match="8-bit grey arrays"):
        guessed = run(grey, times(), by_default)
    assert guessed.tobytes() == run(grey, times(), srgb).tobytes()
    assert guessed.tobytes() != run(grey, times(), linear).tobytes()
    # luma is weighed in light: equal channels give what the grey picture gives, but for rounding
    assert len(run(colour, times(), srgb)) == len(guessed)


@pytest.mark.parametrize("channels", [(), (3,)])
def test_16_bits_are_linear_unless_told(channels):
    deep = [np.broadcast_to(f.T, (*channels, *f.T.shape)).T for f in numbers(np.uint16)]
    with pytest.warns(UserWarning, match=f"16-bit {'colour' if channels else 'grey'} arrays"):
        guessed = run(deep, times(), Config(pixel=quiet()))
    stated = [run(deep, times(), Config(pixel=quiet(), frames=one)) for one in (LINEAR, SRGB)]
    assert [one.tobytes() == guessed.tobytes() for one in stated] == [True, False]


@pytest.mark.parametrize(
    ("images", "at", "text"),
    [
        ([], [], "no frames"),
        (frames(1), times(1), "single frame"),
        (frames(3), iter([0.0, 0.1]), "frame 2: has no time"),
        (frames(3), [0.0, 0.1], "2 times for 3 frames"),
        (frames(3), times(4), "4 times for 3 frames"),
        (iter(frames(3)), iter(times(4)), "more times than frames, of which there are 3"),
        (frames(3), [0.0, np.nan, 0.2], "frame 1: its time is nan"),
        ([255.0 * np.ones((4, 4))] * 2, times(2), "floats up to 255, where 1 is white"),
        (frames(3), [0.0, 0.1, 0.1], "frame 2"),
        (frames(3), [0.0, 0.1, 0.05], "not after"),
        ([*frames(2), frames(1, (5, 5))[0]], times(3), "frame 2"),
        ([np.zeros((4, 4), np.int32)] * 2, times(2), "int32"),
        ([np.zeros((4, 4, 2), np.uint8)] * 2, times(2), "shape"),
        ([np.full((4, 4), np.nan)] * 2, times(2), "frame 0"),
    ],
)
def test_bad_input_is_one_clear_line(images, at, text):
    with pytest.raises(DataError, match=text) as caught:
        run(images, at)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("config", ["ideal", {"pixel": {"refractory": None, "shot_noise": None}}])
def test_a_configuration_is_whatever_load_config_takes(config):
    events = run(frames(), times(), config)
    assert events.tobytes() == run(frames(), times(), adv2e.load_config(config)).tobytes()
    assert events.tobytes() != run(frames(), times()).tobytes()


def test_a_configuration_must_be_one():
    with pytest.raises(ConfigError, match="a mapping or a Config, got int"):
        run(frames(), times(), 3)


@pytest.mark.parametrize("rate", [30, 30.0, np.float32(30)])
def test_a_number_is_a_rate(rate):
    assert run(iter(frames()), rate).tobytes() == run(frames(), times()).tobytes()


@pytest.mark.parametrize("rate", [0, -30, 1e10, np.inf, np.nan, "30", None])
def test_a_rate_that_cannot_be_is_refused(rate):
    with pytest.raises(DataError, match=r"^times: "):
        run(frames(), rate)


def test_a_rate_goes_by_its_name_too():
    whole = run(frames(), times())
    assert run(frames(), None, fps=30).tobytes() == whole.tobytes()
    assert run(frames(), None, fps="30000/1001").tobytes() != whole.tobytes()
    with pytest.raises(DataError, match=r"^times, fps: give one of them"):
        run(frames(), times(), fps=30)
    with pytest.raises(DataError, match=r"^fps: a rate "):
        run(frames(), None, fps=-30)


def test_seed_and_size_are_those_of_the_configuration():
    whole = run(frames(), times())
    assert run(frames(), times(), seed=7).tobytes() != whole.tobytes()
    assert run(frames(), times(), seed=7).tobytes() == run(frames(), times(), {"seed": 7}).tobytes()
    assert run(frames(), times(), size=(15, 10))["x"].max() < 15


def test_arguments_are_checked_when_it_is_called():
    for wrong in ({"times": -1}, {"fps": 30, "config": 3}, {"fps": 30, "threads": 0}):
        with pytest.raises(Adv2eError):
            adv2e.simulate(frames(), **wrong)
    with pytest.raises(DataError, match="no frames"):
        adv2e.simulate([], fps=30)
    with pytest.raises(UsageError, match=r"threads: must be a whole number from 1 on, got 2\.5"):
        adv2e.simulate(frames(), fps=30, threads=2.5)


def test_no_chunk_is_empty_but_one_where_nothing_happens():
    chunks = list(adv2e.simulate(frames(), fps=30))
    assert chunks
    assert all(map(len, chunks))
    still = [np.full((4, 6), 0.5, np.float32)] * 5
    (nothing,) = adv2e.simulate(still, fps=30, config=Config(pixel=quiet()), causes=True)
    assert len(nothing) == 0
    assert "cause" in nothing.dtype.names


def test_progress_is_shown_on_standard_error(capsys):
    shown = run(frames(), times(), progress=True)
    assert shown.tobytes() == run(frames(), times()).tobytes()
    assert "7" in capsys.readouterr().err


@pytest.mark.parametrize(("unit", "apart"), [(1e3, "33.3333"), (1e5, "3333.33")])
def test_times_that_are_hardly_in_seconds_are_told(unit, apart):
    coming = adv2e.simulate(frames(), [unit * t for t in times()])
    with (
        pytest.warns(UserWarning, match=f"second frame comes {apart} s after the first: times are"),
        suppress(DataError),  # too long between frames, at last
    ):
        next(coming)


_PEAKS = """
import tracemalloc
import numpy as np
from adv2e import simulate

def peak(count):
    stream = (np.full((200, 300), 100 + k % 2, np.uint8) for k in range(count))
    tracemalloc.start()
    for _ in simulate(stream, 30, {"frames": {"encoding": "linear"}}, threads=1):
        pass
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return most

peak(100)  # loads what is compiled
print(peak(20), peak(100))
"""


@pytest.mark.thorough
def test_memory_does_not_grow_with_length():
    """A hundred frames take no more than twenty, in a process that does nothing else."""
    done = subprocess.run(
        [sys.executable, "-c", _PEAKS], capture_output=True, text=True, check=True
    )
    short, long = map(int, done.stdout.split())
    assert long < 1.1 * short


def test_every_chunk_is_sorted_and_follows_the_one_before():
    last = -1
    for events in adv2e.simulate(frames(), times()):
        assert is_sorted(events)
        if events.size:
            assert events["t"][0] >= last
            last = events["t"][-1]

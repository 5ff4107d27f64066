"""Light far above white is refused in every frame, whatever makes it; below, work is bounded."""

import time

import numpy as np
import pytest

from adv2e import load_config, simulate
from adv2e.cli import main
from adv2e.effects.hooks import Hooks
from adv2e.errors import DataError

TIMES = [0.01 * k for k in range(4)]


def frames(value=None, dtype=np.float32, shape=(6, 8)):
    made = np.random.default_rng(0).random((4, *shape)).astype(dtype)
    if value is not None:
        made[2, 3, 5] = value
    return made


def events(stack, *sets, effects=(), times=TIMES):
    config = load_config(sets=sets)
    return np.concatenate(list(simulate(stack, times, config, effects=effects, threads=1)))


@pytest.mark.parametrize("value", [17, 255, 1e10, 3e38])
def test_bright_pixel_of_a_later_frame_asks_what_white_is(value):
    with pytest.raises(DataError, match=r"frame 2: floats up to .*frames\.full_scale"):
        events(frames(value))


@pytest.mark.parametrize("value", [1001, 1e10, 3e38])
@pytest.mark.parametrize("shape", [(6, 8), (6, 8, 3)])
def test_said_white_does_not_open_the_door_to_endless_work(value, shape):
    with pytest.raises(DataError, match=r"^frame 2: .*light"):
        events(frames(value, shape=shape), "frames.full_scale=1")


def test_brightest_light_is_simulated_in_time():
    events(frames(1), "frames.full_scale=1")  # compiles
    began = time.perf_counter()
    assert events(frames(999), "frames.full_scale=1").size > 0
    assert time.perf_counter() - began < 20


@pytest.mark.parametrize("encoding", ["gamma:9", "gamma:2000"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_whole_numbers_made_bright_by_their_encoding(dtype, encoding):
    stack = np.full((4, 6, 8), 200, dtype)
    stack[2, 3, 5] = 250
    settings = (f"frames.encoding={encoding}", "frames.full_scale=200")
    if encoding == "gamma:9":  # 7.5 times white
        assert events(stack, *settings).size > 0
        return
    with pytest.raises(DataError, match=r"^frame 2: its light is inf"):
        events(stack, *settings)


@pytest.mark.parametrize("made", [1e9, np.nan, np.inf, -5.0])
def test_light_of_an_effect(made):
    class Lamp(Hooks):
        name = "lamp"
        stage = "frames"

        def light(self, source):
            for n, (t_ns, light) in enumerate(source):
                changed = light.copy()
                changed[0, 1] = made if n == 3 else changed[0, 1]
                yield t_ns, changed

    with pytest.raises(DataError, match=r"^frame 3: .*light"):
        events(frames(), effects=[Lamp()])


@pytest.mark.parametrize("key", ["pixel.dark_current.dn=1e9", "frames.black_level_dn=1e9"])
def test_light_of_a_key(key):
    with pytest.raises(DataError, match=r"^frame 0: light 3.922e"):
        events(frames(), key)


@pytest.mark.parametrize("L", [1, 4])
def test_a_frame_far_away_in_time_is_named(L):
    with pytest.raises(DataError, match=r"^frame 3: 1000000 s after .* another unit"):
        events(frames(), f"sampling.L={L}", times=[0.0, 0.01, 0.02, 1e6 + 0.02])


def test_convert_names_file_frame_and_key(tmp_path, capsys):
    np.save(tmp_path / "n.npy", frames(1e10))
    for more in ([], ["--set", "frames.full_scale=1"]):
        with pytest.raises(SystemExit) as ended:
            main(["convert", str(tmp_path / "n.npy"), "--fps", "100", *more,
                  "-o", str(tmp_path / "o.h5")])  # fmt: skip
        told = capsys.readouterr().err.splitlines()
        assert ended.value.code == 1
        assert len(told) == 1
        assert f"{tmp_path / 'n.npy'}: frame 2: " in told[0]
        assert "frames.full_scale" in told[0]
        assert not (tmp_path / "o.h5").exists()

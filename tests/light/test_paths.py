"""How many frames an interval gets, from motion that is known."""

import math

import numpy as np
import onnx_models
import pytest
from flow_scenes import disk, pan

from adv2e import Config
from adv2e.config import load_config
from adv2e.config.model import Sampling
from adv2e.conversion.simulation import events_from_light
from adv2e.errors import ConfigError
from adv2e.light.interpolation import make_upsampler
from adv2e.light.interpolation.flow import Paths
from adv2e.light.interpolation.linear import NOTHING
from adv2e.light.intervals import Intervals
from adv2e.motion.estimate import SMALLEST


def moving(px):
    """Return two frames of a pan by so many pixels."""
    return pan(0.0), pan(1.0, (px, 0.0))


@pytest.mark.parametrize("px", [0.5, 2.0, 3.4, 6.0])
@pytest.mark.parametrize("most", [0.5, 1.0, 2.0])
def test_a_pan_gets_as_many_frames_as_it_moves_pixels(px, most):
    count = Paths(40, most).count(*moving(px), NOTHING)
    # what is found at the border may be somewhat faster
    assert math.ceil(px / most) <= count <= math.ceil((1.1 * px + 0.8) / most)


def test_the_fastest_pixels_decide_though_most_are_at_rest():
    # a disk moves by 6 pixels over a texture at rest
    assert 12 <= Paths(40, 0.5).count(disk(0.0), disk(1.0), NOTHING) <= 16


def test_never_more_than_L_and_never_less_than_one():
    assert Paths(3, 0.1).count(*moving(4.0), NOTHING) == 3
    assert Paths(10, 100.0).count(*moving(4.0), NOTHING) == 1


def test_without_a_distance_it_is_L():
    assert Paths(7).count(*moving(1.0), NOTHING) == 7
    assert Paths(7).count(pan(0.0), pan(0.0), NOTHING) == 7


def test_where_nothing_changes_it_is_one():
    a = pan(0.0)
    assert Paths(10, 1.0).count(a, a.copy(), NOTHING) == 1
    assert Paths(10, 1.0).count(a, a * np.float32(1.0005), NOTHING) == 1


def test_where_motion_is_not_known_it_is_L():
    rng = np.random.default_rng(1)
    cut = (255 * rng.random((2, 64, 80))).astype(np.float32)
    assert Paths(10, 1.0).count(*cut, NOTHING) == 10
    small = (255 * rng.random((2, SMALLEST - 1, 80))).astype(np.float32)
    assert Paths(10, 1.0).count(*small, NOTHING) == 10
    # bars that look the same after 12 columns, moved by 6: nothing found explains the change
    _, x = np.mgrid[:64, :96].astype(np.float32)
    bars = [
        (120 + 100 * np.sign(np.sin(2 * np.pi * (x - d) / 12))).astype(np.float32) for d in (0, 6)
    ]
    assert Paths(10, 1.0).count(*bars, NOTHING) == 10


def instants(frames, times_ns, sampling):
    cutter = Intervals(times_ns[0], frames[0], sampling, threads=1)
    found = [times_ns[0]]
    for part in cutter.parts(zip(times_ns[1:], frames[1:], strict=True)):
        found += part.times_ns[1:]
        cutter.expect(0)
    return found


def test_intervals_get_their_own_numbers_of_instants():
    frames = [pan(0.0), pan(0.0), pan(1.0, (3.0, 0.0)), pan(1.0, (3.4, 0.0))]
    sampling = Sampling(L=20, interpolation="flow", max_motion_px=0.5)
    paths = make_upsampler(sampling)
    times = [0, 10_000_000, 20_000_001, 30_000_000]
    found = instants(frames, times, sampling)
    at = [found.index(t) for t in times]
    counts = np.diff(at)
    assert counts[0] == 1
    assert 6 <= counts[1] <= 8
    assert counts[2] in (1, 2)
    gaps = np.diff(found[at[1] : at[2] + 1])
    assert gaps.max() - gaps.min() <= 1  # equal parts, in whole ns
    assert paths.count(frames[0], frames[1]) == 1


def test_a_network_gets_as_many_as_the_motion_needs_and_halves_a_power_of_two(tmp_path):
    a, b = moving(2.4)
    blend = onnx_models.blend(tmp_path / "a.onnx")
    asked = make_upsampler(Sampling(L=64, interpolation="onnx", model=blend, max_motion_px=0.5))
    count = asked.count(a, b)
    assert 5 <= count <= 7
    assert len(list(asked.between(a, b))) == count
    middle = onnx_models.middle(tmp_path / "b.onnx")
    halved = make_upsampler(Sampling(L=64, interpolation="onnx", model=middle, max_motion_px=0.5))
    assert halved.count(a, b) == 8
    assert len(list(halved.between(a, b))) == 8


def test_events_are_those_of_a_fixed_number_where_motion_is_even():
    frames = [pan(0.5 * k) for k in range(5)]
    light = [(10_000_000 * k, frame) for k, frame in enumerate(frames)]
    quiet = ["pixel.leak=null", "pixel.shot_noise=null"]
    # the pan moves by less than 2 pixels a frame
    sets = ["sampling.interpolation=flow", "sampling.max_motion_px=100"]
    adaptive = load_config([], [*quiet, *sets])
    fixed = load_config([], [*quiet, sets[0], "sampling.L=1"])
    made = [np.concatenate(list(events_from_light(iter(light), c))) for c in (adaptive, fixed)]
    assert len(made[0]) > 100
    assert np.array_equal(*made)


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"max_motion_px": 1.0}, "max_motion_px: linear interpolation knows of no motion"),
        ({"interpolation": "flow", "max_motion_px": 0.0}, "max_motion_px: must be above 0"),
        ({"interpolation": "onnx"}, "model: interpolation: onnx needs the network's file"),
        ({"interpolation": "onnx", "model": ""}, "model: interpolation: onnx needs"),
        ({"model": "a.onnx"}, "model: linear interpolation asks no network"),
    ],
)
def test_keys_that_do_not_go_together(options, why):
    with pytest.raises(ConfigError, match=why):
        Config(sampling=Sampling(**options))

"""What the experiment with frozen networks measures, with a few lines in place of FireNet."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from experiments import frozen, judge
from experiments.judge import likeness, similarity
from experiments.recordings import read
from experiments.simulators import Pixel
from networks.firenet import NETWORKS, Network, firenet
from written_recordings import write_recording

from adv2e import simulate
from adv2e.config import load_config
from adv2e.errors import DataError
from adv2e.events import make_events

WIDTH, HEIGHT, FRAMES = 24, 16, 9
TIMES = np.arange(FRAMES) * 0.02
WEIGHTS_NEEDED = "needs PyTorch"


def moving_edge_beside_a_wall():
    x = np.arange(WIDTH)[None, None] - 4 * np.arange(FRAMES)[:, None, None] % 12
    frames = np.where((x > 0) & (x < 6), 200, 60) * np.ones((1, HEIGHT, 1))
    frames[:, :, 12:] = 30
    frames[:, :, 18:] = 5
    return frames.astype(np.uint8)


def events_of(config):
    return np.concatenate(list(simulate(moving_edge_beside_a_wall(), TIMES, config, threads=1)))


CAMERA = load_config(
    ["ideal"],
    ["frames.encoding=linear", "pixel.thresholds.on=0.3", "pixel.thresholds.off=0.25"],
)


@pytest.fixture
def recording(tmp_path):
    frames = moving_edge_beside_a_wall()
    return read(str(write_recording(tmp_path / "edge", TIMES, frames, events_of(CAMERA))))


class Counts:
    """In place of a network: the image is grey, darker and brighter where events were."""

    name = "FireNet"

    def images(self, windows, size):
        return np.array([self.image(one, size) for one in windows])

    @staticmethod
    def image(events, size):
        image = np.full(size[::-1], 0.5, np.float32)
        np.add.at(image, (events["y"], events["x"]), np.where(events["p"], 0.1, -0.1))
        return np.clip(image, 0, 1)


def test_similarity_is_that_of_its_definition():
    assert similarity(np.full((20, 30), 0.5), np.full((20, 30), 0.5)) == 1.0
    apart = similarity(np.full((20, 30), 0.5), np.full((20, 30), 0.6))
    assert apart == pytest.approx((2 * 0.5 * 0.6 + 1e-4) / (0.5**2 + 0.6**2 + 1e-4))
    noise = np.random.default_rng(0).random((2, 40, 50))
    assert similarity(*noise) == pytest.approx(similarity(*noise[::-1]))
    assert similarity(*noise) < 0.2
    assert similarity(noise[0], 1 - noise[0]) < 0


def test_likeness_is_blind_to_gain():
    frame = np.random.default_rng(0).random((10, 12)) * 200
    assert likeness(0.1 + 0.1 * np.log(frame + 5), frame) == pytest.approx(1)
    assert likeness(-np.log(frame + 5), frame) == pytest.approx(-1)


def test_the_camera_itself_is_judged_near_and_others_behind_it(recording):
    one = judge.Judge(recording, [Counts()])
    itself = one.simulated(Pixel("camera", "", CAMERA, 1), "camera", 2)
    assert itself.values["FireNet"] == pytest.approx(1)
    assert itself.values["events"] == 1
    assert itself.values["distance"] == pytest.approx(0, abs=1e-6)
    noise = ["pixel.shot_noise.rate_hz=100", "pixel.thresholds.on=0.6"]
    noisy = one.simulated(Pixel("noisy", "", load_config(CAMERA, noise), 1), "noisy", 2)
    measured = one.of_the_camera()
    behind = one.behind(noisy, itself, measured)
    assert {"FireNet", "distance", "ON share", "dark ON", "bright OFF"} <= set(behind)
    assert one.behind(itself, noisy, measured) == []
    assert one.nothing.values["FireNet"] < one.half.values["FireNet"] < 1


def test_still_pixels_are_told_of_by_their_light(recording):
    one = judge.Judge(recording, [Counts()])
    assert set(one.still.parts) == {"dark", "bright"}
    assert one.still.parts["dark"][:, 18:].any()
    assert not one.still.parts["dark"][:, :18].any()
    inside = np.argwhere(one.still.parts["dark"])[0]
    there = make_events(t=[1], x=[inside[1]], y=[inside[0]], p=[0])
    counts = one.still.counts(there)
    assert counts["dark OFF"] == 1
    assert sum(counts.values()) == 1
    pixels = np.count_nonzero(one.still.parts["dark"])
    assert one.still.exposure("dark OFF") == pytest.approx(pixels * one.test.duration_s)


def test_few_events_of_still_pixels_count_little():
    measured = judge.Row("measured", {"dark ON": 0.0}, {}, {})
    few = judge.Row("few", {"dark ON": 0.02}, {}, {})
    assert few.error(measured, "dark ON", 10.0) < 0.2 < few.error(measured, "dark ON", 1e4)


def test_a_table_has_a_row_for_each_configuration_and_what_to_go_by(recording):
    one = judge.Judge(recording, [Counts()])
    configs = {name: load_config([name]) for name in ("ideal", "v2e")}
    rows = [one.simulated(Pixel(name, "", of, 1), name, 2) for name, of in configs.items()]
    text, numbers = frozen.section(one, rows)
    lines = [line.split(" | ") for line in text.splitlines()]
    labels = [line[0].strip("| ") for line in lines[2:]]
    assert labels == [
        "ideal", "v2e", "measured", "half of the measured events",
        "measured, times jittered by 2 ms", "no events at all",
    ]  # fmt: skip
    assert {len(line) for line in lines} == {9}
    assert numbers["v2e"]["behind"]
    assert frozen.picture([one.of_the_camera(), *rows])[:HEIGHT].shape == (HEIGHT, 3 * WIDTH)


def test_images_that_do_not_resemble_the_frames_are_an_error(recording):
    class Mirrored(Counts):
        def images(self, windows, size):
            frames = moving_edge_beside_a_wall()[-len(list(windows)) :, :, ::-1]
            return frames.astype(np.float32) / 255

    with pytest.raises(DataError, match="are these its weights"):
        list(judge.Judge(recording, [Mirrored()]).loaded())


def test_without_pytorch_one_line_says_so(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "torch", None)
    result = CliRunner().invoke(frozen.main, [str(tmp_path), str(tmp_path)])
    assert result.exit_code == 1
    assert "adv2e[experiments]" in result.stderr
    assert len(result.stderr.splitlines()) == 1


def checkpoint(folder, name, state):
    torch = pytest.importorskip("torch", reason=WEIGHTS_NEEDED)
    torch.save({"state_dict": state}, folder / NETWORKS[name])


def of_chance():
    torch = pytest.importorskip("torch", reason=WEIGHTS_NEEDED)
    torch.manual_seed(0)
    state = firenet().state_dict()
    state["pred.bias"] += 0.5  # so that images are grey, not clipped
    return state


PARTS = {
    "head.": "net.head.conv.conv2d.", "G1.": "net.head.recurrent_block.",
    "R1.": "net.resblocks.0.conv.", "G2.": "net.resblocks.0.recurrent_block.",
    "R2.": "net.resblocks.1.", "pred.": "net.pred.conv2d.",
}  # fmt: skip


def test_both_ways_to_name_the_layers_give_the_same_net(tmp_path):
    state = of_chance()
    begins = {key: key[: key.index(".") + 1] for key in state}
    checkpoint(tmp_path, "FireNet", {PARTS[b] + k[len(b) :]: state[k] for k, b in begins.items()})
    checkpoint(tmp_path, "FireNet+", state)
    events = events_of(CAMERA)
    size = WIDTH, HEIGHT
    first, second = (Network(name, tmp_path) for name in NETWORKS)
    first.grid = second.grid
    made = first.images([events[:50], events[50:]], size)
    assert np.array_equal(made, second.images([events[:50], events[50:]], size))
    assert not np.array_equal(made[0], made[1])
    assert made.shape == (2, HEIGHT, WIDTH)


def test_weights_of_another_net_are_an_error(tmp_path):
    state = of_chance()
    checkpoint(tmp_path, "FireNet+", {key: state[key] for key in list(state)[1:]})
    with pytest.raises(DataError, match="not the weights of FireNet"):
        Network("FireNet+", tmp_path)


@pytest.mark.parametrize("raw", [b"something else", b"", b"\x80\x02]q\x00."])
def test_a_file_without_weights_is_an_error(raw, tmp_path):
    checkpoint(tmp_path, "FireNet", of_chance())
    (path,) = tmp_path.iterdir()
    path.write_bytes(raw)
    with pytest.raises(DataError, match=r"no checkpoint of PyTorch \("):
        Network("FireNet", tmp_path)


def test_firenet_sees_no_gain_of_the_events(tmp_path):
    state = of_chance()
    for name in NETWORKS:
        checkpoint(tmp_path, name, state)
    events = events_of(CAMERA)
    double = np.sort(np.concatenate([events, events]), order="t")
    first, second = (Network(name, tmp_path) for name in NETWORKS)
    size = WIDTH, HEIGHT
    assert np.allclose(first.grid(events, size), first.grid(double, size), atol=1e-6)
    assert np.allclose(2 * second.grid(events, size), second.grid(double, size))


def test_floors_are_between_seeds(recording):
    one = judge.Judge(recording, [Counts()])
    pixel = replace(CAMERA.pixel, initial_reference="random")
    random = one.simulated(Pixel("random", "", replace(CAMERA, pixel=pixel), 1), "random", 2)
    assert random.floors["distance"] > 0
    assert random.floors["FireNet"] < 1


def test_jittered_times_are_far_as_events_and_near_as_counts(recording):
    one = judge.Judge(recording, [Counts()])
    jittered = one.jittered
    assert 0.1 < jittered.values["distance"] < 1.5
    assert jittered.values["FireNet"] > one.nothing.values["FireNet"]

"""Sensor and crop from the command line to the file: sizes, light, stored frames, errors."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

import adv2e as package
from adv2e import read_events, simulate
from adv2e.config import load_config
from adv2e.diagnosis.data.evidence import read_evidence
from adv2e.effects.frames.encoding import LightDecoder
from adv2e.light.sensor import fitting_of

GREY = np.random.default_rng(5).integers(0, 256, (4, 18, 32), np.uint8)
COLOUR = np.random.default_rng(6).integers(0, 256, (4, 18, 32, 3), np.uint8)
LIGHT = ("--set", "frames.encoding=linear")


@pytest.fixture
def clip(tmp_path):
    np.save(tmp_path / "clip.npy", GREY)
    return tmp_path / "clip.npy"


def simulated(frames, *sets):
    config = load_config([], [LIGHT[1], *sets])
    return np.concatenate(list(simulate(frames, 100, config, threads=1)))


@pytest.mark.parametrize("level", ["sampling.L=10", "sampling.L=1"])
def test_events_are_those_of_the_light_on_the_sensor(adv2e, clip, tmp_path, level):
    """With one frame an interval, too: unscaled ones would go to the kernel as they are."""
    output = tmp_path / "a.h5"
    words = ["--fps", 100, "--size", "8x6", *LIGHT, "--set", level]
    outcome = adv2e("convert", clip, "-o", output, *words)
    assert outcome.status == 0
    recording = read_events(output)
    assert (recording.width, recording.height) == (8, 6)
    seen = fitting_of(32, 18, load_config([], ["sensor={width: 8, height: 6}"]).sensor, "")
    light = [seen.light(frame.astype(np.float32), "") for frame in GREY]
    expected = simulated(light, level, "frames.full_scale=255")
    assert recording.events.tobytes() == expected.tobytes()
    assert simulated(GREY, level, "sensor={width: 8, height: 6}").tobytes() == expected.tobytes()


def test_what_is_done_is_printed_and_else_nothing(adv2e, clip, tmp_path):
    said = adv2e("convert", clip, "--fps", 100, "--size", "8x6", "-o", tmp_path / "a.h5").err
    assert "frames are 32x18, scaled to 11x6 and cut to 8x6\n" in said
    for number, words in enumerate([[], ["--size", "32x18"]]):
        output = tmp_path / f"{number}.h5"
        said = adv2e("convert", clip, "--fps", 100, *words, "-o", output).err
        assert said.count("frames are ") == 1  # which light they are


def test_size_leaves_the_fit_that_was_said(adv2e, clip, tmp_path):
    (tmp_path / "pad.yaml").write_text("sensor: {fit: pad}\n")
    ways = [["-c", tmp_path / "pad.yaml"], ["--set", "sensor.fit=pad"]]
    for number, words in enumerate(ways):
        output = tmp_path / f"{number}.h5"
        said = adv2e("convert", clip, "--fps", 100, "--size", "8x6", *words, "-o", output).err
        assert "frames are 32x18, scaled to 8x4, the rest of 8x6 is black\n" in said
        config = read_events(output).metadata["config"]
        assert config["sensor"] == {"width": 8, "height": 6, "fit": "pad"}
    over = ["--size", "8x6", "--set", "sensor=null"]
    assert adv2e("convert", clip, "--fps", 100, *over, "-o", tmp_path / "c.h5").status == 0
    assert read_events(tmp_path / "c.h5").width == 8


def test_crop_comes_before_the_sensor(adv2e, clip, tmp_path):
    words = ["--fps", 100, "--crop", "3,2,12,9", "--size", "4x3", *LIGHT]
    said = adv2e("convert", clip, *words, "-o", tmp_path / "a.zip").err
    assert "frames are 12x9 at x 3, y 2 of the input's, scaled to 4x3\n" in said
    part = GREY[:, 2:11, 3:15]
    expected = simulated(part, "sensor={width: 4, height: 3}")
    recording = read_events(tmp_path / "a.zip")
    assert recording.events.tobytes() == expected.tobytes()
    stored = [frame.image for frame in recording.frames()]
    means = part.reshape(4, 3, 3, 4, 3).mean(axis=(2, 4))
    np.testing.assert_allclose(stored, means, atol=0.5001)


def test_what_lies_outside_the_crop_does_not_matter(adv2e, tmp_path):
    frames = (GREY / 255).astype(np.float32)
    frames[:, :2], frames[:, -3:] = np.nan, -1
    np.save(tmp_path / "clip.npy", frames)
    words = ["convert", tmp_path / "clip.npy", "--fps", 100, "-o", tmp_path / "a.h5"]
    assert adv2e(*words).status == 1
    assert adv2e(*words, "--crop", "0,2,32,13").status == 0
    recording = read_events(tmp_path / "a.h5")
    assert recording.events.tobytes() == simulated(frames[:, 2:15]).tobytes()
    assert recording.metadata["source"]["crop"] == [0, 2, 32, 13]
    assert (recording.width, recording.height) == (32, 13)


def test_crop_of_images_with_transparent_pixels(adv2e, tmp_path):
    (tmp_path / "frames").mkdir()
    alpha = np.full((18, 32, 1), 128, np.uint8)
    for number, frame in enumerate(COLOUR):
        assert cv2.imwrite(str(tmp_path / f"frames/{number}.png"), np.dstack([frame, alpha]))
    words = ["convert", tmp_path / "frames", "--fps", 100, "--with-frames"]
    assert adv2e(*words, "-o", tmp_path / "all.h5").status == 0
    assert adv2e(*words, "-o", tmp_path / "part.h5", "--crop", "4,3,8,6").status == 0
    whole, part = (read_events(tmp_path / name) for name in ("all.h5", "part.h5"))
    for all_of_it, cut in zip(whole.frames(), part.frames(), strict=True):
        np.testing.assert_array_equal(all_of_it.image[3:9, 4:12], cut.image)
    halved = adv2e(*words, "-o", tmp_path / "half.h5", "--size", "16x9")
    assert halved.status == 0
    seen = next(read_events(tmp_path / "half.h5").frames()).image
    first = next(whole.frames()).image
    decoder = LightDecoder("srgb", 255.0, np.uint8, True)
    expected = decoder.decode(first).reshape(9, 2, 16, 2).mean(axis=(1, 3))
    np.testing.assert_allclose(decoder.decode(seen), expected, atol=2.5)


def test_crop_alone_leaves_the_numbers_as_they_are(adv2e, clip, tmp_path):
    words = ["--fps", 100, "--crop", "3,2,12,9", *LIGHT]
    outcome = adv2e("convert", clip, *words, "-o", tmp_path / "a.zip")
    assert outcome.status == 0
    recording = read_events(tmp_path / "a.zip")
    assert recording.events.tobytes() == simulated(GREY[:, 2:11, 3:15]).tobytes()
    stored = [frame.image for frame in recording.frames()]
    np.testing.assert_array_equal(stored, GREY[:, 2:11, 3:15])


@pytest.mark.parametrize(
    ("frames", "name", "encoding"),
    [
        (COLOUR, "a.zip", "srgb"),
        (COLOUR, "a.h5", "linear"),
        (COLOUR.astype(np.uint16) * 257, "a.h5", "srgb"),  # stored in 8 bits
        (COLOUR / 255, "a.zip", "srgb"),  # stored in 16 bits
        (GREY, "a.h5", "srgb"),
        ((GREY / 255).astype(np.float32), "a.zip", "linear"),
    ],
    ids=["colour", "linear colour", "deep colour", "float colour", "grey", "float grey"],
)
@pytest.mark.quick_cases(1)
def test_stored_frames_are_the_light_on_the_sensor(adv2e, tmp_path, frames, name, encoding):
    np.save(tmp_path / "clip.npy", frames)
    words = ["--fps", 100, "--size", "8x6", "--set", f"frames.encoding={encoding}", "--with-frames"]
    assert adv2e("convert", tmp_path / "clip.npy", "-o", tmp_path / name, *words).status == 0
    recording = read_events(tmp_path / name)
    decoder = LightDecoder(
        encoding,
        255.0 if frames.dtype == np.uint8 else 65535.0 if frames.dtype == np.uint16 else 1.0,
        frames.dtype,
        frames.ndim == 4,
    )
    seen = fitting_of(32, 18, load_config([], ["sensor={width: 8, height: 6}"]).sensor, "")
    for stored, given in zip(recording.frames(), frames, strict=True):
        light = seen.light(decoder.decode(given), "")
        again = LightDecoder(
            recording.encoding, stored.white or 0, stored.image.dtype, stored.image.ndim == 3
        ).decode(stored.image)
        assert again.shape == (6, 8)
        steps = {np.dtype(np.uint8): 255, np.dtype(np.uint16): 65535}[stored.image.dtype]
        # half a step, where the curve of sRGB is steepest
        np.testing.assert_allclose(again, light, atol=0.51 * 2.28 * 255 / steps)


def test_what_comes_out_is_one_recording_of_that_sensor(adv2e, clip, tmp_path):
    """As diagnosis and comparison read it, with the configuration that made it."""
    words = [
        "--fps",
        100,
        "--size",
        "16x12",
        "--set",
        "frames.encoding=srgb",
        "--set",
        "pixel.leak=null",
    ]
    first, second = tmp_path / "a.zip", tmp_path / "b.h5"
    assert adv2e("convert", clip, "-o", first, *words).status == 0
    assert adv2e("convert", clip, "-o", second, *words, "--with-frames", "--seed", 1).status == 0
    declared = load_config([], ["sensor={width: 16, height: 12}"])
    for path in (first, second):
        evidence = read_evidence(path, sensor=declared.sensor)
        assert (evidence.width, evidence.height) == (16, 12)
        assert next(evidence.lights(declared)).shape == (12, 16)
    words = ["--set", "sensor={width: 16, height: 12}", "--set", "pixel.leak=null", "--json"]
    report = json.loads(adv2e("compare", first, second, *words).out)
    errors = report["measures"]["relative_5_bins"]
    # as far from each other as two simulations from the frames stored
    assert errors["value"] < 2 * errors["floor"]["two_seeds"]


def test_the_preview_has_the_size_of_the_sensor(adv2e, clip, tmp_path):
    words = ["--fps", 100, "-o", tmp_path / "a.h5", "--preview", tmp_path / "a.png"]
    assert adv2e("convert", clip, *words, "--size", "16x12").status == 0
    resized = cv2.imread(str(tmp_path / "a.png"))
    np.save(tmp_path / "small.npy", GREY[:, :12, :16])
    words = ["--fps", 100, "-o", tmp_path / "b.h5", "--preview", tmp_path / "b.png"]
    assert adv2e("convert", tmp_path / "small.npy", *words).status == 0
    assert resized.shape == cv2.imread(str(tmp_path / "b.png")).shape


@pytest.mark.parametrize(
    ("words", "status", "complaint"),
    [
        (["--size", "8"], 2, "'--size': must be columns x rows, such as 346x260, got '8'"),
        (["--size", "8x0"], 2, "must be columns x rows"),
        (["--size", "70000x2"], 2, "--size sensor.width: must be at most 65536 px, got 70000"),
        (["--size", "60000x60000"], 2, "sensor.width: 60000x60000 are 3,600,000,000 pixels"),
        (["--set", "sensor.width=8"], 2, "--set sensor.height: must be given"),
        (["--set", "sensor.height=8"], 2, "--set sensor.width: must be given"),
        (["--set", "sensor={width: 8, height: 6, fit: fill}"], 2, "crop, pad, stretch, none"),
        (["--crop", "1,2,3"], 2, "'--crop': must be first column, first row, columns, rows"),
        (["--crop", "30,0,3,3"], 1, "frame 0: --crop 30,0,3,3 is not inside its 32x18 pixels"),
        (["--size", "8x6", "--set", "sensor.fit=none"], 1, "frames are 32x18, but the sensor is"),
    ],
)
def test_what_cannot_be_is_one_line(adv2e, clip, tmp_path, words, status, complaint):
    outcome = adv2e("convert", clip, "--fps", 100, *words, "-o", tmp_path / "a.h5")
    assert outcome.status == status
    assert complaint in outcome.err
    assert outcome.err.count("\n") == 1
    assert not (tmp_path / "a.h5").exists()


def test_in_python_sizes_are_text_or_numbers(clip, tmp_path):
    linear = load_config([], LIGHT[1])
    made = [
        package.convert(clip, tmp_path / f"{n}.h5", linear, fps=100, size=size, crop=crop)
        for n, (size, crop) in enumerate([("8x6", "0,0,32,16"), ((8, 6), (0, 0, 32, 16))])
    ]
    assert [(one.width, one.height) for one in made] == [(8, 6)] * 2
    assert made[0].events == made[1].events > 0
    assert (
        "frames are 32x16 at x 0, y 0 of the input's, scaled to 12x6 and cut to 8x6"
        in made[0].notes
    )
    for wrong in ({"size": (8, 6, 3)}, {"size": "8"}, {"crop": (1, 2, 3)}):
        with pytest.raises(package.errors.UsageError, match="must be"):
            package.convert(clip, tmp_path / "c.h5", fps=100, **wrong)


def test_the_widest_sensor_has_all_its_columns():
    frames = np.array([[[10, 200]], [[200, 10]], [[10, 200]]], np.uint8)
    events = simulated(frames, "sensor={width: 65536, height: 1, fit: stretch}", "sampling.L=1")
    assert (events["x"].min(), events["x"].max()) == (0, 65535)


def test_frames_of_one_size_in_a_simulation():
    for frames in (GREY, COLOUR):
        events = simulated(frames, "sensor={width: 8, height: 6}")
        assert (events["x"].max(), events["y"].max()) == (7, 5)


@pytest.mark.parametrize("fit", ["crop", "pad", "stretch"])
@pytest.mark.parametrize("cut", [(), ("--crop", "8,4,40,36"), ("--rotate180",)])
@pytest.mark.quick_cases(1)
def test_files_say_where_a_point_of_the_frames_lies_on_the_sensor(adv2e, tmp_path, fit, cut):
    frames = np.zeros((3, 48, 64), np.float32)
    frames[:, 20:28, 24:32] = 1  # its middle is column 28, row 24
    np.save(tmp_path / "clip.npy", frames)
    words = ["convert", tmp_path / "clip.npy", "--fps", 100, "--size", "20x16", *cut]
    words += ["--set", f"sensor.fit={fit}", "--with-frames", "-o", tmp_path / "a.h5"]
    assert adv2e(*words).status == 0
    recording = read_events(tmp_path / "a.h5")
    source = recording.metadata["source"]
    assert source["size"] == [64, 48]
    point = np.array([28.0, 24.0])
    if source.get("rotate180"):
        point = np.array(source["size"]) - point
    point -= source.get("crop", [0, 0])[:2]
    expected = np.array(source["sensor"]["scale"]) * (point - source["sensor"]["origin"])
    image = next(recording.frames()).image.astype(float)
    rows, columns = np.indices(image.shape) + 0.5
    found = np.array([(columns * image).sum(), (rows * image).sum()]) / image.sum()
    np.testing.assert_allclose(found, expected, atol=0.1)  # stored with 8 bits
    (made_of,) = [
        line for line in adv2e("info", tmp_path / "a.h5").out.splitlines() if "made of" in line
    ]
    assert "frames of 64x48" in made_of
    assert source["sensor"]["text"] in made_of

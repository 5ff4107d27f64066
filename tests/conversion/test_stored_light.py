"""Frames stored beside events are read back with the light that they were written with."""

import json
import re
import zipfile

import cv2
import numpy as np
import pytest

from adv2e.comparison.resimulation import resimulator
from adv2e.config import load_config
from adv2e.diagnosis.data.evidence import read_evidence
from adv2e.formats.reading import read_events
from adv2e.light.decoding import decoder_for
from adv2e.sources import open_source

QUIET = ("--set", "pixel.shot_noise=null", "--set", "pixel.leak=null")
TIMES = np.arange(6) / 25


def moving(most, kind, colour=False):
    """Return a bright bar that crosses a ramp, in whole numbers up to `most` or in floats."""
    ramp = np.tile(np.linspace(0.1, 0.9, 32), (24, 1))
    frames = np.stack([ramp.copy() for _ in TIMES])
    for k, frame in enumerate(frames):
        frame[:, 4 * k : 4 * k + 6] = 1 - frame[:, 4 * k : 4 * k + 6]
    frames = (frames * most).astype(kind)
    return np.stack([frames, frames // 2, frames // 3], -1) if colour else frames


def save(path, frames):
    np.save(path, frames)
    np.save(path.with_name(f"{path.stem}_ts.npy"), TIMES)
    return path


@pytest.fixture
def made(tmp_path, write_video, write_images):
    """Make an input by name; return its path and what its conversion needs to be told."""

    def make(name):
        if name == "colour video":
            return write_video("a.avi", list(moving(255, np.uint8, colour=True))), ()
        if name == "grey video":
            return write_video("a.avi", list(moving(255, np.uint8))), ()
        if name == "16 bit images":
            return write_images(list(moving(65535, np.uint16))), ("--fps", "25")
        if name == "12 bits in 16":
            return save(tmp_path / "a.npy", moving(4095, np.uint16)), SET_12
        if name == "gamma":
            gamma = ("--set", "frames.encoding=gamma:2.2")
            return save(tmp_path / "a.npy", moving(255, np.uint8)), gamma
        return save(tmp_path / "a.npy", moving(100, np.uint8)), (*SET_100, "--set", SRGB)

    return make


SRGB = "frames.encoding=srgb"
SET_12 = ("--set", "frames.full_scale=4095")
SET_100 = ("--set", "frames.full_scale=100")
INPUTS = ["colour video", "grey video", "16 bit images", "12 bits in 16", "gamma", "white of 100"]


@pytest.fixture
def write_video(tmp_path):
    def write(name, frames):
        path = str(tmp_path / name)
        colour = frames[0].ndim == 3
        code = cv2.VideoWriter.fourcc(*"FFV1")
        writer = cv2.VideoWriter(path, cv2.CAP_FFMPEG, code, 25, (32, 24), colour)
        for frame in frames:
            writer.write(frame)
        writer.release()
        return tmp_path / name

    return write


@pytest.fixture
def write_images(tmp_path):
    def write(frames):
        folder = tmp_path / "frames"
        folder.mkdir()
        for number, frame in enumerate(frames):
            cv2.imwrite(str(folder / f"{number}.png"), frame)
        return folder

    return write


@pytest.mark.parametrize("name", INPUTS)
@pytest.mark.parametrize("layout", ["rec.zip", "rec"])
@pytest.mark.quick_cases(1)
def test_converted_again_a_recording_gives_the_same_events(adv2e, made, tmp_path, name, layout):
    source, told = made(name)
    outcome = adv2e("convert", source, *told, *QUIET, "-o", tmp_path / layout)
    assert outcome.status == 0, outcome.err
    assert adv2e("convert", tmp_path / layout, *QUIET, "-o", tmp_path / "again.h5").status == 0
    first, again = read_events(tmp_path / layout), read_events(tmp_path / "again.h5")
    assert first.events.size > 1000
    assert again.events.tobytes() == first.events.tobytes()
    # one simulation more, as comparisons make it
    size = first.width, first.height
    simulate = resimulator(first.frames, load_config([], QUIET[1::2]), first.encoding, size)
    assert simulate(0).tobytes() == first.events.tobytes()


@pytest.mark.parametrize("name", INPUTS)
@pytest.mark.quick_cases(1)
def test_frames_in_hdf5_have_the_light_that_they_had_but_for_8_bits(adv2e, made, tmp_path, name):
    source, told = made(name)
    output = tmp_path / "rec.h5"
    assert adv2e("convert", source, *told, *QUIET, "--with-frames", "-o", output).status == 0
    stored = read_events(output)
    config = load_config([], [word for word in told if "=" in word])
    opened = open_source(source, fps=25 if "--fps" in told else None)
    decoder = decoder_for(
        config.frames, opened.dtype, opened.colour, auto=opened.encoding, white=opened.full_scale
    )
    for frame, kept in zip(opened.frames(), stored.frames(), strict=True):
        image = kept.image
        again = decoder_for(
            load_config([], []).frames, image.dtype, image.ndim == 3, auto=stored.encoding,
            white=kept.white,
        )  # fmt: skip
        assert image.dtype == np.uint8
        light, expected = again.decode(image), decoder.decode(frame.image)
        assert np.abs(light - expected).max() < 1.3  # of 255: a step of 8 bits, or half of one


def test_floats_are_stored_with_a_white_of_their_own(adv2e, tmp_path):
    source = save(tmp_path / "a.npy", moving(255, np.float32))
    adv2e("convert", source, "--set", "frames.full_scale=255", *QUIET, "-o", tmp_path / "a.zip")
    adv2e("convert", tmp_path / "a.zip", *QUIET, "-o", tmp_path / "b.h5")
    first, again = read_events(tmp_path / "a.zip"), read_events(tmp_path / "b.h5")
    assert first.metadata["source"]["full_scale"] == 255
    assert first.metadata["frames"] == {"encoding": "linear", "full_scale": 65535}
    assert abs(again.events.size - first.events.size) < 0.01 * first.events.size


def test_a_diagnosis_and_a_picture_see_the_white_that_was_said(adv2e, tmp_path):
    source = save(tmp_path / "a.npy", moving(4095, np.uint16))
    adv2e(
        "convert", source, *SET_12, *QUIET, "-o", tmp_path / "rec", "--preview", tmp_path / "a.png"
    )
    assert read_evidence(tmp_path / "rec").white == 4095
    adv2e("render", tmp_path / "rec", "-o", tmp_path / "b.png")
    for name in ("a.png", "b.png"):
        assert cv2.imread(str(tmp_path / name)).max() > 200


def test_the_folder_of_the_images_alone_has_the_light_of_its_recording(adv2e, made, tmp_path):
    source, _ = made("grey video")
    adv2e("convert", source, *QUIET, "-o", tmp_path / "rec")
    assert open_source(tmp_path / "rec" / "images").encoding == "srgb"


def test_recordings_written_before_that_was_stored_tell_the_encoding(adv2e, made, tmp_path):
    source, _ = made("grey video")
    adv2e("convert", source, *QUIET, "-o", tmp_path / "rec")
    file = tmp_path / "rec" / "adv2e.json"
    description = json.loads(file.read_text())
    del description["frames"]
    file.write_text(json.dumps(description))
    assert open_source(tmp_path / "rec").encoding == "srgb"
    assert read_events(tmp_path / "rec").encoding == "srgb"


@pytest.mark.parametrize(
    ("stated", "message"),
    [
        ({"encoding": "srbg"}, r"frames\.encoding: must be auto, linear"),
        ({"encoding": "auto"}, r"frames\.encoding: must be linear"),
        ({"encoding": 3}, r"frames\.encoding: must be linear"),
        ({"encoding": "srgb", "full_scale": -1}, r"frames\.full_scale: must be a number above 0"),
        ({"encoding": "srgb", "full_scale": "white"}, r"frames\.full_scale: must be a number"),
    ],
)
def test_what_cannot_be_is_named(adv2e, made, tmp_path, stated, message):
    source, _ = made("grey video")
    adv2e("convert", source, *QUIET, "-o", tmp_path / "rec.zip")
    with zipfile.ZipFile(tmp_path / "rec.zip") as archive:
        kept = {name: archive.read(name) for name in archive.namelist()}
    kept["adv2e.json"] = json.dumps({"frames": stated}).encode()
    with zipfile.ZipFile(tmp_path / "rec.zip", "w") as archive:
        for name, data in kept.items():
            archive.writestr(name, data)
    outcome = adv2e("convert", tmp_path / "rec.zip", "-o", tmp_path / "b.h5")
    assert outcome.status == 1
    assert re.search(r"rec\.zip: adv2e\.json: " + message, outcome.err)
    assert outcome.err.count("\n") == 1

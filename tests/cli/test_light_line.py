"""Which light a source is taken for is said by every conversion and by ``info``."""

import json

import cv2
import numpy as np
import pytest

from adv2e.formats.reading import read_events

TAKEN = "frames are "

FRAMES = np.arange(6 * 24 * 32).reshape(6, 24, 32) % 251
COLOUR = np.repeat(FRAMES[..., np.newaxis], 3, axis=-1)


def write_images(folder, frames):
    (folder / "images").mkdir(parents=True)
    for number, frame in enumerate(frames):
        cv2.imwrite(str(folder / "images" / f"{number}.png"), frame)
    return folder / "images"


def write_recording(folder, frames):
    write_images(folder, frames)
    lines = [f"{number / 10} images/{number}.png\n" for number in range(len(frames))]
    (folder / "images.txt").write_text("".join(lines))
    return folder


def write_stack(folder, frames):
    folder.mkdir()
    np.save(folder / "stack.npy", frames)
    return folder / "stack.npy"


def write_video(folder, frames):
    folder.mkdir()
    code = cv2.VideoWriter.fourcc(*"FFV1")
    writer = cv2.VideoWriter(str(folder / "a.avi"), cv2.CAP_FFMPEG, code, 10, (32, 24))
    for frame in frames:
        writer.write(frame)
    writer.release()
    return folder / "a.avi"


SOURCES = {
    "video": (write_video, COLOUR.astype(np.uint8), "srgb, white 255 ("),
    "colour images": (
        write_images,
        COLOUR.astype(np.uint8),
        "srgb, white 255 (8-bit colour images; frames.encoding changes it)",
    ),
    "grey images": (
        write_images,
        FRAMES.astype(np.uint8),
        "srgb, white 255 (8-bit grey images; frames.encoding changes it)",
    ),
    "deep images": (
        write_images,
        (FRAMES * 257).astype(np.uint16),
        "linear, white 65535 (16-bit grey images; frames.encoding changes it)",
    ),
    "recording": (
        write_recording,
        FRAMES.astype(np.uint8),
        "linear, white 255 (frames of a recording; frames.encoding changes it)",
    ),
    "stack": (
        write_stack,
        FRAMES.astype(np.uint8),
        "srgb, white 255 (8-bit grey images; frames.encoding changes it)",
    ),
}


@pytest.mark.parametrize("name", SOURCES)
def test_every_source_says_its_light_and_the_key_that_changes_it(adv2e, tmp_path, name):
    write, frames, expected = SOURCES[name]
    source, output = write(tmp_path / "in", frames), tmp_path / "out.h5"
    times = () if name in ("video", "recording") else ("--fps", "10")
    outcome = adv2e("convert", source, *times, "-o", output)
    lines = [line for line in outcome.err.splitlines() if line.startswith(TAKEN)]
    assert len(lines) == 1
    assert expected in lines[0]
    assert "frames.encoding" in lines[0]
    assert len(lines[0]) <= 100
    assert read_events(output).metadata["source"]["light"] == lines[0].removeprefix(TAKEN)
    report = json.loads(adv2e("info", source, *times, "--json").out)["frames"]
    assert expected in report["light"]
    assert expected.startswith(f"{report['encoding']}, white {report['full_scale']:g}")
    assert expected in adv2e("info", source, *times).out
    assert adv2e("convert", source, *times, "-o", output, "--overwrite", "-q").err == ""


def test_what_the_configuration_says_is_told_as_such(adv2e, tmp_path):
    source = write_stack(tmp_path / "in", (FRAMES * 16).astype(np.uint16))
    keys = ("--set", "frames.encoding=gamma:2.2", "--set", "frames.full_scale=4095")
    outcome = adv2e("convert", source, "--fps", "10", *keys, "-o", tmp_path / "out.h5")
    line = "gamma:2.2, white 4095 (as frames.encoding says; white as frames.full_scale says)"
    assert outcome.err.splitlines() == [f"{TAKEN}{line}"]


def test_our_own_recordings_say_it_too(adv2e, tmp_path):
    source = write_video(tmp_path / "in", COLOUR.astype(np.uint8))
    adv2e("convert", source, "-o", tmp_path / "rec.zip")
    line = "srgb, white 255 (as adv2e stored them; frames.encoding changes it)"
    assert line in adv2e("info", tmp_path / "rec.zip").out
    assert line in adv2e("convert", tmp_path / "rec.zip", "-o", tmp_path / "b.h5").err

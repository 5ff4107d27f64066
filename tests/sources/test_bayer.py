"""Mosaics become colour, each of the four patterns as it says."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from adv2e.errors import DataError, UsageError
from adv2e.options import BAYER
from adv2e.sources import open_source

ROWS, COLUMNS = np.mgrid[:12, :16]
SCENE = np.stack([10 + 3 * COLUMNS, 120 + 5 * ROWS, 240 - 2 * COLUMNS - 4 * ROWS], -1)
"""Red, green and blue that rise along other ways, so that interpolation between is exact."""


def mosaic(pattern, dtype=np.uint8, scale=1):
    """Return what a sensor sees of the scene through a filter of this pattern."""
    channel = np.array(["RGB".index(colour) for colour in pattern]).reshape(2, 2)
    seen = np.take_along_axis(SCENE, channel[ROWS % 2, COLUMNS % 2][..., np.newaxis], -1)[..., 0]
    return (seen * scale).astype(dtype)


INSIDE = np.s_[1:-1, 1:-1]


def write(kind, folder, image):
    folder.mkdir(exist_ok=True)
    if kind == "npy":
        np.save(folder / "a.npy", np.stack([image] * 3))
        return folder / "a.npy"
    if kind == "tif":
        assert cv2.imwritemulti(str(folder / "a.tif"), [image] * 3)
        return folder / "a.tif"
    for number in range(3):
        assert cv2.imwrite(str(folder / f"{number}.{kind}"), image)
    return folder


@pytest.mark.parametrize("pattern", BAYER)
@pytest.mark.parametrize(("dtype", "scale"), [(np.uint8, 1), (np.uint16, 257)])
def test_each_pattern_gives_the_colours_of_the_scene(tmp_path, pattern, dtype, scale):
    path = write("npy", tmp_path / "a", mosaic(pattern, dtype, scale))
    source = open_source(path, fps=10, bayer=pattern)
    assert (source.colour, source.encoding, source.dtype) == (True, "linear", dtype)
    assert source.light.encoding_reason == f"a mosaic of {pattern}"
    for frame in source.frames():
        wrong = np.abs(frame.image.astype(int) - SCENE * scale)[INSIDE]
        assert wrong.max() <= 1
    for other in set(BAYER) - {pattern}:
        frame = next(open_source(path, fps=10, bayer=other).frames())
        assert np.abs(frame.image.astype(int) - SCENE * scale)[INSIDE].max() > 20 * scale


@pytest.mark.parametrize("kind", ["png", "tiff", "npy", "tif"])
def test_images_tiff_and_npy(tmp_path, kind):
    path = write(kind, tmp_path / "a", mosaic("GBRG", np.uint16, 16))
    frame = next(open_source(path, fps=10, bayer="GBRG").frames())
    assert np.abs(frame.image.astype(int) - SCENE * 16)[INSIDE].max() <= 1


def test_the_corners_are_filled(tmp_path):
    path = write("npy", tmp_path / "a", np.full((12, 16), 77, np.uint8))
    for pattern in BAYER:
        assert np.all(next(open_source(path, fps=10, bayer=pattern).frames()).image == 77)


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.zeros((8, 8, 3), np.uint8), "a mosaic has one number a pixel, this has more"),
        (np.zeros((8, 8), np.float32), "must be of uint8 or uint16, this is of float32"),
        (np.zeros((3, 8), np.uint8), "must have 4 rows and columns at least"),
    ],
)
def test_what_is_no_mosaic_is_refused(tmp_path, image, message):
    path = write("npy", tmp_path / "a", image)
    with pytest.raises(DataError, match=rf"a\.npy: frame 0: --bayer RGGB: .*{message}"):
        open_source(path, fps=10, bayer="RGGB")


def test_a_video_has_colours_already(write_video, picture):
    path = write_video("a.avi", [picture(n, (32, 32, 3)) for n in range(3)])
    with pytest.raises(DataError, match=r"a\.avi: --bayer RGGB is for images"):
        open_source(path, bayer="RGGB")


def test_patterns_that_there_are_not(tmp_path, adv2e):
    path = write("npy", tmp_path / "a", mosaic("RGGB"))
    with pytest.raises(UsageError, match="bayer: must be RGGB, BGGR, GRBG or GBRG"):
        open_source(path, fps=10, bayer="RGBG")
    assert adv2e("convert", path, "--fps", "10", "--bayer", "RGBG").status == 2


def test_the_command_line_says_what_they_were_taken_for(adv2e, tmp_path):
    path = write("png", tmp_path / "a", mosaic("GRBG"))
    options = ("--fps", "10", "--bayer", "grbg")
    report = json.loads(adv2e("info", path, *options, "--json").out)["frames"]
    light = "linear, white 255 (a mosaic of GRBG; frames.encoding changes it)"
    assert (report["light"], report["colour"]) == (light, True)
    outcome = adv2e("convert", path, *options, "-o", tmp_path / "a.h5")
    assert f"frames are {light}" in outcome.err

"""Videos are turned as their display matrix says; what is not done of it is told."""

from __future__ import annotations

import struct

import cv2
import numpy as np
import pytest

from adv2e.sources import open_source

MATRICES = {
    "upright": ((1, 0, 0, 1), lambda image: image),
    "a quarter": ((0, 1, -1, 0), lambda image: np.rot90(image, -1)),
    "a half": ((-1, 0, 0, -1), lambda image: np.rot90(image, 2)),
    "three quarters": ((0, -1, 1, 0), np.rot90),
}
"""Columns a, b, c, d of the matrix: x' = a x + c y, y' = b x + d y, y counted down."""


@pytest.fixture
def shown(tmp_path):
    """Write a video of one picture, 4 times, and the matrix by which it is to be shown."""

    def write(matrix):
        path = tmp_path / "a.mp4"
        image = np.zeros((48, 64, 3), np.uint8)
        image[:16, :16] = 255
        code = cv2.VideoWriter.fourcc(*"mp4v")
        writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, 25, (64, 48))
        for _ in range(4):
            writer.write(image)
        writer.release()
        data = bytearray(path.read_bytes())
        place = data.index(b"tkhd") + 4
        a, b, c, d = (round(65536 * value) for value in matrix)
        struct.pack_into(">5i", data, place + (52 if data[place] else 40), a, b, 0, c, d)
        path.write_bytes(data)
        return path, image

    return write


@pytest.mark.parametrize("name", MATRICES)
def test_quarter_turns_are_done(shown, name):
    matrix, turned = MATRICES[name]
    path, image = shown(matrix)
    source = open_source(path)
    expected = turned(image)
    assert (source.height, source.width) == expected.shape[:2]
    frame = next(source.frames()).image
    assert np.abs(frame.astype(int) - expected).mean() < 5
    assert source.doubts == []


@pytest.mark.parametrize(
    ("matrix", "word"),
    [
        ((-1, 0, 0, 1), "mirrored"),
        ((1, 0, 0, -1), "mirrored"),
        ((0, 1, 1, 0), "mirrored"),
        ((0.7, 0.7, -0.7, 0.7), "tilted"),
    ],
)
def test_what_is_not_done_is_told(shown, matrix, word):
    path, _ = shown(matrix)
    assert any(f"to be shown {word}" in doubt for doubt in open_source(path).doubts)

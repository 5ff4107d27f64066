from __future__ import annotations

import cv2
import numpy as np
import pytest


@pytest.fixture
def picture():
    """Make a picture of its own for every number, using the whole range of its data type."""

    def make(number, shape=(24, 32), dtype=np.uint8):
        rng = np.random.default_rng(number)
        if np.dtype(dtype).kind == "f":
            return rng.random(shape).astype(dtype)
        return rng.integers(0, np.iinfo(dtype).max + 1, shape).astype(dtype)

    return make


@pytest.fixture
def write_video(tmp_path):
    """Write RGB (or grey) frames as a video file and return its path."""

    def write(name, frames, fps=25.0, codec="FFV1"):
        path = tmp_path / name
        depth = cv2.CV_16U if frames[0].dtype == np.uint16 else cv2.CV_8U
        colour = frames[0].ndim == 3
        properties = [cv2.VIDEOWRITER_PROP_DEPTH, depth, cv2.VIDEOWRITER_PROP_IS_COLOR, int(colour)]
        size = frames[0].shape[1::-1]
        code = cv2.VideoWriter.fourcc(*codec)
        writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, fps, size, properties)
        assert writer.isOpened()
        for frame in frames:
            writer.write(frame[..., ::-1].copy() if colour else frame)
        writer.release()
        return path

    return write


@pytest.fixture
def write_images(tmp_path):
    """Write RGB or grey frames as images in a folder and return the folder."""

    def write(frames, folder="frames", name="frame_{:d}.png"):
        path = tmp_path / folder
        path.mkdir(parents=True, exist_ok=True)
        for number, frame in enumerate(frames):
            stored = frame if frame.ndim == 2 else frame[..., [2, 1, 0, 3][: frame.shape[2]]]
            # OpenCV 4 packs float colour in LogLuv unless told otherwise
            exact = [cv2.IMWRITE_TIFF_COMPRESSION, cv2.IMWRITE_TIFF_COMPRESSION_NONE]
            file = str(path / name.format(number))
            assert cv2.imwrite(file, np.ascontiguousarray(stored), exact)
        return path

    return write

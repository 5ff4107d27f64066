"""Videos that OpenCV cannot write, written by PyAV."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

av = pytest.importorskip("av", reason="PyAV writes what OpenCV does not")

COUNT = 36


def pictures(count=COUNT):
    """Return colour pictures of a pattern that moves."""
    rows, columns = np.mgrid[:48, :64]
    ramps = [(2 * rows + 3 * columns + 7 * n) % 256 for n in range(count)]
    return [np.stack([ramp] * 3, -1).astype(np.uint8) for ramp in ramps]


def written(
    path, codec, rate, *, reordered=0, numbers=None, sound=False, options=None, codec_options=None
):
    """Write pictures at a rate, at the numbers given of its ticks, and return the path."""
    with av.open(str(path), "w", container_options=options or {}) as film:
        stream = film.add_stream(codec, rate=rate)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        stream.options = codec_options or {}
        stream.codec_context.max_b_frames = reordered
        stream.codec_context.time_base = 1 / Fraction(rate)
        beside = film.add_stream("mp2", rate=48000) if sound else None
        for number, image in zip(numbers or range(COUNT), pictures(), strict=False):
            frame = av.VideoFrame.from_ndarray(image, format="rgb24")
            frame.pts, frame.time_base = number, 1 / Fraction(rate)
            film.mux(stream.encode(frame))
        film.mux(stream.encode(None))
        if beside is not None:
            for n in range(2 * 48000 // 1152):
                quiet = av.AudioFrame.from_ndarray(np.zeros((1, 2304), np.int16), layout="stereo")
                quiet.sample_rate, quiet.pts = 48000, n * 1152
                film.mux(beside.encode(quiet))
            film.mux(beside.encode(None))
    return path

"""Videos that OpenCV cannot write, written by PyAV: fields, tags, deep pixels."""

from __future__ import annotations

import numpy as np
import pytest

GREY = {"yuv420p": 2, "yuv422p": 2, "yuv444p": 1}


def write(
    path,
    lumas,
    codec="libx264",
    pixels="yuv420p",
    *,
    size=(64, 48),
    options=None,
    tags=(2, 2, 2),
    full=False,
    fields=False,
    first=0,
):
    """Write a video of flat grey pictures, given by their coded luma, or of (y, cb, cr) each.

    `tags` are the codes of ITU-T H.273 for primaries, transfer and matrix; `first` is the number of
    the first picture on the clock of the file.
    """
    av = pytest.importorskip("av", reason="PyAV writes the video")
    with av.open(str(path), "w") as file:
        stream = file.add_stream(codec, rate=25)
        stream.width, stream.height = size
        stream.pix_fmt = pixels
        stream.options = options or {}
        stream.bit_rate = 8_000_000
        context = stream.codec_context
        context.color_primaries, context.color_trc, context.colorspace = tags
        context.color_range = 2 if full else 1
        if fields:
            context.flags |= av.codec.context.Flags.interlaced_dct
            context.flags |= av.codec.context.Flags.interlaced_me
        for number, colour in enumerate(lumas):
            frame = flat(av, colour, pixels, size)
            frame.pts = first + number
            frame.color_range = context.color_range
            file.mux(stream.encode(frame))
        file.mux(stream.encode(None))
    return path


def flat(av, colour, pixels, size):
    """Return a frame of one colour, all its bits as given."""
    frame = av.VideoFrame(*size, pixels)
    bits = frame.format.components[0].bits
    y, cb, cr = colour if isinstance(colour, tuple) else (colour, 1 << bits - 1, 1 << bits - 1)
    for plane, value in zip(frame.planes, (y, cb, cr), strict=False):
        code = np.uint16(value).tobytes() if bits > 8 else bytes([value])
        plane.update(code * (plane.buffer_size // len(code)))
    return frame

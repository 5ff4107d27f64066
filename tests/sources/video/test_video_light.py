"""What light the numbers of a video are: transfer, matrix, range and depth as its file states."""

from __future__ import annotations

import struct

import cv2
import numpy as np
import pytest
from coded import flat, write

from adv2e.effects.frames.encoding import LightDecoder
from adv2e.errors import ConfigError, DataError
from adv2e.sources import open_source
from adv2e.sources.frame import OVER_BLACK
from adv2e.sources.video.pictures import Converter

ENCODINGS = {
    **{1: "bt709", 6: "bt709", 11: "bt709", 14: "bt709", 15: "bt709", 4: "gamma:2.2"},
    **{5: "gamma:2.8", 8: "linear", 13: "srgb", 16: "pq", 18: "hlg", 2: "srgb"},
}


def light(source):
    """Return the light of all pictures, in the middle [DN]."""
    decoder = LightDecoder(source.encoding, source.full_scale, source.dtype, source.colour)
    rows, columns = source.height // 2, source.width // 2
    return [float(decoder.decode(frame.image)[rows, columns]) for frame in source.frames()]


@pytest.mark.parametrize("transfer", ENCODINGS)
def test_light_is_what_the_video_states(tmp_path, transfer):
    path = write(tmp_path / "clip.mp4", [60, 90, 120], tags=(2, transfer, 2))
    source = open_source(path)
    assert source.encoding == ENCODINGS[transfer]
    assert ("states no curve" in source.light.encoding_reason) == (transfer == 2)


@pytest.mark.parametrize(("transfer", "factor"), [(18, 1 / 0.26496), (16, 1 / 0.098338)])
def test_high_dynamic_range_is_not_clipped(tmp_path, transfer, factor):
    lumas = [64 + 876 * quarter // 4 for quarter in (1, 2, 3, 4)]
    path = write(
        tmp_path / "clip.mp4",
        lumas,
        "libx265",
        "yuv420p10le",
        options={"x265-params": "log-level=none:lossless=1"},
        tags=(9, transfer, 9),
    )
    found = light(open_source(path))
    assert found[3] == pytest.approx(255, rel=1e-6)
    assert found[3] / found[2] == pytest.approx(factor, rel=1e-4)


def test_titles_that_are_not_utf8_do_not_matter(tmp_path):
    av = pytest.importorskip("av")
    path = tmp_path / "clip.mkv"
    with av.open(str(path), "w") as file:
        file.metadata["title"] = "Zurich"
        stream = file.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p10le"
        for number in range(3):
            frame = flat(av, 400 + number, "yuv420p10le", (64, 48))
            frame.pts = number
            file.mux(stream.encode(frame))
        file.mux(stream.encode(None))
    path.write_bytes(path.read_bytes().replace(b"Zurich", b"Z\xfcrich"))
    assert len(light(open_source(path))) == 3


def test_wide_primaries_do_not_change_the_codes(tmp_path):
    colours = [(60, 90, 160), (120, 200, 90), (200, 128, 128)]
    kept = [
        frame.image
        for frame in open_source(
            write(tmp_path / "usual.mkv", colours, tags=(1, 1, 1), options={"qp": "0"})
        ).frames()
    ]
    wide = [
        frame.image
        for frame in open_source(
            write(tmp_path / "wide.mkv", colours, tags=(9, 1, 1), options={"qp": "0"})
        ).frames()
    ]
    assert np.array_equal(kept, wide)


def test_a_transfer_that_is_not_known_is_refused_by_name(tmp_path):
    path = write(tmp_path / "clip.mp4", [60, 90, 120], tags=(2, 7, 2))
    source = open_source(path)
    with pytest.raises(ConfigError, match=r"frames\.encoding.*SMPTE 240M.*linear"):
        LightDecoder(source.encoding, 255.0, source.dtype, source.colour)


def test_a_transfer_that_changes_on_the_way_is_refused(tmp_path):
    parts = [
        write(tmp_path / f"{transfer}.ts", [60, 90], tags=(2, transfer, 2), first=2 * number)
        for number, transfer in enumerate((1, 8))
    ]
    joined = tmp_path / "joined.ts"
    joined.write_bytes(b"".join(part.read_bytes() for part in parts))
    source = open_source(joined)
    with pytest.raises(DataError, match=r"frame \d: its light differs .*linear, .*BT\.709"):
        list(source.frames())


MATRICES = {1: (0.2126, 0.0722), 6: (0.299, 0.114), 9: (0.2627, 0.0593), 2: (0.299, 0.114)}


def coded(rgb, matrix, bits, full):
    """Return luma and chromas of R'G'B' in 0..1, as ITU-T H.273 writes them."""
    red, blue = MATRICES[matrix]
    y = red * rgb[0] + (1 - red - blue) * rgb[1] + blue * rgb[2]
    cb, cr = (rgb[2] - y) / (2 - 2 * blue), (rgb[0] - y) / (2 - 2 * red)
    top, step = (1 << bits) - 1, 1 << bits - 8
    if full:
        return tuple(
            min(round(v), top) for v in (y * top, cb * top + 128 * step, cr * top + 128 * step)
        )
    return tuple(
        round(v) for v in ((219 * y + 16) * step, (224 * cb + 128) * step, (224 * cr + 128) * step)
    )


@pytest.mark.parametrize("matrix", MATRICES)
@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize("pixels", ["yuv420p", "yuv444p", "yuv420p10le", "yuv422p10le"])
def test_primary_colours_have_their_light(tmp_path, matrix, full, pixels):
    bits = 10 if "10" in pixels else 8
    shares = {(1, 0, 0): 0.2126, (0, 1, 0): 0.7152, (0, 0, 1): 0.0722, (1, 1, 1): 1, (0, 0, 0): 0}
    colours = [coded(rgb, matrix, bits, full) for rgb in shares]
    path, codec = tmp_path / "clip.mkv", "ffv1" if bits > 8 else "libx264"
    write(path, colours, codec, pixels, tags=(1, 1, matrix), full=full, options={"qp": "0"})
    source = open_source(path)
    assert source.dtype == (np.uint16 if bits > 8 else np.uint8)
    # half a code of luma, and of each chroma times two, at a slope of 2.2
    assert np.allclose(light(source), 255 * np.array([*shares.values()]), atol=600 / 2**bits * 2.2)


@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize("pixels", ["yuv420p10le", "yuv444p12le", "yuv422p16le", "p010le"])
def test_every_deep_luma_has_its_code(pixels, full):
    av = pytest.importorskip("av")
    frame = flat(av, 0, pixels, (64, 16))
    bits = frame.format.components[0].bits
    frame.color_range = 2 if full else 1
    lumas = np.linspace(0, (1 << bits) - 1, 64).astype(np.uint16)
    shift = 6 if pixels == "p010le" else 0
    for plane, value in zip(frame.planes, (lumas, 1 << bits - 1, 1 << bits - 1), strict=False):
        rows = np.zeros((plane.height, plane.line_size // 2), np.uint16)
        samples = rows[:, : 64 if plane is frame.planes[0] else None]
        samples[:] = value << shift
        plane.update(rows.tobytes())
    black, white = (0, (1 << bits) - 1) if full else (16 << bits - 8, 235 << bits - 8)
    expected = np.clip((lumas - float(black)) / (white - black), 0, 1) * 65535
    image = Converter().codes(frame)
    assert image.dtype == np.uint16
    assert np.abs(image - expected[None, :, None]).max() <= 0.51 + 65535 * 2**-22


@pytest.mark.parametrize("pixels", ["yuv420p", "yuv422p", "yuv444p", "gray"])
@pytest.mark.parametrize("full", [False, True])
def test_codes_of_eight_bits_are_those_of_opencv(tmp_path, pixels, full):
    colours = [(60, 90, 160), (120, 200, 90), (220, 128, 128), (16, 128, 128)]
    path = write(
        tmp_path / "clip.mkv",
        colours,
        pixels=pixels,
        tags=(1, 1, 1),
        full=full,
        options={"qp": "0"},
    )
    capture, opencv = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG), []
    while (read := capture.read())[0]:
        opencv.append(read[1][..., ::-1])
    images = [frame.image for frame in open_source(path).frames()]
    assert len(images) == len(colours)
    assert np.array_equal(opencv, images)


@pytest.mark.parametrize("pixels", ["gbrp10le", "gbrp12be", "gray12le", "rgb48le"])
def test_deep_codes_without_luma_are_scaled(pixels):
    av = pytest.importorskip("av")
    frame = av.VideoFrame(64, 16, pixels)
    bits = frame.format.components[0].bits
    order = np.dtype(">u2" if pixels.endswith("be") else "<u2")
    codes = [np.uint16(number * ((1 << bits) - 1) // 10) for number in (2, 5, 9)]  # green blue red
    if pixels == "rgb48le":
        green, blue, red = codes
        frame.planes[0].update(np.tile(np.array([red, green, blue], order), 64 * 16).tobytes())
    else:
        for plane, code in zip(frame.planes, codes, strict=False):
            plane.update(np.full(plane.buffer_size // 2, code, order).tobytes())
    expected = [round(int(code) * 65535 / ((1 << bits) - 1)) for code in codes]
    pixel = Converter().codes(frame)[5, 5]
    if pixels.startswith("gray"):
        assert pixel == expected[0]
    else:
        green, blue, red = expected
        assert np.abs(pixel.astype(int) - [red, green, blue]).max() <= 1


def test_ten_bits_are_read_in_full(tmp_path):
    lumas, lossless = [400, 401, 402, 403], {"qp": "0"}
    path = write(tmp_path / "clip.mkv", lumas, pixels="yuv420p10le", options=lossless)
    whole = light(open_source(path))
    assert (np.diff(whole) > 0).all()


def test_sixteen_bits_of_colours_that_lie_together(tmp_path):
    path = packed(tmp_path / "clip.mov", "rgb48be", [(code,) * 3 for code in (30000, 30001)])
    assert [frame.image.mean() for frame in open_source(path).frames()] == [30000, 30001]


def packed(path, pixels, colours):
    """Write PNGs of one colour each, of 16 bits that lie together."""
    av = pytest.importorskip("av", reason="PyAV writes the video")
    with av.open(str(path), "w") as file:
        stream = file.add_stream("png", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, pixels
        for colour in colours:
            frame = av.VideoFrame(64, 48, pixels)
            data = np.array(colour, ">u2").tobytes()
            frame.planes[0].update(data * (frame.planes[0].buffer_size // len(data)))
            file.mux(stream.encode(frame))
        file.mux(stream.encode(None))
    return path


@pytest.mark.parametrize(("pixels", "colours"), [("rgba64be", 3), ("ya16be", 1)])
def test_transparent_pixels_of_sixteen_bits(tmp_path, pixels, colours):
    white, half = (65535,) * colours, 32768
    path = packed(tmp_path / "clip.mov", pixels, [(*white, 65535), (*white, half)])
    first, second = open_source(path).frames()
    assert first.alpha is None
    assert np.allclose(second.alpha, 0.5, atol=0.01)
    assert second.image.min() == 65535


ALPHA = {
    "clip.mov": ("png", "rgba"),
    "animation.mov": ("qtrle", "argb"),
    "clip.mkv": ("ffv1", "yuva420p"),
    "deep.mkv": ("ffv1", "yuva444p10le"),
    "prores.mov": ("prores_ks", "yuva444p10le"),
}


def transparent(path, codec, pixels, there=0.5):
    """Write pictures of white that is half there."""
    av = pytest.importorskip("av")
    bits = 10 if "10" in pixels else 8
    with av.open(str(path), "w") as file:
        stream = file.add_stream(codec, rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, pixels
        for number in range(3):
            share = there if number else 1
            if "yuv" in pixels:
                step = 1 << bits - 8
                frame = flat(av, (235 * step, 128 * step, 128 * step), pixels, (64, 48))
                alpha = np.uint16(share * ((1 << bits) - 1)).tobytes()[: (bits + 7) // 8]
                frame.planes[3].update(alpha * (frame.planes[3].buffer_size // len(alpha)))
            else:
                image = np.full((48, 64, 4), 255, np.uint8)
                image[..., 0 if pixels == "argb" else 3] = int(share * 255)
                frame = av.VideoFrame.from_ndarray(image, pixels)
            frame.pts = number
            file.mux(stream.encode(frame))
        file.mux(stream.encode(None))
    return path


@pytest.mark.parametrize("name", ALPHA)
def test_transparent_pixels_come_with_how_much_of_them_is_there(tmp_path, name):
    path = transparent(tmp_path / name, *ALPHA[name])
    source = open_source(path)
    first, *others = source.frames()
    assert first.alpha is None
    assert first.image.min() > 0.99 * source.full_scale
    for frame in others:
        assert frame.image.min() > 0.99 * source.full_scale  # not multiplied
        assert np.allclose(frame.alpha, 0.5, atol=0.01)
    assert OVER_BLACK in source.notes


def test_transparency_that_decoders_do_not_look_for_is_refused(tmp_path):
    path = transparent(tmp_path / "clip.webm", "libvpx-vp9", "yuva420p")
    with pytest.raises(DataError, match="transparency"):
        open_source(path)


@pytest.mark.parametrize("hole", [False, True])
def test_gif_with_holes_is_told_from_one_without(tmp_path, hole):
    path = tmp_path / "clip.gif"
    path.write_bytes(gif(hole))
    source = open_source(path)
    images = [frame.image for frame in source.frames()]
    assert [image[0, 0].tolist() for image in images] == [[255, 255, 255], [0, 0, 0]]


def gif(hole):
    """Return a GIF of 1x1: white, then black; the first with a colour that is a hole."""
    data = b"GIF89a" + struct.pack("<HHBBB", 1, 1, 0x80, 0, 0) + bytes([255] * 3 + [0] * 3)
    for number in (0, 1):
        flags = 1 if hole and number == 0 else 0
        data += b"\x21\xf9\4" + struct.pack("<BHBB", flags, 10, 1, 0)
        data += b"\x2c" + struct.pack("<HHHHB", 0, 0, 1, 1, 0)
        data += b"\2\2" + (b"\x44\1" if number == 0 else b"\x4c\1") + b"\0"
    return data + b";"


@pytest.mark.parametrize(
    ("pixels", "encoding"), [("gray10le", "srgb"), ("gray16le", "linear"), ("gray12le", "srgb")]
)
def test_grey_has_one_light_of_any_depth(tmp_path, pixels, encoding):
    path = write(tmp_path / "clip.mkv", [100, 200, 300], "ffv1", pixels)
    source = open_source(path)
    assert (source.encoding, source.dtype, source.colour) == (encoding, np.uint16, False)

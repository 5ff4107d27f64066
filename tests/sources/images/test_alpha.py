"""Transparent pixels are composed over black, in linear light, in the images of all formats."""

from __future__ import annotations

import struct

import cv2
import image_bytes as made
import numpy as np
import pytest

from adv2e.effects.frames.encoding import LightDecoder
from adv2e.errors import DataError
from adv2e.formats.reading import read_events
from adv2e.sources import open_source
from adv2e.sources.frame import OVER_BLACK
from adv2e.sources.images.opencv import decode_image

RGB = np.array([[[50, 25, 0], [200, 100, 7]], [[50, 25, 0], [255, 255, 255]]], np.uint8)
GREY = RGB[..., 0]
ALPHA = np.array([[128, 255], [10, 0]], np.uint8)
EXTRA = 338
UNSPECIFIED, ASSOCIATED, UNASSOCIATED = 0, 1, 2


def beside(colours, alpha):
    colours = colours if colours.ndim == 3 else colours[..., np.newaxis]
    return np.concatenate([colours, alpha[..., np.newaxis]], axis=-1)


def deep(numbers):
    return numbers.astype(np.uint16) * 257


def multiplied(colours, alpha):
    most = np.iinfo(colours.dtype).max
    return np.rint(colours * (alpha[..., np.newaxis] / most)).astype(colours.dtype)


def of_opencv(suffix, rgba, *parameters):
    good, data = cv2.imencode(suffix, rgba[..., [2, 1, 0, 3]], list(parameters))
    assert good
    return data.tobytes()


def palette_png():
    colours = RGB.reshape(-1, 3).tobytes()
    numbers = np.arange(4).reshape(2, 2)
    return made.png(numbers, 3, 2, [(b"PLTE", colours), (b"tRNS", ALPHA.tobytes())])


def extra(kind):
    return [(EXTRA, made.SHORT, [kind])]


RGBA = beside(RGB, ALPHA)
FILES = {
    "png": (made.png(RGBA, 6), RGB),
    "png of 16 bits": (made.png(deep(RGBA), 6, 16), deep(RGB)),
    "png of grey": (made.png(beside(GREY, ALPHA), 4), GREY),
    "png of grey and 16 bits": (made.png(deep(beside(GREY, ALPHA)), 4, 16), deep(GREY)),
    "png with a palette": (palette_png(), RGB),
    "tiff": (made.tiff(RGBA, tags=extra(UNASSOCIATED)), RGB),
    "tiff, big": (made.tiff(RGBA, tags=extra(UNASSOCIATED), big=True, order=">"), RGB),
    "tiff of 16 bits": (made.tiff(deep(RGBA), tags=extra(UNASSOCIATED)), deep(RGB)),
    "tiff of opencv": (of_opencv(".tiff", RGBA), RGB),
    "webp": (of_opencv(".webp", RGBA, cv2.IMWRITE_WEBP_QUALITY, 101), RGB),
    "bmp": (of_opencv(".bmp", RGBA), RGB),
}


def light(pixels, encoding):
    image = pixels.image
    white = np.iinfo(image.dtype).max if image.dtype.kind == "u" else 1
    return LightDecoder(encoding, white, image.dtype, image.ndim == 3).decode(image, pixels.alpha)


def light_over_black(colours, encoding):
    """Return the light of pixels before black, as it is defined, in double precision."""
    value = colours.astype(np.float64) / np.iinfo(colours.dtype).max
    if encoding == "srgb":
        value = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    if colours.ndim == 3:
        value = value @ [0.2126, 0.7152, 0.0722]
    return 255 * value * (ALPHA / 255)


@pytest.mark.parametrize("encoding", ["srgb", "linear"])
@pytest.mark.parametrize("kind", FILES)
def test_the_light_of_a_pixel_is_that_of_its_colour_times_alpha(kind, encoding):
    data, colours = FILES[kind]
    pixels = decode_image(data, "a")
    assert pixels.image.dtype == colours.dtype
    assert np.allclose(light(pixels, encoding), light_over_black(colours, encoding), rtol=1e-5)


@pytest.mark.parametrize("encoding", ["srgb", "linear"])
def test_colours_multiplied_by_alpha_are_the_same_light(encoding):
    for rgb, alpha, rounding in ((RGB, ALPHA, 6), (deep(RGB), deep(ALPHA), 0.03)):
        stored = beside(multiplied(rgb, alpha), alpha)
        pixels = decode_image(made.tiff(stored, tags=extra(ASSOCIATED)), "a")
        assert np.abs(light(pixels, encoding) - light_over_black(rgb, encoding)).max() < rounding
    seen = light(decode_image(made.tiff(beside(RGB, ALPHA), tags=extra(UNASSOCIATED)), "a"), "srgb")
    assert abs(seen[0, 0] - light_over_black(RGB, "srgb")[0, 0]) < 1e-4


def test_floats_multiplied_by_alpha_are_light_already():
    rgb = (RGB / 255 * (ALPHA / 255)[..., np.newaxis]).astype(np.float32)
    stored = beside(rgb, (ALPHA / 255).astype(np.float32))
    pixels = decode_image(made.tiff(stored, tags=extra(ASSOCIATED)), "a")
    assert (pixels.alpha, pixels.composed) == (None, True)
    assert np.array_equal(pixels.image, rgb)
    straight = beside((RGB / 255).astype(np.float32), stored[..., 3])
    pixels = decode_image(made.tiff(straight, tags=extra(UNASSOCIATED)), "a")
    assert np.allclose(light(pixels, "linear"), light_over_black(RGB, "linear"), rtol=1e-5)


def test_exr_is_multiplied_by_convention(tmp_path):
    openexr = pytest.importorskip("OpenEXR")
    image = np.random.default_rng(0).random((8, 9, 4)).astype(np.float32)
    header = {"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage}
    openexr.File(header, {"RGBA": image}).write(str(tmp_path / "0.exr"))
    pixels = decode_image((tmp_path / "0.exr").read_bytes(), "0.exr")
    assert np.array_equal(pixels.image, image[..., :3])
    assert (pixels.alpha, pixels.composed) == (None, True)


@pytest.mark.parametrize(("depth", "key"), [(8, 200), (16, 200), (2, 2), (4, 9)])
def test_a_grey_that_a_png_calls_clear_is_black(depth, key):
    rows = np.array([[0, key], [1, key + 1]])
    transparent = (b"tRNS", struct.pack(">H", key))
    pixels = decode_image(made.png(rows, 0, depth, [transparent]), "a")
    assert pixels.alpha.tolist() == [[1, 0], [1, 1]]
    opaque = decode_image(made.png(rows, 0, depth), "a")
    assert opaque.alpha is None
    assert np.array_equal(pixels.image, opaque.image)


def test_a_colour_that_a_png_calls_clear_is_black():
    transparent = (b"tRNS", struct.pack(">HHH", 50, 25, 0))
    assert decode_image(made.png(RGB, 2, 8, [transparent]), "a").alpha.tolist() == [[0, 1], [0, 1]]


@pytest.mark.parametrize("kind", [UNSPECIFIED, ASSOCIATED, UNASSOCIATED])
@pytest.mark.parametrize("convert", [np.asarray, deep])
def test_what_is_all_there_is_as_without_alpha(kind, convert):
    rgba = convert(beside(RGB, np.full((2, 2), 255, np.uint8)))
    pixels = decode_image(made.tiff(rgba, tags=extra(kind)), "a")
    assert (pixels.alpha, pixels.composed) == (None, False)
    assert np.array_equal(pixels.image, rgba[..., :3])


def test_the_fourth_byte_of_a_plain_bmp_means_nothing():
    head = struct.pack("<IiiHHIIiiII", 40, 1, 1, 1, 32, 3, 0, 0, 0, 0, 0)
    head += struct.pack("<3I", 0xFF0000, 0xFF00, 0xFF)
    start = 14 + len(head)
    data = b"BM" + struct.pack("<IHHI", start + 4, 0, 0, start) + head + bytes([1, 2, 3, 0])
    pixels = decode_image(data, "a")
    assert (pixels.image.tolist(), pixels.alpha) == ([[[3, 2, 1]]], None)


def test_a_channel_of_which_nothing_is_said_is_refused():
    with pytest.raises(DataError, match=r"a: a channel beyond the colours.*ExtraSamples"):
        decode_image(made.tiff(RGBA, tags=extra(UNSPECIFIED)), "a")
    with pytest.raises(DataError, match="a: grey TIFF with a second channel"):
        decode_image(made.tiff(beside(GREY, ALPHA), tags=extra(UNASSOCIATED)), "a")


QUIET = ("--set", "pixel.shot_noise=null", "--set", "pixel.leak=null")


@pytest.fixture
def fading(tmp_path):
    """Write a still that alpha alone fades out, 8 frames long; the first is all there."""

    def write(name, encode):
        folder = tmp_path / name
        folder.mkdir()
        colours = np.kron(RGB, np.ones((4, 4, 1), np.uint8))
        for number, alpha in enumerate((255, 220, 180, 140, 100, 60, 30, 0)):
            rgba = beside(colours, np.full((8, 8), alpha, np.uint8))
            (folder / f"{number}.{name}").write_bytes(encode(rgba))
        return folder

    return write


ENCODERS = {
    "png": lambda rgba: made.png(rgba, 6),
    "tiff": lambda rgba: made.tiff(rgba, tags=extra(UNASSOCIATED)),
    "webp": lambda rgba: of_opencv(".webp", rgba, cv2.IMWRITE_WEBP_QUALITY, 101),
}


def test_a_fade_by_alpha_alone_makes_the_same_events_in_all_formats(adv2e, fading, tmp_path):
    events = []
    for name, encode in ENCODERS.items():
        output = ("-o", tmp_path / "a.h5", "--overwrite")
        outcome = adv2e("convert", fading(name, encode), "--fps", "50", *QUIET, *output)
        assert outcome.status == 0, outcome.err
        assert outcome.err.splitlines().count(OVER_BLACK) == 1
        events.append(read_events(tmp_path / "a.h5").events)
    assert events[0].size > 500
    assert not events[0]["p"].any()
    assert all(other.tobytes() == events[0].tobytes() for other in events[1:])


@pytest.mark.parametrize("factor", [1, 10])
def test_grey_fades_in_light_whether_or_not_the_kernel_decodes_it(adv2e, tmp_path, factor):
    """The first frame is without alpha; with L = 1, the kernel decodes grey values of 8 bits."""
    folder = tmp_path / "frames"
    folder.mkdir()
    for number, alpha in enumerate((255, 128, 64, 32)):
        rows = beside(np.full((4, 4), 240, np.uint8), np.full((4, 4), alpha, np.uint8))
        data = made.png(rows[..., 0], 0) if alpha == 255 else made.png(rows, 4)
        (folder / f"{number}.png").write_bytes(data)
    told = ("--fps", "50", "-c", "ideal", "--set", f"sampling.L={factor}", "-o", tmp_path / "a.h5")
    outcome = adv2e("convert", folder, *told)
    assert outcome.status == 0, outcome.err
    # ln(255/32) in steps of 0.2
    assert read_events(tmp_path / "a.h5").events.size == 16 * int(np.log(255 / 32) / 0.2)


def test_frames_are_stored_as_they_are_seen(adv2e, fading, tmp_path):
    source = fading("png", ENCODERS["png"])
    assert adv2e("convert", source, "--fps", "50", "-o", tmp_path / "rec.zip").status == 0
    stored = read_events(tmp_path / "rec.zip")
    frames = zip(open_source(source, fps=50).frames(), stored.frames(), strict=True)
    decoder = LightDecoder("srgb", 255, np.uint8, True)
    for frame, kept in frames:
        assert kept.alpha is None
        there, seen = decoder.decode(frame.image, frame.alpha), decoder.decode(kept.image)
        assert np.abs(there - seen).max() < 1.3  # half a step of 8 bits
    again = adv2e("convert", tmp_path / "rec.zip", "-o", tmp_path / "b.h5")
    assert OVER_BLACK not in again.err


def test_an_array_with_alpha_is_refused(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros((3, 4, 5, 4), np.uint8))
    with pytest.raises(DataError, match="without alpha"):
        open_source(tmp_path / "a.npy", fps=10)

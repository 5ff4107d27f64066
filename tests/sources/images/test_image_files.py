"""Images are what their headers say: the right way up, white where it is, all of their pages."""

from __future__ import annotations

import struct
import zlib

import cv2
import image_bytes as made
import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.sources import open_source
from adv2e.sources.images.opencv import decode_image

RAMP = np.arange(12, dtype=np.uint8).reshape(3, 4) * 20

PLACES = {
    1: ("top", "left"),
    2: ("top", "right"),
    3: ("bottom", "right"),
    4: ("bottom", "left"),
    5: ("left", "top"),
    6: ("right", "top"),
    7: ("right", "bottom"),
    8: ("left", "bottom"),
}
"""Where the first row and the first column are seen, of each orientation [Exif 2.32, 4.6.4]."""


def seen(stored, orientation):
    """Return, pixel by pixel, what is to be seen of a stored image."""
    rows, columns = stored.shape[:2]
    first_row, first_column = PLACES[orientation]
    lying = first_row in ("left", "right")
    upright = np.zeros((columns, rows) if lying else (rows, columns), stored.dtype)
    for r in range(rows):
        for c in range(columns):
            along = rows - 1 - r if first_row in ("bottom", "right") else r
            across = columns - 1 - c if first_column in ("bottom", "right") else c
            upright[(across, along) if lying else (along, across)] = stored[r, c]
    return upright


def encoded(suffix, image, parameters=()):
    good, data = cv2.imencode(suffix, image, list(parameters))
    assert good
    return data.tobytes()


def jpeg(orientation, order):
    image = np.kron(RAMP, np.ones((8, 8), np.uint8))
    return made.with_exif(
        encoded(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 100]), orientation, order
    )


def webp(orientation, order):
    image = encoded(
        ".webp", cv2.cvtColor(RAMP, cv2.COLOR_GRAY2BGR), [cv2.IMWRITE_WEBP_QUALITY, 101]
    )
    size = struct.pack("<I", 3)[:3] + struct.pack("<I", 2)[:3]  # less one: 4 x 3 pixels
    header = bytes([8, 0, 0, 0]) + size  # with Exif
    (length,) = struct.unpack_from("<I", image, 16)
    content = made.exif(orientation, order)
    return made.webp([(b"VP8X", header), (b"VP8L", image[20 : 20 + length]), (b"EXIF", content)])


ORIENTED = {
    "jpeg": jpeg,
    "webp": webp,
    "png": lambda n, order: made.png(RAMP, 0, chunks=[(b"eXIf", made.exif(n, order))]),
    "tiff": lambda n, order: made.tiff(RAMP, order=order, tags=[(274, 3, [n])]),
    "tiff of 16 bits": lambda n, order: made.tiff(
        RAMP.astype(np.uint16), order=order, tags=[(274, 3, [n])]
    ),
    "bigtiff of floats": lambda n, order: made.tiff(
        RAMP.astype(np.float32), order=order, tags=[(274, 3, [n])], big=True
    ),
}


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("orientation", PLACES)
@pytest.mark.parametrize("kind", ORIENTED)
def test_images_are_the_right_way_up(kind, orientation, order):
    image = decode_image(ORIENTED[kind](orientation, order), "a").image
    image = image[..., 0] if image.ndim == 3 else image
    image = image[4::8, 4::8] if kind == "jpeg" else image
    assert image.shape == seen(RAMP, orientation).shape
    assert np.abs(image.astype(int) - seen(RAMP, orientation)).max() <= (2 if kind == "jpeg" else 0)


@pytest.mark.parametrize("orientation", [0, 9, 65535])
def test_an_orientation_that_there_is_not_changes_nothing(orientation):
    data = made.png(RAMP, 0, chunks=[(b"eXIf", made.exif(orientation))])
    assert np.array_equal(decode_image(data, "a").image, RAMP)


def test_exif_that_is_broken_or_cut_short_changes_nothing():
    whole = made.exif(6)
    for content in (b"", b"II", whole[:8], whole[:12], whole[:20], b"II*\0" + b"\xff" * 20):
        data = made.png(RAMP, 0, chunks=[(b"eXIf", content)])
        assert np.array_equal(decode_image(data, "a").image, RAMP)


def test_pictures_of_a_folder_that_lie_differently_are_named(tmp_path):
    (tmp_path / "a.png").write_bytes(made.png(RAMP, 0))
    (tmp_path / "b.png").write_bytes(made.png(RAMP, 0, chunks=[(b"eXIf", made.exif(6))]))
    with pytest.raises(DataError, match=r"b\.png: uint8 grey of 3x4, but the first frame is"):
        list(open_source(tmp_path, fps=10).frames())


def animation(frames):
    control = struct.pack(">II", frames, 0)
    return made.png(RAMP, 0, chunks=[(b"acTL", control)])


def moving_webp(frames):
    image = encoded(".webp", RAMP)
    frame = bytes(16) + image[12:]
    header = bytes([2, 0, 0, 0]) + bytes(6)
    return made.webp([(b"VP8X", header), (b"ANIM", bytes(6)), *[(b"ANMF", frame)] * frames])


IMAGEJ = b"ImageJ=1.54f\nimages=7\nslices=7\n\0"
TOO_MANY = {
    "tiff": (made.tiff(RAMP, pages=3), "3 pages"),
    "bigtiff": (made.tiff(RAMP, pages=2, big=True, order=">"), "2 pages"),
    "imagej": (made.tiff(RAMP, tags=[(270, made.TEXT, IMAGEJ)]), "7 pages"),
    "apng": (animation(4), "4 pictures"),
    "webp": (moving_webp(3), "3 pictures"),
    "pgm": (b"P5\n1 1\n255\n7" * 2, "2 pictures"),
}


@pytest.mark.parametrize("kind", TOO_MANY)
def test_more_than_one_picture_in_a_file_is_an_error(kind):
    data, found = TOO_MANY[kind]
    with pytest.raises(DataError, match=rf"^a\.x: {found} in it; give each"):
        decode_image(data, "a.x")


@pytest.mark.parametrize("times", [{"fps": 10}, {"timestamps": "t.txt"}])
def test_a_stack_alone_in_its_folder_is_told_as_such(folder, tmp_path, times):
    source = folder(("tif", TOO_MANY["tiff"][0]))
    (tmp_path / "t.txt").write_text("0\n1\n2\n")
    if "timestamps" in times:
        times = {"timestamps": tmp_path / "t.txt"}
    with pytest.raises(DataError, match=r"0\.tif: 3 pages in it; give each frame"):
        open_source(source, **times)


def test_images_that_are_not_read_are_told(folder):
    source = folder(("heic", b"1"), ("heic", b"2"))
    with pytest.raises(DataError, match=r"frames: 0\.heic is not read; convert its images"):
        open_source(source, fps=10)
    for name in ("a.png", "b.png"):
        (source / name).write_bytes(made.png(RAMP, 0))
    left_out = f"{source}: images that are not read are left out: 2, such as 0.heic"
    assert left_out in open_source(source, fps=10).notes


def test_thumbnails_are_no_pages():
    data = made.tiff(RAMP, pages=2)
    second = data.rindex(struct.pack("<H", 10))  # the entries of its last directory
    smaller = made.directory([(254, made.LONG, [1])], second)
    assert np.array_equal(decode_image(data[:second] + smaller, "a").image, RAMP)


def test_directories_that_lead_back_to_each_other_end():
    data = bytearray(made.tiff(RAMP))
    (first,) = struct.unpack_from("<I", data, 4)
    struct.pack_into("<I", data, first + 2 + 12 * 10, first)
    assert np.array_equal(decode_image(bytes(data), "a").image, RAMP)


NUMBERS = np.array([[[0, 1, 50], [100, 2, 3]], [[7, 60, 9], [10, 11, 99]]])
DEEP = NUMBERS * 10


def raw(rows, kind, most):
    data = rows.astype(np.uint8 if most < 256 else ">u2").tobytes()
    return f"P{kind}\n# of 2 x 2\n2 2 {most}\n".encode() + data


NETPBM = {
    "P5 100": (raw(NUMBERS[..., 0], 5, 100), NUMBERS[..., 0], np.uint8, 100),
    "P5 255": (raw(NUMBERS[..., 0], 5, 255), NUMBERS[..., 0], np.uint8, None),
    "P5 256": (raw(NUMBERS[..., 0], 5, 256), NUMBERS[..., 0], np.uint16, 256),
    "P5 4095": (raw(DEEP[..., 0], 5, 4095), DEEP[..., 0], np.uint16, 4095),
    "P5 65535": (raw(DEEP[..., 0], 5, 65535), DEEP[..., 0], np.uint16, None),
    "P6 100": (raw(NUMBERS, 6, 100), NUMBERS, np.uint8, 100),
    "P6 1023": (raw(DEEP, 6, 1023), DEEP, np.uint16, 1023),
}


@pytest.mark.parametrize("kind", NETPBM)
def test_netpbm_of_any_maxval(kind):
    data, expected, dtype, white = NETPBM[kind]
    pixels = decode_image(data, "a")
    assert pixels.image.dtype == dtype
    assert np.array_equal(pixels.image, expected)
    assert (pixels.white, pixels.alpha) == (white, None)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"P5\n2 2\n100\n\1\2\3", "damaged"),
        (b"P5\n2 2\n", "damaged"),
        (b"P5\n2", "damaged"),
        (b"P5\n0 2\n255\n", "damaged"),
        (b"P5\n99999999 99999999\n255\n12", "frames of more than 134,217,728 pixels"),
        (b"P5\n" + b"#" * 5000, "damaged"),
        (b"P5\n1 1\n0\n1", "damaged"),
        (b"P5\n1 1\n70000\n11", "damaged"),
        (b"P5\n1 1\n100\n\xc8", "a number of 200, above the 100 that its header states"),
        (b"P1\n4 1\n0 1 1 0\n", "PBM, PAM and plain PGM and PPM are not read; write raw ones"),
        (b"P2\n1 1\n255\n9\n", "are not read"),
        (b"P7\nWIDTH 1\nHEIGHT 1\nENDHDR\n1", "are not read"),
    ],
)
def test_what_is_wrong_with_a_netpbm_is_named(data, message):
    with pytest.raises(DataError, match=rf"^a: .*{message}"):
        decode_image(data, "a")


@pytest.mark.parametrize("bits", [10, 12, 14])
@pytest.mark.parametrize("colour", [False, True])
def test_bits_of_a_tiff_that_fill_no_bytes(bits, colour):
    most = (1 << bits) - 1
    rows = np.array([[0, 1, most // 2, most]], np.uint16)
    rows = np.stack([rows, rows // 2, rows // 3], -1) if colour else rows
    pixels = decode_image(made.tiff(rows, bits=bits), "a")
    assert np.allclose(pixels.image / pixels.white, rows / most)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("big", [False, True])
def test_a_tiff_says_whether_zero_is_white(order, big):
    rows = np.array([[0, 1000], [2000, 4095]], np.uint16)
    for inverted, expected in ((0, 65535 - rows), (1, rows)):
        tags = [(262, made.SHORT, [inverted])]
        pixels = decode_image(made.tiff(rows, order=order, big=big, tags=tags), "a")
        assert (pixels.image.tolist(), pixels.white) == (expected.tolist(), None)


@pytest.fixture
def folder(tmp_path):
    def write(*files):
        path = tmp_path / "frames"
        path.mkdir()
        for number, (suffix, data) in enumerate(files):
            (path / f"{number}.{suffix}").write_bytes(data)
        return path

    return write


def pgm(value, most):
    return "pgm", raw(np.full((2, 2), value), 5, most)


QUIET = ("--set", "pixel.shot_noise=null", "--set", "pixel.leak=null")


def count(outcome):
    assert outcome.status == 0, outcome.err
    return int(outcome.out.split(":")[1].split()[0].replace(",", ""))


def test_white_of_a_header_is_believed(adv2e, folder, tmp_path):
    source = folder(pgm(100, 1023), pgm(400, 1023), pgm(900, 1023))
    told = ("--fps", "50", *QUIET, "-o", tmp_path / "a.h5", "--overwrite")
    outcome = adv2e("convert", source, *told)
    by_key = adv2e("convert", source, *told, "--set", "frames.full_scale=1023")
    by_type = adv2e("convert", source, *told, "--set", "frames.full_scale=65535")
    assert count(outcome) == count(by_key) > count(by_type)
    assert "linear, white 1023 (" in outcome.err
    assert "white as its header says" in outcome.err
    assert "whole numbers up to" not in outcome.err


def test_images_that_disagree_on_white_are_named_with_the_key(adv2e, folder, tmp_path):
    source = folder(pgm(100, 1023), pgm(0, 4095), pgm(400, 4095))
    told = ("--fps", "50", "-o", tmp_path / "a.h5")
    outcome = adv2e("convert", source, *told)
    assert outcome.status == 1
    assert outcome.err.count("\n") == 1
    assert "2.pgm: white is 4095 in it, but 1023 in the first frame" in outcome.err  # not 1: black
    assert "frames.full_scale=1023" in outcome.err
    assert adv2e("convert", source, *told, "--set", "frames.full_scale=4095").status == 0


def stack(tmp_path, *values, dtype=np.uint16):
    frames = np.stack([np.full((4, 4), value, dtype) for value in values])
    np.save(tmp_path / "a.npy", frames)
    return tmp_path / "a.npy"


@pytest.mark.parametrize(
    ("values", "dtype", "key"),
    [
        ((100, 400, 4000), np.uint16, "if they have 12 bits, say frames.full_scale=4095 ("),
        ((100, 400, 1023), np.uint16, "1023 for 10"),
        ((100, 16383, 50), np.uint16, "if they have 14 bits, say frames.full_scale=16383 ("),
        ((0, 0, 300), np.uint16, "frames.full_scale=4095"),
        ((0, 1, 0), np.uint8, "if they have 1 bit, say frames.full_scale=1 ("),
        ((10, 15, 12), np.uint8, "frames.full_scale=15"),
        ((100, 20000, 50), np.uint16, None),
        ((10, 16, 12), np.uint8, None),
        ((0, 0, 0), np.uint16, None),
        ((0.1, 0.5, 0.1), np.float32, None),
    ],
)
@pytest.mark.quick_cases(1)
def test_whole_numbers_far_below_white_are_told_with_the_key(adv2e, tmp_path, values, dtype, key):
    source = stack(tmp_path, *values, dtype=dtype)
    told = ("--fps", "50", "-o", tmp_path / "a.h5", "--overwrite")
    outcome = adv2e("convert", source, *told)
    lines = [line for line in outcome.err.splitlines() if "whole numbers up to" in line]
    assert len(lines) == (0 if key is None else 1)
    info = adv2e("info", source, "--fps", "50").out
    assert ("whole numbers up to" in info) == (key is not None)
    if key is not None:
        assert f"a.npy: whole numbers up to {max(values)}, where " in lines[0]
        assert key in lines[0]
        assert key in info
    settled = adv2e("convert", source, *told, "--set", "frames.full_scale=4095")
    assert "whole numbers up to" not in settled.err


def test_a_doubt_about_white_is_taken_back_where_it_does_not_hold(adv2e, tmp_path):
    source = stack(tmp_path, 10, 40000, 20, 20, 10)  # of which the first, middle and last are seen
    outcome = adv2e("convert", source, "--fps", "50", "-o", tmp_path / "a.h5")
    lines = outcome.err.splitlines()
    assert "whole numbers up to 20," in lines[0]
    assert "whole numbers up to 40000 came: what was said of white does not hold" in lines[-1]
    assert "whole numbers" not in adv2e("info", source, "--fps", "50").out


def chunked(folder, *chunks, depth=8, count=3):
    """Write grey PNGs with chunks of their own."""
    folder.mkdir(exist_ok=True)
    for number in range(count):
        rows = RAMP.astype(np.uint16) * 257 if depth == 16 else RAMP
        data = made.png(np.roll(rows, number, 1), 0, depth, chunks)
        (folder / f"{number}.png").write_bytes(data)
    return folder


def gamma(value):
    return b"gAMA", struct.pack(">I", value)


SRGB, PQ = (b"sRGB", b"\0"), (b"cICP", bytes([9, 16, 0, 1]))
PROFILE = b"iCCP", b"Display P3\0\0" + zlib.compress(bytes(200))


@pytest.mark.parametrize(
    ("chunks", "encoding", "reason"),
    [
        ([], "srgb", "8-bit grey images"),
        ([gamma(100_000)], "linear", "its gAMA is 1"),
        ([gamma(45_455)], "srgb", "its gAMA is 0.45455"),
        ([gamma(50_000)], "gamma:2", "its gAMA is 0.5"),
        ([gamma(0)], "srgb", "its gAMA of 0 is ignored"),
        ([(b"gAMA", b"\0")], "srgb", "8-bit grey images"),
        ([gamma(100_000), SRGB], "srgb", "its chunk sRGB says so"),
        ([gamma(100_000), PROFILE], "srgb", "its colour profile 'Display P3' is not read"),
        ([SRGB, PQ], "pq", "cICP"),
    ],
)
def test_what_a_png_states_of_its_numbers_is_followed_and_told(tmp_path, chunks, encoding, reason):
    source = open_source(chunked(tmp_path / "png", *chunks), fps=10)
    assert source.encoding == encoding
    assert reason in source.light.encoding_reason


def test_deep_png_follows_its_chunk_too(tmp_path):
    source = open_source(chunked(tmp_path / "png", SRGB, depth=16), fps=10)
    assert (source.encoding, source.full_scale) == ("srgb", 65535)


def test_a_transfer_that_is_not_known_is_asked_for(adv2e, tmp_path):
    folder = chunked(tmp_path / "png", (b"cICP", bytes([1, 99, 0, 1])))
    convert = ["convert", folder, "--fps", 10, "-o", tmp_path / "a.h5"]
    outcome = adv2e(*convert)
    assert outcome.status == 1
    assert "transfer 99 of a cICP chunk, which is not known; say what they are" in outcome.err
    assert adv2e(*convert, "--set", "frames.encoding=srgb").status == 0


def test_pictures_that_state_another_encoding_than_the_first_are_told(tmp_path):
    folder = chunked(tmp_path / "png", gamma(100_000))
    (folder / "2.png").write_bytes(made.png(RAMP, 0, 8, [SRGB]))
    source = open_source(folder, fps=10)
    assert len(list(source.frames())) == 3
    assert any("2.png; all are taken as linear" in note for note in source.notes)


def test_pixels_that_are_not_square_are_told(tmp_path):
    folder = chunked(tmp_path / "png", (b"pHYs", struct.pack(">IIB", 2835, 1417, 1)))
    assert any(
        "not square, as it states 2835 across" in n for n in open_source(folder, fps=1).notes
    )
    square = chunked(tmp_path / "square", (b"pHYs", struct.pack(">IIB", 2835, 2835, 1)))
    assert open_source(square, fps=1).notes == []
    data = bytearray(encoded(".jpg", np.kron(RAMP, np.ones((8, 8), np.uint8))))
    struct.pack_into(">HH", data, data.index(b"JFIF\0") + 8, 1, 2)
    for number in range(2):
        (square / f"{number}.jpg").write_bytes(data)
    for file in square.glob("*.png"):
        file.unlink()
    assert any("1 across and 2 down" in note for note in open_source(square, fps=1).notes)


@pytest.mark.parametrize("begin", [b"GIF89a", b"GIF87a", b"\0\0\0\x20ftypavis"])
def test_films_that_are_named_as_pictures_are_refused(folder, begin):
    images = folder(("png", encoded(".png", RAMP)), ("png", begin + bytes(100)))
    with pytest.raises(DataError, match=r"1\.png: is a GIF or AVIF of pictures"):
        list(open_source(images, fps=10).frames())


def test_pictures_that_move_are_left_out_with_a_word(folder):
    images = folder(("png", encoded(".png", RAMP)), ("png", encoded(".png", RAMP)), ("apng", b""))
    assert any("such as 2.apng" in note for note in open_source(images, fps=10).notes)

"""Pictures that state a size which their file cannot hold."""

import re
import struct
import zlib

import cv2
import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.sources import frame, open_source
from adv2e.sources.images import headers
from adv2e.sources.images.opencv import decode_image


def encoded(suffix, shape=(30, 50), *how):
    picture = np.random.default_rng(0).integers(0, 255, (*shape, 3), np.uint8)
    return cv2.imencode(suffix, picture, how)[1].tobytes()


KINDS = {
    "png": encoded(".png"),
    "jpg": encoded(".jpg"),
    "jpg progressive": encoded(".jpg", (30, 50), cv2.IMWRITE_JPEG_PROGRESSIVE, 1),
    "tif": encoded(".tif"),
    "webp": encoded(".webp", (30, 50), cv2.IMWRITE_WEBP_QUALITY, 50),
    "webp lossless": encoded(".webp", (30, 50), cv2.IMWRITE_WEBP_QUALITY, 101),
}


def png(width, height):
    def chunk(kind, data):
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(bytes(1000)))
        + chunk(b"IEND", b"")
    )


def jpeg(width, height):
    data = bytearray(KINDS["jpg"])
    at = data.index(b"\xff\xc0")
    struct.pack_into(">HH", data, at + 5, height, width)
    return bytes(data)


def tiff(width, height):
    order, size = "<", struct.pack
    tags = [(256, 4, 1, width), (257, 4, 1, height), (258, 3, 1, 8), (259, 3, 1, 1), (262, 3, 1, 1),
            (273, 4, 1, 8), (277, 3, 1, 1), (278, 4, 1, height), (279, 4, 1, 64)]  # fmt: skip
    directory = size(order + "H", len(tags)) + b"".join(size(order + "HHII", *tag) for tag in tags)
    return b"II*\0" + size(order + "I", 8 + 64) + bytes(64) + directory + bytes(4)


def webp(width, height):
    data = bytearray(KINDS["webp lossless"])
    struct.pack_into("<I", data, 21, (width - 1) | (height - 1) << 14)
    return bytes(data)


@pytest.mark.parametrize("kind", KINDS)
def test_the_size_is_that_which_the_decoder_finds(monkeypatch, kind):
    monkeypatch.setattr(headers, "FREE", 0)
    monkeypatch.setattr(headers, "MOST", 0)
    with pytest.raises(DataError, match=r"^a: states 50x30 pixels in "):
        decode_image(KINDS[kind], "a")


def test_a_large_picture_of_one_colour_is_read():
    for suffix in (".png", ".jpg"):
        data = cv2.imencode(suffix, np.zeros((4320, 7680), np.uint8))[1].tobytes()
        header = headers.read_header(data)
        headers.check_size(header.width, header.height, data, f"8k{suffix}")


@pytest.mark.parametrize(
    ("make", "size"),
    [(png, (11000, 11000)), (jpeg, (11000, 11000)), (tiff, (11000, 11000)), (webp, (8192, 16384))],
)
def test_a_size_that_is_not_there(make, size):
    with pytest.raises(DataError, match=rf"^a\.x: states {size[0]}x{size[1]} pixels in "):
        decode_image(make(*size), "a.x")


def bmp(width, height):
    return b"BM" + bytes(12) + struct.pack("<Iii", 40, width, -height) + bytes(200)


def old_bmp(width, height):
    return b"BM" + bytes(12) + struct.pack("<IHH", 12, width, height) + bytes(200)


def hdr(width, height):
    return f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode() + bytes(200)


def pfm(width, height):
    return f"PF\n{width} {height}\n-1.0\n".encode() + bytes(200)


def pgm(width, height):
    return f"P5 {width} {height} 255\n".encode() + bytes(200)


@pytest.mark.parametrize("make", [png, jpeg, tiff, webp, bmp, old_bmp, hdr, pfm, pgm])
def test_a_picture_beyond_all_measure_is_refused_before_it_is_decoded(monkeypatch, make):
    monkeypatch.setattr(cv2, "imdecodeWithMetadata", None)
    most = "frames of more than 134,217,728 pixels (16384x8192) are not read"
    with pytest.raises(DataError, match=rf"^a\.x: 16384x8193 pixels; {re.escape(most)}"):
        decode_image(make(16384, 8193), "a.x")


def test_a_stack_of_too_large_frames_is_refused_before_it_is_read(tmp_path):
    header = b"{'descr': '|u1', 'fortran_order': False, 'shape': (2, 8193, 16384), }"
    with (tmp_path / "a.npy").open("wb") as file:
        file.write(b"\x93NUMPY\1\0" + struct.pack("<H", 118) + header.ljust(117) + b"\n")
        file.truncate(128 + 2 * 8193 * 16384)  # which takes no room
    with pytest.raises(DataError, match=r"a\.npy: 16384x8193 pixels; frames of more than"):
        open_source(tmp_path / "a.npy", fps=10)


@pytest.mark.parametrize("kind", ["png", "jpg", "tif"])
def test_pictures_of_another_kind_of_source_are_bounded(tmp_path, monkeypatch, kind):
    monkeypatch.setattr(frame, "LARGEST", 50 * 30 - 1)
    for number in range(2):
        (tmp_path / f"{number}.{kind}").write_bytes(KINDS[kind])
    with pytest.raises(DataError, match=rf"0\.{kind}: 50x30 pixels; frames of more than 1,499"):
        open_source(tmp_path, fps=10)


@pytest.mark.parametrize("kind", KINDS)
def test_any_part_of_a_file_may_be_missing(kind):
    for length in range(min(len(KINDS[kind]), 700)):
        headers.read_header(KINDS[kind][:length])

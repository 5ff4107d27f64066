from __future__ import annotations

import importlib.util

import cv2
import numpy as np
import pytest

from adv2e.errors import DataError, MissingExtraError, UsageError
from adv2e.sources import open_source
from adv2e.sources.images.source import natural_key


def images_of(source):
    return [frame.image for frame in source.frames()]


def times_of(source):
    return [frame.t_ns for frame in source.frames()]


def same(images, others):
    return all(np.array_equal(a, b) for a, b in zip(images, others, strict=True))


def test_numbers_in_names_count_as_numbers():
    names = ["f10.png", "f2.png", "f2b.png", "a.png", "f010.png", "f1_9.png", "f1_10.png"]
    expected = ["a.png", "f1_9.png", "f1_10.png", "f2.png", "f2b.png", "f010.png", "f10.png"]
    assert sorted(names, key=natural_key) == expected


def test_frames_in_natural_order_whatever_their_first_number(write_images, picture):
    frames = [picture(n) for n in range(12)]
    source = open_source(write_images(frames, name="x_{:d}.png"), fps=50)
    assert same(images_of(source), frames)
    assert times_of(source) == [n * 20_000_000 for n in range(12)]
    assert (source.kind, source.count, source.has_clock) == ("images", 12, False)
    assert (source.width, source.height, source.notes) == (32, 24, [])


@pytest.mark.parametrize(
    ("suffix", "dtype", "shape", "encoding", "white"),
    [
        ("png", np.uint8, (24, 32), "srgb", 255),
        ("png", np.uint8, (24, 32, 3), "srgb", 255),
        ("png", np.uint16, (24, 32), "linear", 65535),
        ("png", np.uint16, (24, 32, 3), "linear", 65535),
        ("tif", np.uint16, (24, 32, 3), "linear", 65535),
        ("tiff", np.float32, (24, 32), "linear", 1),
        ("tiff", np.float32, (24, 32, 3), "linear", 1),
        ("tiff", np.float64, (24, 32, 3), "linear", 1),
        ("bmp", np.uint8, (24, 32, 3), "srgb", 255),
        ("pgm", np.uint16, (24, 32), "linear", 65535),
        ("ppm", np.uint8, (24, 32, 3), "srgb", 255),
        ("pfm", np.float32, (24, 32), "linear", 1),
    ],
)
def test_all_bits_are_kept(write_images, picture, suffix, dtype, shape, encoding, white):
    frames = [picture(n, shape, dtype) for n in range(2)]
    source = open_source(write_images(frames, name="{:d}." + suffix), fps=10)
    assert same(images_of(source), frames)
    assert (source.dtype, source.colour) == (dtype, len(shape) == 3)
    assert (source.encoding, source.full_scale) == (encoding, white)


@pytest.mark.parametrize("suffix", ["jpg", "jpeg", "webp", "hdr"])
def test_formats_that_lose_a_little(write_images, suffix):
    ramp = np.linspace(0.2, 0.8, 64, dtype=np.float32)
    image = np.stack([np.tile(ramp, (48, 1)), np.full((48, 64), 0.3), np.full((48, 64), 0.6)], -1)
    image = image.astype(np.float32) if suffix == "hdr" else (image * 255).astype(np.uint8)
    source = open_source(write_images([image, image], name="{:d}." + suffix), fps=10)
    tolerance = 0.01 if suffix == "hdr" else 8
    assert source.dtype == image.dtype
    assert np.abs(images_of(source)[0].astype(float) - image).max() < tolerance


def test_alpha_is_no_colour(write_images, picture):
    frames = [picture(n, (24, 32, 4)) for n in range(2)]
    assert same(images_of(open_source(write_images(frames), fps=10)), [f[..., :3] for f in frames])


def test_grey_with_alpha_is_grey(tmp_path):
    # OpenCV cannot write this kind: 2x1 pixels, grey 7 and 200, half transparent
    import struct
    import zlib

    def chunk(kind, data):
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    header = struct.pack(">IIBBBBB", 2, 1, 8, 4, 0, 0, 0)
    data = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header)
    data += chunk(b"IDAT", zlib.compress(bytes([0, 7, 128, 200, 128]))) + chunk(b"IEND", b"")
    for name in ("a.png", "b.png"):
        (tmp_path / name).write_bytes(data)
    source = open_source(tmp_path, fps=10)
    assert not source.colour
    assert images_of(source)[0].tolist() == [[7, 200]]


def test_hidden_files_and_other_files_are_left_out(write_images, picture):
    folder = write_images([picture(0), picture(1)])
    (folder / "._frame_0.png").write_bytes(b"resource fork")
    (folder / "readme.md").write_text("hello")
    assert open_source(folder, fps=10).count == 2


def test_times_given_one_a_line(write_images, picture, tmp_path):
    times = tmp_path / "t.txt"
    times.write_text("# s\n1468941032.229165635\n1468941032.3\n")
    source = open_source(write_images([picture(0), picture(1)]), timestamps=times)
    assert times_of(source) == [1468941032_229165635, 1468941032_300000000]
    assert source.has_clock


def test_times_given_with_names_say_which_image_is_meant(write_images, picture, tmp_path):
    frames = [picture(n) for n in range(3)]
    times = tmp_path / "t.txt"
    times.write_text("0.3 frame_0.png\n0.1 frame_2.png\n0.2 frame_1.png\n")
    source = open_source(write_images(frames), timestamps=times)
    assert times_of(source) == [100_000_000, 200_000_000, 300_000_000]
    assert same(images_of(source), frames[::-1])


def test_another_number_of_times_names_both(write_images, picture, tmp_path):
    folder = write_images([picture(n) for n in range(3)])
    times = tmp_path / "t.txt"
    for text in ("0\n1\n", "0 frame_0.png\n1 frame_1.png\n"):
        times.write_text(text)
        with pytest.raises(DataError, match=r"t\.txt: 2 times for the 3 frames of .*frames"):
            open_source(folder, timestamps=times)


FOUND = {
    "images.txt": "0.25 frame_1.png\n0.5 frame_0.png\n",
    "timestamps.txt": "0.25\n0.5\n",
    "info.txt": "somewhere/else/frame_1.png 250000\nsomewhere/else/frame_0.png 500000\n",
}


@pytest.mark.parametrize("place", ["in", "beside"])
@pytest.mark.parametrize("name", FOUND)
def test_times_found_in_or_beside_the_folder(write_images, picture, name, place):
    frames = [picture(0), picture(1)]
    folder = write_images(frames)
    (folder if place == "in" else folder.parent).joinpath(name).write_text(FOUND[name])
    source = open_source(folder)
    assert times_of(source) == [250_000_000, 500_000_000]
    assert same(images_of(source), frames if name == "timestamps.txt" else frames[::-1])
    assert (source.kind, source.has_clock) == ("images", True)
    assert any(f"times from {folder.parent}" in n and f"{name}: " in n for n in source.notes)


def test_given_times_replace_a_list_and_a_note_says_so(write_images, picture):
    folder = write_images([picture(0), picture(1)])
    (folder / "timestamps.txt").write_text("0.25\n0.5\n")
    source = open_source(folder, fps=10)
    assert times_of(source) == [0, 100_000_000]
    assert source.notes == [f"--fps 10 replaces the times in {folder / 'timestamps.txt'}"]


def test_images_that_a_list_leaves_out_are_told(write_images, picture):
    folder = write_images([picture(n) for n in range(4)])
    (folder / "images.txt").write_text("0 frame_1.png\n1 frame_3.png\n")
    source = open_source(folder)
    assert same(images_of(source), [picture(1), picture(3)])
    assert any("2 images are not in" in note for note in source.notes)


def test_a_listed_image_that_is_missing_is_named_by_line(write_images, picture):
    folder = write_images([picture(0), picture(1)])
    (folder / "images.txt").write_text("0 frame_0.png\n1 frame_1.png\n2 frame_2.png\n")
    with pytest.raises(DataError, match=r"images\.txt line 3: no image frame_2\.png"):
        open_source(folder)


def test_without_times_the_message_says_what_to_give(write_images, picture):
    folder = write_images([picture(0), picture(1)])
    with pytest.raises(DataError, match=r"frames: .*--fps F or --timestamps FILE.*images\.txt"):
        open_source(folder)


def test_both_ways_to_give_times(write_images, picture, tmp_path):
    folder = write_images([picture(0), picture(1)])
    with pytest.raises(UsageError, match="--fps and --timestamps"):
        open_source(folder, fps=10, timestamps=tmp_path / "t.txt")


def test_folder_without_images(tmp_path, write_images, picture):
    with pytest.raises(DataError, match=r"no images in it \(png jpg"):
        open_source(tmp_path, fps=10)
    write_images([picture(0), picture(1)], folder="sub")
    with pytest.raises(DataError, match=r"no images in it; there are some in .*sub"):
        open_source(tmp_path, fps=10)


def test_a_single_image(write_images, picture):
    with pytest.raises(DataError, match="frames: a single frame"):
        open_source(write_images([picture(0)]), fps=10)


@pytest.mark.parametrize(
    ("other", "message"),
    [
        ({"shape": (24, 30)}, "uint8 grey of 30x24, but the first frame is uint8 grey of 32x24"),
        ({"dtype": np.uint16}, "uint16 grey of 32x24, but the first frame is uint8 grey of 32x24"),
        ({"shape": (24, 32, 3)}, "uint8 colour of 32x24, but the first frame is uint8 grey"),
    ],
)
def test_frames_that_differ_are_named(write_images, picture, other, message):
    folder = write_images([picture(0), picture(1), picture(2, **other)])
    with pytest.raises(DataError, match=rf"frame_2\.png: {message}"):
        list(open_source(folder, fps=10).frames())


@pytest.mark.parametrize("suffix", ["png", "jpg", "tiff", "bmp", "webp", "pgm"])
@pytest.mark.parametrize("kept", [0, 30, 0.7])
def test_damaged_images_are_named(write_images, picture, suffix, kept, capfd):
    folder = write_images([picture(n, (96, 96)) for n in range(3)], name="f{:d}." + suffix)
    damaged = folder / f"f2.{suffix}"
    data = damaged.read_bytes()
    damaged.write_bytes(data[: kept if kept != 0.7 else int(0.7 * len(data))])
    with pytest.raises(DataError, match=rf"f2\.{suffix}: not an image that can be read"):
        list(open_source(folder, fps=10).frames())
    assert "OpenCV" not in capfd.readouterr().err


def test_unusual_data_types_are_refused(tmp_path):
    for number in range(2):
        cv2.imwrite(str(tmp_path / f"{number}.tiff"), np.zeros((4, 4), np.int16))
    with pytest.raises(DataError, match=r"0\.tiff: frames of int16"):
        open_source(tmp_path, fps=10)


def test_nan_pixels_name_the_image(write_images):
    frames = np.full((3, 8, 8), 0.5, np.float32)
    frames[1, 2, 3] = np.nan
    folder = write_images(list(frames), name="{:d}.tiff")
    with pytest.raises(DataError, match=r"1\.tiff: pixels that are NaN"):
        list(open_source(folder, fps=10).frames())


@pytest.mark.skipif(importlib.util.find_spec("OpenEXR") is not None, reason="OpenEXR is installed")
def test_exr_without_its_package_names_the_extra(tmp_path):
    for number in range(2):
        (tmp_path / f"{number}.exr").write_bytes(b"v/1\x01")
    with pytest.raises(MissingExtraError, match=r"0\.exr.*adv2e\[exr\]"):
        open_source(tmp_path, fps=10)


def test_exr_with_its_package(tmp_path):
    openexr = pytest.importorskip("OpenEXR")
    image = np.random.default_rng(0).random((8, 9, 3)).astype(np.float32)
    header = {"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage}
    for number in range(2):
        openexr.File(header, {"RGB": image}).write(str(tmp_path / f"{number}.exr"))
    assert np.array_equal(images_of(open_source(tmp_path, fps=10))[1], image)

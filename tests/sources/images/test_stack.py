"""TIFFs of several pages: each is a frame, and read when it is wanted."""

from __future__ import annotations

import json
import struct

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.errors import DataError
from adv2e.sources import open_source


def tiff(pages, order="<", big=False, kinds=None, description=b"", directories=None):
    """Return an uncompressed TIFF of two strips a page, in any byte order, plain or big."""
    pointer, counter, entry = ("Q", "Q", "HHQ") if big else ("I", "H", "HHI")
    width = struct.calcsize("=" + pointer)

    def packed(form, *values):
        return struct.pack(order + form, *values)

    data = b"II" if order == "<" else b"MM"
    data += packed("HHH", 43, 8, 0) if big else packed("H", 42)
    at_link, data = len(data), data + bytes(width)
    places = []
    for page in pages:
        rows = page.astype(page.dtype.newbyteorder(order)).tobytes()
        half = len(rows) // len(page) * (len(page) // 2)
        places.append(((len(data), len(data) + half), (half, len(rows) - half)))
        data += rows
    for number, (page, (starts, sizes)) in enumerate(zip(pages, places, strict=True)):
        if directories is not None and number >= directories:
            break
        at = len(data)
        data = data[:at_link] + packed(pointer, at) + data[at_link + width :]
        form = 3 if page.dtype.kind == "f" else 1
        depth = 8 * page.dtype.itemsize
        tags = {
            254: (4, (kinds or {}).get(number, 0)), 256: (4, page.shape[1]),
            257: (4, page.shape[0]), 258: (3, depth), 259: (3, 1), 262: (3, 1),
            273: (16 if big else 4, *starts), 277: (3, 1), 278: (4, len(page) // 2),
            279: (16 if big else 4, *sizes), 339: (3, form),
        }  # fmt: skip
        if description and not number:
            tags[270] = (2, *description)
        behind = at + struct.calcsize("=" + counter) + width
        behind += len(tags) * (struct.calcsize("=" + entry) + width)
        data += packed(counter, len(tags))
        outside = b""
        for tag, (kind, *values) in sorted(tags.items()):
            value = packed(f"{len(values)}{ {2: 'B', 3: 'H', 4: 'I', 16: 'Q'}[kind] }", *values)
            data += packed(entry, tag, kind, len(values))
            if len(value) > width:
                data += packed(pointer, behind + len(outside))
                outside += value
            else:
                data += value.ljust(width, b"\0")
        at_link, data = len(data), data + bytes(width) + outside
    return data


@pytest.fixture
def path(tmp_path):
    return tmp_path / "stack.tif"


def images_of(source):
    return [frame.image for frame in source.frames()]


def same(images, others):
    return all(np.array_equal(a, b) for a, b in zip(images, others, strict=True))


@pytest.mark.parametrize(
    ("dtype", "shape", "encoding", "white"),
    [
        (np.uint8, (6, 8), "srgb", 255),
        (np.uint8, (6, 8, 3), "srgb", 255),
        (np.uint16, (6, 8), "linear", 65535),
        (np.uint16, (6, 8, 3), "linear", 65535),
        (np.float32, (6, 8), "linear", 1),
        (np.float32, (6, 8, 3), "linear", 1),
        (np.float64, (6, 8), "linear", 1),
    ],
)
def test_all_bits_of_all_pages_are_kept(path, picture, dtype, shape, encoding, white):
    frames = [picture(n, shape, dtype) for n in range(4)]
    stored = [np.ascontiguousarray(f if f.ndim == 2 else f[..., ::-1]) for f in frames]
    assert cv2.imwritemulti(str(path), stored)
    source = open_source(path, fps=100)
    assert same(images_of(source), frames)
    assert [frame.t_ns for frame in source.frames()] == [0, 10**7, 2 * 10**7, 3 * 10**7]
    assert (source.kind, source.count, source.has_clock) == ("tiff", 4, False)
    assert (source.dtype, source.encoding, source.full_scale) == (dtype, encoding, white)


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_either_byte_order_plain_or_big(path, picture, dtype, order, big):
    frames = [picture(n, (6, 8), dtype) for n in range(3)]
    path.write_bytes(tiff(frames, order, big))
    assert same(images_of(open_source(path, fps=100)), frames)


def test_only_one_page_is_read_at_a_time(path, picture):
    frames = [picture(n, (6, 8)) for n in range(3)]
    whole = tiff(frames)
    path.write_bytes(whole)
    coming = open_source(path, fps=100).frames()
    assert np.array_equal(next(coming).image, frames[0])
    path.write_bytes(whole.replace(frames[2].tobytes(), frames[0].tobytes()))
    assert same([frame.image for frame in coming], [frames[1], frames[0]])


def test_thumbnails_and_masks_are_no_frames(path, picture):
    frames = [picture(n, (6, 8)) for n in range(4)]
    path.write_bytes(tiff(frames, kinds={1: 1, 2: 4}))
    assert same(images_of(open_source(path, fps=100)), [frames[0], frames[3]])


@pytest.mark.parametrize("order", ["<", ">"])
def test_imagej_puts_pages_behind_the_first(path, picture, order):
    frames = [picture(n, (6, 8), np.uint16) for n in range(9)]
    text = b"ImageJ=1.53t\nimages=%d\nframes=9\nloop=false\n\0"
    whole = tiff(frames, order, description=text % 9, directories=1)
    path.write_bytes(whole)
    assert same(images_of(open_source(path, fps=100)), frames)
    path.write_bytes(tiff(frames, order, description=text % 9))
    assert same(images_of(open_source(path, fps=100)), frames)
    for wrong in (tiff(frames, description=text % 20), tiff(frames, description=text % 20)[:900]):
        path.write_bytes(wrong)
        with pytest.raises(DataError, match=r"stack\.tif: (9 pages in it, where|cut short)"):
            open_source(path, fps=100)
    path.write_bytes(tiff(frames, description=text % 99, directories=1))
    with pytest.raises(DataError, match=r"stack\.tif: cut short: not all of its 99 pages"):
        open_source(path, fps=100)


@pytest.mark.parametrize("axes", [b"channels=3\n", b"slices=3\nframes=3\n"])
def test_channels_and_slices_are_no_frames(path, picture, axes):
    text = b"ImageJ=1.53t\nimages=9\n" + axes + b"loop=false\n\0"
    path.write_bytes(tiff([picture(n, (6, 8)) for n in range(9)], description=text))
    with pytest.raises(DataError, match=r"its pages are 3 .*must be frames alone"):
        open_source(path, fps=100)


def test_times_beside_it(path, picture):
    path.write_bytes(tiff([picture(n, (6, 8)) for n in range(3)]))
    with pytest.raises(DataError, match=r"--fps F .* put stack_ts\.npy or stack\.timestamps\.txt"):
        open_source(path)
    path.with_name("stack.timestamps.txt").write_text("0.5\n0.75\n1.25\n")
    source = open_source(path)
    assert [frame.t_ns for frame in source.frames()] == [5 * 10**8, 75 * 10**7, 125 * 10**7]
    assert source.has_clock


@pytest.mark.parametrize(
    ("other", "message"),
    [
        ({"shape": (6, 10)}, "uint8 grey of 10x6, but the first frame is uint8 grey of 8x6"),
        ({"dtype": np.uint16}, "uint16 grey of 8x6, but the first frame is uint8 grey of 8x6"),
    ],
)
def test_pages_that_differ_are_named(path, picture, other, message):
    pages = [picture(0, (6, 8)), picture(1, (6, 8)), picture(2, **{"shape": (6, 8), **other})]
    path.write_bytes(tiff(pages))
    with pytest.raises(DataError, match=rf"stack\.tif: page 2: {message}"):
        list(open_source(path, fps=10).frames())


def test_a_single_page(path, picture):
    path.write_bytes(tiff([picture(0, (6, 8))]))
    with pytest.raises(DataError, match=r"stack\.tif: a single picture"):
        open_source(path, fps=10)


def test_directories_in_a_circle(path, picture):
    whole = tiff([picture(n, (6, 8)) for n in range(2)])
    (first,) = struct.unpack_from("<I", whole, 4)
    path.write_bytes(whole[:-20] + whole[-20:].replace(bytes(4), struct.pack("<I", first), 1))
    with pytest.raises(DataError, match="lead in a circle"):
        open_source(path, fps=10)


def test_it_is_converted_and_told_of(adv2e, path, picture, tmp_path):
    path.write_bytes(tiff([picture(n, (6, 8)) for n in range(3)]))
    assert adv2e("convert", path, "--fps", "10", "-o", tmp_path / "a.h5").status == 0
    report = json.loads(adv2e("info", path, "--fps", "10", "--json").out)
    assert (report["layout"], report["frames"]["count"]) == ("tiff", 3)


RAMP = np.arange(48, dtype=np.uint8).reshape(6, 8)
WHOLE = [tiff([RAMP, RAMP + 1, RAMP + 2], order, big) for order in "<>" for big in (False, True)]
WHOLE.append(tiff([RAMP] * 3, description=b"ImageJ=1\nimages=3\n\0", directories=1))


@settings(max_examples=200, deadline=None)
@given(
    st.sampled_from(WHOLE),
    st.lists(st.tuples(st.floats(0, 0.999), st.sampled_from([0, 1, 2, 255])), max_size=6),
    st.floats(0.5, 1.5),
)
@pytest.mark.thorough
def test_any_damage_gives_frames_or_an_error(tmp_path_factory, whole, changes, end):
    data = bytearray(whole)
    for place, value in changes:
        data[int(place * len(data))] = value
    path = tmp_path_factory.getbasetemp() / "damaged.tif"
    path.write_bytes(data[: int(end * len(data))])
    try:
        frames = list(open_source(path, fps=10).frames())
    except DataError as error:
        assert "\n" not in str(error)
        return
    assert len(frames) >= 2
    assert all(frame.image.nbytes <= 1 << 20 for frame in frames)

"""Masks, depth and flow: each kind of file, and the times of each."""

import io
import struct
import zlib

import cv2
import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.geometry import Size
from adv2e.side.maps import Maps, decoded, listed
from adv2e.side.placement import Clock, Placement

FLOW = np.arange(24, dtype=np.float32).reshape(3, 4, 2) - 7.25
SAME = Placement(Size(4, 3), Size(4, 3))
CLOCK = Clock(np.array([10, 20, 30], np.int64), ["a.png", "b.png", "c.png"])


def npy(array):
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def png(array):
    return cv2.imencode(".png", array)[1].tobytes()


def test_flow_of_each_kind_is_the_same():
    flo = struct.pack("<fii", 202021.25, 4, 3) + FLOW.tobytes()
    u, v = FLOW[..., 0], FLOW[..., 1]
    kitti = np.stack([u * 0 + 1, v * 64 + 2**15, u * 64 + 2**15], 2).astype(np.uint16)  # BGR
    for data, name in ((npy(FLOW), "a.npy"), (flo, "a.flo"), (png(kitti), "a.png")):
        assert np.array_equal(decoded(data, name, "flow"), FLOW)


def test_flow_that_is_not_known_stays_so():
    kitti = np.full((3, 4, 3), 2**15 + 64, np.uint16)
    kitti[1, 2, 0] = 0
    found = decoded(png(kitti), "a.png", "flow")
    assert np.isnan(found[1, 2]).all()
    assert np.isnan(found).sum() == 2
    head = struct.pack("<fii", 202021.25, 1, 1)
    assert np.isnan(decoded(head + struct.pack("<ff", 1e10, 1e10), "a.flo", "flow")).all()


def test_flow_scales_and_turns_with_the_frames():
    place = Placement(Size(4, 3), Size(8, 12), turned=True, scale=(2.0, 4.0))
    made = Maps("flow", "flow", ["a.npy", "b.npy"], lambda name: npy(FLOW))
    files = dict(made.written(place, CLOCK))
    grown = np.repeat(np.repeat(FLOW[::-1, ::-1], 4, 0), 2, 1) * (-2, -4)
    assert np.array_equal(np.load(io.BytesIO(files["flow/00000001.npy"])), grown)
    times = "0.000000010 0.000000020 flow/00000000.npy\n0.000000020 0.000000030 flow/00000001.npy\n"
    assert files["flow.txt"].decode() == times


@pytest.mark.parametrize(
    "array", [np.eye(3, 4, dtype=np.uint8), np.eye(3, 4, dtype=np.uint16) * 700]
)
def test_masks_and_depth_keep_their_numbers(array):
    for kind in ("masks", "depth"):
        made = Maps(kind, kind, ["c.png", "a.png"], lambda name: png(array))
        files = dict(made.written(SAME, CLOCK))
        assert np.array_equal(decoded(files[f"{kind}/00000000.png"], "a.png", kind), array)
        assert files[f"{kind}.txt"].startswith(b"0.000000030 ")  # c.png is the third frame


def indexed(array, palette, bits):
    """Return a PNG of indices, written by the letter of the specification."""
    rows, columns = array.shape
    flat = np.unpackbits(array[..., None].astype(np.uint8), axis=2)[..., 8 - bits :]
    lines = np.packbits(flat.reshape(rows, -1), axis=1)
    data = zlib.compress(b"".join(b"\0" + line.tobytes() for line in lines))
    head = struct.pack(">IIBBBBB", columns, rows, bits, 3, 0, 0, 0)
    parts = (b"IHDR", head), (b"PLTE", palette.tobytes()), (b"IDAT", data), (b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in parts
    )


@pytest.mark.parametrize("bits", [1, 2, 4, 8])
def test_a_mask_with_a_palette_keeps_its_indices_and_colours(bits):
    draws = np.random.default_rng(bits)
    classes = draws.integers(0, min(2**bits, 21), (3, 4))
    palette = draws.integers(0, 256, (2**bits, 3), dtype=np.uint8)
    file = indexed(classes, palette, bits)
    assert np.array_equal(decoded(file, "a.png", "masks"), classes)
    place = Placement(Size(4, 3), Size(8, 6), turned=True, scale=(2.0, 2.0))
    files = dict(Maps("masks", "m", ["a.png"], lambda name: file).written(place, CLOCK))
    grown = np.repeat(np.repeat(classes[::-1, ::-1], 2, 0), 2, 1)
    made = files["masks/00000000.png"]
    assert np.array_equal(decoded(made, "a.png", "masks"), grown)
    seen = cv2.imdecode(np.frombuffer(made, np.uint8), cv2.IMREAD_COLOR)
    assert np.array_equal(seen[..., ::-1], palette[grown])


def test_files_that_are_of_no_frame_are_not_taken_for_those_of_others():
    """Of four frames, the first two have no mask; nor has a part of them others than the whole."""
    names = [f"{n}.png" for n in range(4)]
    for end in (np.inf, 25):
        clock = Clock(np.arange(0, 40, 10, dtype=np.int64), names, end=end)
        made = Maps("masks", "m", ["2.png", "3.png"], lambda name: png(np.eye(3, 4)))
        lines = dict(made.written(SAME, clock))["masks.txt"].decode().splitlines()
        assert lines[0] == "0.000000020 masks/00000000.png"
        assert len(lines) == (2 if end == np.inf else 1)
        made = Maps("masks", "m", ["2.png", "4.png"], made.read)
        with pytest.raises(DataError, match=r"2 files for 4 frames, and 4\.png has"):
            list(made.written(SAME, clock))


def test_flow_of_the_last_frame_leads_nowhere():
    made = Maps("flow", "flow", ["a.npy", "b.npy", "c.npy"], lambda name: npy(FLOW))
    assert len(dict(made.written(SAME, CLOCK))["flow.txt"].splitlines()) == 2


def test_times_of_a_list_count():
    names, times, told = listed("# t name\n30.5 depth/b.png\n0.5 depth/a.png\n", "depth.txt", 1)
    assert names == ["depth/a.png", "depth/b.png"]
    assert (times.tolist(), told) == ([[500_000_000], [30_500_000_000]], [])
    names, times, told = listed("# from, to\n49599300523, 49599400523\n", "t.txt", 2)
    assert (names, times.tolist()) == ([], [[49599300523000, 49599400523000]])
    assert "taken as us" in told[0]
    made = Maps("depth", "depth", ["a.npy"], lambda name: npy(np.ones((3, 4))), np.array([[25]]))
    assert dict(made.written(SAME, CLOCK))["depth.txt"].startswith(b"0.000000025 ")


def test_the_others_are_carried_if_one_is_damaged():
    files = {"a.png": png(np.eye(3, 4)), "b.png": b"x", "c.png": png(np.eye(3, 4))}
    made, names = Maps("masks", "m", list(files), files.__getitem__), []
    with pytest.raises(DataError, match=r"m/b\.png: not a PNG that can be read; 1 of 3 masks"):
        for name, _ in made.written(SAME, CLOCK):
            names.append(name)
    assert names == ["masks/00000000.png", "masks/00000001.png", "masks.txt"]


@pytest.mark.parametrize(
    ("read", "told"),
    [
        (lambda: decoded(b"", "a.png", "masks"), "a.png: not a PNG"),
        (lambda: decoded(b"abc", "a.flo", "flow"), "a.flo: not a .flo file"),
        (
            lambda: decoded(struct.pack("<fii", 202021.25, 4, 3), "a.flo", "flow"),
            "a.flo: cut short, or not of 4x3 pixels",
        ),
        (lambda: decoded(npy(np.ones(3)), "a.npy", "depth"), "must be .rows, columns"),
        (lambda: decoded(npy(np.ones((3, 4))), "a.npy", "flow"), "must be .rows, columns, 2"),
        (lambda: decoded(png(np.ones((3, 4), np.uint8)), "a.png", "flow"), "three channels"),
        (lambda: listed("1e30 a\n", "l.txt", 1), "l.txt: .* out of range"),
        (lambda: listed("1 2 3\n", "l.txt", 1), "l.txt line 1: must be a time, and a name"),
        (
            lambda: dict(
                Maps("masks", "m", ["q.png"], lambda name: png(np.eye(3))).written(SAME, CLOCK)
            ),
            "m: 1 files for 3 frames",
        ),
        (
            lambda: Maps("masks", "m", ["a.png"], lambda name: png(np.eye(3))).map_of(
                "a.png", SAME
            ),
            "of pictures of 3x3, and the frames are 4x3",
        ),
    ],
)
def test_what_is_no_map_is_refused(read, told):
    with pytest.raises(DataError, match=told):
        read()

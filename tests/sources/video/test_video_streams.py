"""Headers of coded pictures: made up, cut, and at random."""

from __future__ import annotations

import contextlib
import struct
import time

import numpy as np
import pytest
from coded import write

from adv2e.sources.video.colours import Colours
from adv2e.sources.video.containers import Container, examine
from adv2e.sources.video.streams.base import Bits, Stream
from adv2e.sources.video.streams.h264 import H264
from adv2e.sources.video.streams.hevc import Hevc
from adv2e.sources.video.streams.mpeg import MotionJpeg, Mpeg2, Mpeg4

PARSERS = [H264, Hevc, Mpeg2, Mpeg4, lambda: MotionJpeg(480)]


def packed(*fields):
    """Return bytes of (value, bits) fields, the highest bit first."""
    text = "".join(f"{value:0{bits}b}" for value, bits in fields)
    text += "0" * (-len(text) % 8)
    return int(text, 2).to_bytes(len(text) // 8, "big")


def ue(value):
    """Return the field of an unsigned number in the code of Exp-Golomb."""
    return value + 1, 2 * (value + 1).bit_length() - 1


@pytest.mark.parametrize("value", [0, 1, 2, 7, 254, 2**31])
def test_numbers_of_exp_golomb(value):
    bits = Bits(packed((0, 3), ue(value), (5, 3)))
    bits.skip(3)
    assert (bits.ue(), bits.take(3)) == (value, 5)


@pytest.mark.parametrize(("read", "data"), [("ue", bytes(9)), ("flag", b""), ("se", b"\0")])
def test_bits_that_are_missing(read, data):
    with pytest.raises(IndexError):
        getattr(Bits(data), read)()


def parameters_of_h264(frames_only, colours=None, timing=False, fields_in_frames=False):
    """Return a sequence parameter set of baseline profile."""
    fields = [
        (7, 8),
        (66, 8),
        (0, 8),
        (30, 8),
        *(ue(n) for n in (0, 0, 2, 1)),
        (0, 1),
        ue(3),
        ue(2),
    ]
    fields += [(frames_only, 1), *([] if frames_only else [(fields_in_frames, 1)])]
    fields += [(1, 1), (0, 1)]
    if colours is None and not timing:
        return b"\0\0\1" + packed(*fields, (0, 1), (1, 1))
    fields += [(1, 1), (0, 1), (0, 1), (colours is not None, 1)]
    if colours is not None:
        fields += [(5, 3), (0, 1), (1, 1), *((code, 8) for code in colours)]
    fields += [(0, 1), (0, 1), (0, 1), (0, 1), (timing, 1), (0, 1), (1, 1)]
    return b"\0\0\1" + packed(*fields)


def found_by(parser, *pictures, header=b""):
    stream = Stream("")
    parser.header(header, stream)
    for picture in pictures:
        parser.picture(picture, stream)
    return stream


def slice_of_h264(*field):
    """Return a picture parameter set, and a slice of it; `field` has the flag of a field if any."""
    slice_ = packed((1, 8), *(ue(n) for n in (0, 7, 0)), (0, 4), *((bit, 1) for bit in field))
    return b"\0\0\1\x68" + packed(ue(0), ue(0), (1, 1)) + b"\0\0\1" + slice_ + b"\xff"


@pytest.mark.parametrize(
    ("frames_only", "field", "fields"),
    [(True, (), False), (False, (0,), False), (False, (1,), True)],
)
def test_h264_is_fields_where_its_slices_are(frames_only, field, fields):
    parameters = parameters_of_h264(frames_only)
    assert found_by(H264(), parameters).interlaced is False
    assert found_by(H264(), parameters + slice_of_h264(*field)).interlaced is fields


def test_h264_whose_frames_hold_fields():
    parameters = parameters_of_h264(False, fields_in_frames=True)
    assert found_by(H264(), parameters + slice_of_h264(0)).interlaced is True


@pytest.mark.parametrize("frames_only", [True, False])
@pytest.mark.parametrize(
    ("structure", "scan", "fields"),
    [
        *((0, None, False), (1, None, True), (2, None, True), (3, None, True), (4, None, True)),
        *((5, None, False), (6, None, False), (7, None, False), (8, None, False)),
        *((0, 0, False), (0, 1, True), (0, 2, False), (1, 0, True), (3, 0, True), (3, 1, True)),
        *((3, 2, True), (9, None, None)),
    ],
)
def test_h264_whose_timing_tells_of_fields(frames_only, structure, scan, fields):
    message = packed((structure, 4), *([(0, 1)] if scan is None else [(1, 1), (scan, 2)]), (1, 1))
    unit = b"\0\0\1\x06" + bytes([1, len(message)]) + message + b"\x80"
    parameters = parameters_of_h264(frames_only, timing=True, fields_in_frames=True)
    picture = slice_of_h264(*([] if frames_only else [0]))
    if fields is None:  # no such structure: the coding decides
        fields = not frames_only
    assert found_by(H264(), parameters + unit + picture).interlaced is fields


def test_h264_with_lengths_in_place_of_start_codes():
    units = [parameters_of_h264(True, (1, 1, 1))[3:], b"\x65" + b"\0" * 358]
    data = b"".join(struct.pack(">I", len(unit)) + unit for unit in units)
    assert found_by(H264(), data).colours == [Colours(1, 1, 1)]
    # a length that looks like a start code, and what follows it like parameters
    data = struct.pack(">I", 0x167) + b"\x41" + b"\x42" * 0x166
    assert found_by(H264(), data).colours == []
    assert not found_by(H264(), data).interlaced


def test_h264_whose_transfer_is_replaced():
    replaced = b"\0\0\1\x06" + bytes([147, 1, 18, 0x80])
    set_9_14 = parameters_of_h264(True, (9, 14, 9))
    assert found_by(H264(), set_9_14).colours == [Colours(9, 14, 9)]
    for data in (set_9_14 + replaced, replaced + set_9_14):
        assert found_by(H264(), data).colours == [Colours(9, 18, 9)]


def test_what_stands_behind_a_slice_is_not_read():
    parameters = parameters_of_h264(True, (1, 1, 1))
    assert found_by(H264(), slice_of_h264() + parameters).colours == []


@pytest.mark.parametrize(
    ("progressive", "structure", "fields"), [(1, 3, False), (0, 3, True), (0, 1, True)]
)
def test_mpeg2_pictures(progressive, structure, fields):
    sequence = b"\0\0\1\xb5" + packed((1, 4), (0x48, 8), (0, 1), (0, 3))
    picture = b"\0\0\1\xb5" + packed(
        (8, 4), (0, 18), (structure, 2), (0, 8), (progressive, 1), (0, 1)
    )
    shown = b"\0\0\1\xb5" + packed((2, 4), (0, 3), (1, 1), (1, 8), (8, 8), (1, 8))
    found = found_by(Mpeg2(), sequence + shown + picture + b"\0\0\1\x01")
    assert found.interlaced is fields
    assert found.colours == [Colours(1, 8, 1)]


def test_motion_jpeg_of_half_the_height():
    start = b"\xff\xd8\xff\xe0\0\4ab\xff\xc0" + struct.pack(">HBHH", 11, 8, 240, 640)
    assert found_by(MotionJpeg(480), start + bytes(9)).interlaced
    assert not found_by(MotionJpeg(240), start + bytes(9)).interlaced


@pytest.mark.parametrize("make", PARSERS)
def test_bytes_at_random_end_soon_and_in_no_other_error(make):
    rng = np.random.default_rng(5)
    began = time.perf_counter()
    for number in range(300):
        data = bytearray(rng.bytes(int(rng.integers(0, 400))))
        for place in rng.integers(0, 400, 4):
            start = b"\0\0\1" + bytes([rng.choice([0x67, 6, 0x42, 0x4E, 0xB5, 0x20, 0xB6])])
            data[place : place + 4] = start
        if number % 3 == 0:
            data[:] = b"\xff" * number + bytes(data)
        parser, stream = make(), Stream("")
        for read in (parser.header, parser.picture, parser.picture):
            with contextlib.suppress(IndexError, struct.error):
                read(bytes(data), stream)
    assert time.perf_counter() - began < 5


def test_containers_at_random_state_nothing_or_something(tmp_path):
    rng = np.random.default_rng(7)
    path = tmp_path / "clip"
    for magic in (b"\0\0\0\x18ftyp", b"\x1a\x45\xdf\xa3", b"YUV4MPEG2 ", b"RIFF"):
        for _ in range(50):
            body = bytearray(rng.bytes(300))
            for kind in (b"moov", b"trak", b"stsd", b"colr"):
                place = int(rng.integers(0, 280))
                body[place : place + 8] = struct.pack(">I", int(rng.integers(0, 400))) + kind
            path.write_bytes(magic + bytes(body))
            assert isinstance(examine(path, allow_damaged=True), Container)


@pytest.mark.parametrize("suffix", ["mkv", "mp4"])
def test_a_container_that_is_damaged_may_state_what_is_not_read(tmp_path, suffix):
    path = write(tmp_path / f"clip.{suffix}", [60, 90, 120], "mpeg4", tags=(9, 16, 9))
    assert examine(path).colours.transfer == 16
    data = bytearray(path.read_bytes())
    mark = b"\x16\x54\xae\x6b" if suffix == "mkv" else b"stsd"
    data[data.rindex(mark)] ^= 0x40
    path.write_bytes(data)
    assert not examine(path, allow_damaged=True).readable


@pytest.mark.parametrize(
    ("letter", "fields"), [("p", False), ("t", True), ("b", True), ("?", False)]
)
def test_fields_of_y4m(tmp_path, letter, fields):
    path = tmp_path / "clip.y4m"
    path.write_bytes(f"YUV4MPEG2 W4 H4 F25:1 I{letter} C420\nFRAME\n".encode() + bytes(24))
    assert examine(path).interlaced is fields

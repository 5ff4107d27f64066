"""Pictures of two fields are taken whole, and told of."""

from __future__ import annotations

import numpy as np
import pytest
from coded import write

from adv2e.errors import DataError
from adv2e.sources import open_source

RAMP = list(range(25, 115, 3))


def grey(luma):
    """Code of 0..255 for a luma of 16..235."""
    return (luma - 16) * 255 / 219


def values(source):
    return [frame.image for frame in source.frames()]


def assert_ramp(images, lumas, tolerance=1.5):
    assert len(images) == len(lumas)
    for image, luma in zip(images, lumas, strict=True):
        assert np.abs(image - grey(luma)).max() <= tolerance


CODED = {
    "h264.mp4": {"options": {"x264-params": "tff=1"}},
    "h264.mkv": {"options": {"x264-params": "bff=1"}},
    "h264.ts": {"options": {"x264-params": "tff=1"}},
    "mpeg2.ts": {"codec": "mpeg2video", "fields": True},
    "mpeg2.mpg": {"codec": "mpeg2video", "fields": True},
    "mpeg4.avi": {"codec": "mpeg4", "fields": True},
    "prores.mov": {"codec": "prores_ks", "pixels": "yuv422p10le", "fields": True},
    "dv.avi": {"codec": "dvvideo", "size": (720, 576)},
}


def written(folder, name, lumas=RAMP):
    settings = CODED[name]
    deep = "10" in settings.get("pixels", "")
    return write(folder / name, [luma << 2 if deep else luma for luma in lumas], **settings)


@pytest.mark.parametrize("name", CODED)
def test_interlaced_pictures_are_those_in_the_file(tmp_path, name):
    source = open_source(written(tmp_path, name))
    images = values(source)
    if images[0].dtype == np.uint16:
        images = [image / 257 for image in images]
    assert_ramp(images, RAMP)
    assert sum(note.startswith("interlaced") for note in source.notes) == 1
    assert source.packages == ("av",)


@pytest.mark.parametrize("suffix", ["ts", "mkv"])
@pytest.mark.parametrize("fields_first", [False, True])
def test_pictures_that_turn_into_fields_are_those_in_the_file(tmp_path, suffix, fields_first):
    av = pytest.importorskip("av")
    halves = RAMP[:15], RAMP[15:]
    parts = []
    for number, lumas in enumerate(halves):
        options = {"x264-params": "tff=1"} if fields_first == (number == 0) else {}
        path = tmp_path / f"part{number}.ts"
        parts.append(write(path, lumas, options={"bf": "0", **options}, first=15 * number))
    mixed = tmp_path / "mixed.ts"
    mixed.write_bytes(b"".join(part.read_bytes() for part in parts))
    if suffix == "mkv":
        path, stream = tmp_path / "mixed.mkv", mixed
        with av.open(str(stream)) as source, av.open(str(path), "w") as target:
            copied = target.add_stream_from_template(source.streams.video[0])
            for packet in source.demux(video=0):
                if packet.dts is not None:
                    packet.stream = copied
                    target.mux(packet)
        mixed = path
    assert_ramp(values(open_source(mixed)), RAMP)


@pytest.mark.parametrize("suffix", ["mkv", "mp4", "ts"])
def test_frames_in_a_stream_that_could_hold_fields_are_no_fields(tmp_path, suffix):
    options = {"x264-params": "fake-interlaced=1"}
    path = write(tmp_path / f"clip.{suffix}", RAMP, options=options)
    source = open_source(path)
    assert_ramp(values(source), RAMP)
    assert source.notes == []


@pytest.mark.parametrize("suffix", ["mkv", "mp4", "flv"])
def test_fields_cut_out_of_open_groups_of_pictures(tmp_path, suffix):
    av = pytest.importorskip("av")
    options = {"x264-params": "tff=1:open-gop=1:keyint=10:min-keyint=10:scenecut=0:b-adapt=0"}
    whole, path = write(tmp_path / "whole.mp4", RAMP, options=options), tmp_path / f"cut.{suffix}"
    with av.open(str(whole)) as source, av.open(str(path), "w") as target:
        copied = target.add_stream_from_template(source.streams.video[0])
        keys = 0
        for packet in source.demux(video=0):
            keys += packet.is_keyframe
            if keys > 1 and packet.dts is not None:
                packet.stream = copied
                target.mux(packet)
    source = open_source(path, allow_damaged=True)  # pictures that need those cut off
    assert_ramp(values(source)[-15:], RAMP[-15:])
    assert any(note.startswith("interlaced") for note in source.notes)


def test_frames_that_are_timed_as_fields_are_those_in_the_file(tmp_path):
    path = write(tmp_path / "clip.mp4", RAMP, options={"x264-params": "pic-struct=1"})
    whole, halves = bytes.fromhex("06010104 80"), bytes.fromhex("06010132 80")
    data = path.read_bytes()
    assert data.count(whole) == len(RAMP)
    path.write_bytes(data.replace(whole, halves))
    source = open_source(path)
    assert_ramp(values(source), RAMP)
    assert any(note.startswith("interlaced") for note in source.notes)


@pytest.mark.parametrize(
    ("codec", "pixels"),
    [
        *(("libx264", "yuv420p"), ("mpeg2video", "yuv420p"), ("mpeg4", "yuv420p")),
        *(("libx264", "yuv422p"),),
        *(("mjpeg", "yuvj422p"), ("huffyuv", "yuv422p")),
    ],
)
def test_progressive_pictures(tmp_path, codec, pixels):
    full = pixels.startswith("yuvj")
    path = write(tmp_path / "clip.avi", RAMP, codec, pixels, full=full)
    source = open_source(path)
    if full:
        assert [image.mean() for image in values(source)] == pytest.approx(RAMP, abs=1.5)
    else:
        assert_ramp(values(source), RAMP)
    assert source.notes == []


def test_a_damaged_picture_is_passed_over_and_missed(tmp_path):
    path = written(tmp_path, "prores.mov")
    data = bytearray(path.read_bytes())
    place = data.find(b"icpf", len(data) // 2)
    data[place : place + 4] = b"none"
    path.write_bytes(data)
    with pytest.raises(DataError, match="29 frames could be decoded where it states 30"):
        values(open_source(path))
    assert len(values(open_source(path, allow_damaged=True))) == 29

"""Damaged videos are refused, or told of; whole ones are neither."""

from __future__ import annotations

import random

import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.sources import open_source

pytest.importorskip("av", reason="PyAV writes what OpenCV does not")
from video_files import COUNT, av, written

FILES = {
    "clip.mp4": ("libx264", 2, {}),
    "fragments.mp4": ("mpeg4", 0, {"movflags": "frag_keyframe+empty_moov", "frag_duration": "1"}),
    "clip.mov": ("mpeg4", 2, {"movflags": "faststart"}),
    "clip.mkv": ("libx264", 2, {}),
    "live.mkv": ("mpeg4", 2, {"live": "1"}),
    "clip.avi": ("mpeg4", 2, {}),
    "clip.ts": ("libx264", 2, {}),
    "clip.mpg": ("mpeg1video", 2, {}),
    "clip.flv": ("flv", 0, {}),
    "clip.wmv": ("wmv2", 0, {}),
}


@pytest.fixture(params=FILES)
def whole(request, tmp_path):
    codec, reordered, options = FILES[request.param]
    return written(tmp_path / request.param, codec, 30, reordered=reordered, options=options)


def read(path, **options):
    source = open_source(path, **options)
    return source, list(source.frames())


def test_whole_files_are_not_doubted(whole):
    source, frames = read(whole)
    assert len(frames) == COUNT
    assert source.doubts == []


@pytest.mark.parametrize("after", [bytes(100), b"\xff" * 61, bytes(range(1, 200))])
@pytest.mark.parametrize("name", ["clip.mp4", "clip.mov", "clip.avi", "clip.mkv"])
def test_bytes_after_the_end_are_no_damage(tmp_path, name, after):
    codec, reordered, options = FILES[name]
    path = written(tmp_path / name, codec, 30, reordered=reordered, options=options)
    expected = [frame.image.tobytes() for frame in read(path)[1]]
    path.write_bytes(path.read_bytes() + after)
    source, frames = read(path)
    assert [frame.image.tobytes() for frame in frames] == expected
    assert source.doubts == []


def spoiled(data, seed):
    """Return a file cut short or with zeros in the middle."""
    rng = random.Random(seed)
    place = rng.randrange(len(data) // 4, len(data) - 200)
    if seed % 2:
        return data[:place]
    length = rng.choice([200, len(data) // 8, len(data) // 3])
    end = min(place + length, len(data))
    return data[:place] + bytes(end - place) + data[end:]


@pytest.mark.parametrize("seed", range(4))
def test_no_frame_goes_missing_in_silence(whole, seed):
    expected = [frame.t_ns for frame in read(whole)[1]]
    whole.write_bytes(spoiled(whole.read_bytes(), seed))
    try:
        source, frames = read(whole)
    except DataError as error:
        assert str(whole) in str(error)
        assert "\n" not in str(error)
        refused = True
    else:
        assert [frame.t_ns for frame in frames] == expected or source.doubts or source.notes
        refused = False
    try:
        source, frames = read(whole, allow_damaged=True)
    except DataError:
        return  # nothing is left to be decoded
    assert source.doubts or source.notes or not refused
    assert [frame.t_ns for frame in frames] == sorted({frame.t_ns for frame in frames})


@pytest.mark.parametrize("name", ["clip.mkv", "clip.mp4", "clip.avi"])
def test_pictures_lost_in_the_middle_are_counted(tmp_path, name):
    path = written(tmp_path / name, "mpeg4", 30)
    whole = path.read_bytes()
    intact = {frame.t_ns: frame.image.tobytes() for frame in read(path)[1]}
    # headers of three pictures, wherever they stand
    places = [n for n in range(len(whole)) if whole[n : n + 4] == b"\0\0\1\xb6"][20:23]
    data = bytearray(whole)
    for place in places:
        data[place : place + 30] = b"\xff" * 30
    path.write_bytes(data)
    said = rf"{name}: 33 frames could be decoded where it states 36: .*--allow-damaged"
    with pytest.raises(DataError, match=said):
        read(path)
    source, frames = read(path, allow_damaged=True)
    assert len(frames) == 33
    assert "33 frames could be decoded where it states 36" in source.notes[-1]
    if name != "clip.avi":  # which has no times for the others to be at
        assert all(frame.image.tobytes() == intact[frame.t_ns] for frame in frames[:20])
        assert frames[-1].t_ns == max(intact)


def test_conversion_takes_what_is_left(adv2e, tmp_path):
    path = written(tmp_path / "clip.mkv", "mpeg4", 30)
    data = path.read_bytes()
    path.write_bytes(data[: 2 * len(data) // 3])
    out = tmp_path / "events.txt"
    refused = adv2e("convert", path, "-o", out)
    assert (refused.status, refused.err.count("\n")) == (1, 1)
    assert "cut short" in refused.err
    assert not out.exists()
    done = adv2e("convert", path, "-o", out, "--allow-damaged")
    assert done.status == 0
    assert "cut short" in done.err
    told = adv2e("info", path, "--allow-damaged")
    assert told.status == 0
    assert "cut short" in told.out
    assert np.loadtxt(out).shape[1] == 4


def test_pictures_that_the_decoder_guessed_are_damage(tmp_path):
    path = written(tmp_path / "clip.mkv", "mpeg4", 30)
    data = bytearray(path.read_bytes())
    place = data.index(b"\0\0\1\xb6") + 100
    data[place : place + 60] = bytes(60)
    path.write_bytes(data)
    with pytest.raises(DataError, match=r"clip\.mkv: frame 0: it is damaged.*--allow-damaged"):
        read(path)
    source, frames = read(path, allow_damaged=True)
    assert len(frames) == COUNT
    (told,) = [note for note in source.notes if "the decoder met errors in" in note]
    assert told.endswith(f" of {COUNT} frames")
    list(source.frames())
    assert source.notes.count(told) == 1


@pytest.mark.parametrize("name", ["clip.mkv", "clip.flv", "clip.mp4"])
def test_pictures_before_the_first_that_stands_alone_are_no_damage(tmp_path, name):
    path = written(tmp_path / "whole.mp4", "libx264", 30, reordered=2, codec_options={
        "x264-params": "open-gop=1:keyint=12:min-keyint=12:scenecut=0:b-adapt=0"})  # fmt: skip
    with av.open(str(path)) as whole, av.open(str(tmp_path / name), "w") as cut:
        source = whole.streams.video[0]
        stream = cut.add_stream_from_template(source)
        packets = [packet for packet in whole.demux(source) if packet.size]
        keys = [n for n, packet in enumerate(packets) if packet.is_keyframe]
        for packet in packets[keys[1] :]:
            packet.stream = stream
            cut.mux(packet)
    leading = sum(p.pts < packets[keys[1]].pts for p in packets[keys[1] :])
    source, frames = read(tmp_path / name)
    assert leading > 0
    assert len(frames) in (len(packets) - keys[1] - leading, len(packets) - keys[1])
    assert source.doubts == []

"""Headers of video files, with files made byte by byte."""

from __future__ import annotations

import struct

import pytest

from adv2e.errors import DataError
from adv2e.sources.containers import examine


@pytest.fixture
def examined(tmp_path):
    def write(data):
        path = tmp_path / "clip"
        path.write_bytes(data)
        return examine(path)

    return write


def box(kind, *contents):
    data = b"".join(contents)
    return struct.pack(">I4s", 8 + len(data), kind) + data


def element(kind, *contents, size=None):
    data = b"".join(contents)
    return kind + (size or struct.pack(">Q", 1 << 56 | len(data))) + data


UNKNOWN = b"\x01" + b"\xff" * 7
EBML, SEGMENT, CLUSTER = b"\x1a\x45\xdf\xa3", b"\x18\x53\x80\x67", b"\x1f\x43\xb6\x75"


def tracks(*kinds):
    entries = [
        element(b"\xae", element(b"\xd7", bytes([n])), element(b"\x83", bytes([kind])))
        for n, kind in enumerate(kinds, start=1)
    ]
    return element(b"\x16\x54\xae\x6b", *entries)


def block(track, relative, flags=0x80):
    return element(b"\xa3", bytes([0x80 | track]) + struct.pack(">hB", relative, flags) + b"....")


def cluster(ticks, *blocks, size=None):
    return element(CLUSTER, element(b"\xe7", struct.pack(">I", ticks)), *blocks, size=size)


def matroska(*contents, size=None):
    return element(EBML, b"head") + element(SEGMENT, *contents, size=size)


def test_matroska_lists_the_pictures_of_its_video_track_in_order(examined):
    group = element(b"\xa0", element(b"\xa1", b"\x82\x00\x50\x00...."))
    first = cluster(1000, block(2, 0), block(1, 5), block(2, 120), group)
    second = cluster(2000, block(2, -800), block(2, 40, flags=0x08))
    found = examined(matroska(tracks(2, 1), first, second))
    assert found.stamps_ns == [t * 10**6 for t in (1000, 1080, 1120, 1200)]
    assert (found.tick_ns, found.end_ns, found.exact_count) == (10**6, 200 * 10**6, True)


def test_matroska_with_finer_ticks(examined):
    info = element(b"\x15\x49\xa9\x66", element(b"\x2a\xd7\xb1", struct.pack(">I", 1000)))
    found = examined(matroska(info, tracks(1), cluster(7, block(1, 0))))
    assert (found.stamps_ns, found.tick_ns) == ([7000], 1000)


def test_matroska_as_it_is_streamed_states_no_sizes(examined):
    clusters = [cluster(t, block(1, 0), size=UNKNOWN) for t in (0, 40)]
    found = examined(matroska(tracks(1), *clusters, size=UNKNOWN))
    assert found.stamps_ns == [0, 40 * 10**6]


def test_matroska_may_be_followed_by_anything(examined):
    found = examined(matroska(tracks(1), cluster(3, block(1, 0))) + bytes(20))
    assert found.stamps_ns == [3 * 10**6]


@pytest.mark.parametrize("missing", [1, 9, 16])
@pytest.mark.parametrize("size", [None, UNKNOWN])
def test_matroska_cut_short(examined, missing, size):
    data = matroska(tracks(1), cluster(0, block(1, 0), block(1, 40)), size=size)
    with pytest.raises(DataError, match="clip: cut short"):
        examined(data[:-missing])


def test_matroska_whose_parts_do_not_fit(examined):
    large = element(b"\xa3", b"....", size=struct.pack(">Q", 1 << 56 | 40))
    after = cluster(1, block(1, 0), block(1, 9))
    with pytest.raises(DataError, match="clip: damaged at byte"):
        examined(matroska(tracks(1), cluster(0, large), after))
    with pytest.raises(DataError, match="clip: damaged at byte"):
        examined(matroska(tracks(1), bytes(16), after))


def mp4(duration=3000, width=640, version=0):
    if version:
        movie = struct.pack(">B3xQQIQ", 1, 0, 0, 600, 9)
        track = struct.pack(">B3xQQI4xQ", 1, 0, 0, 1, duration)
    else:
        movie = struct.pack(">B3xIIII", 0, 0, 0, 600, 9)
        track = struct.pack(">B3xIII4xI", 0, 0, 0, 1, duration)
    sizes = bytes(52) + struct.pack(">II", width << 16, width << 16)
    sound = box(b"trak", box(b"tkhd", track + bytes(60)))
    video = box(b"trak", box(b"tkhd", track + sizes))
    return box(b"ftyp", b"mp42") + box(b"moov", box(b"mvhd", movie), sound, video)


@pytest.mark.parametrize("version", [0, 1])
def test_mp4_states_when_its_pictures_end(examined, version):
    found = examined(mp4(version=version) + box(b"mdat", bytes(100)))
    assert (found.end_ns, found.exact_count) == (5 * 10**9, True)


def test_mp4_with_a_large_box_and_one_to_the_end(examined):
    large = struct.pack(">I4sQ", 1, b"mdat", 116) + bytes(100)
    assert examined(large + mp4()[12:]).end_ns == 5 * 10**9
    assert examined(mp4() + struct.pack(">I4s", 0, b"mdat") + bytes(50)).end_ns == 5 * 10**9


def test_mp4_with_padding_at_its_end(examined):
    assert examined(mp4() + bytes(64)).end_ns == 5 * 10**9


def test_mp4_in_fragments_states_no_count(examined):
    assert not examined(mp4() + box(b"moof", b"")).exact_count


def test_mp4_without_a_duration(examined):
    assert examined(mp4(duration=0)).end_ns is None


def test_mp4_cut_short(examined):
    with pytest.raises(DataError, match="clip: cut short: it holds"):
        examined((mp4() + box(b"mdat", bytes(100)))[:-1])
    with pytest.raises(DataError, match="clip: cut short or never finished: its index"):
        examined(box(b"ftyp", b"mp42") + box(b"mdat", bytes(100)))


def test_mp4_with_broken_headers(examined):
    broken = box(b"ftyp", b"mp42") + box(b"moov", box(b"mvhd", b"\0"))
    with pytest.raises(DataError, match="clip: its headers are damaged"):
        examined(broken)


def riff(size, kind=b"AVI "):
    return b"RIFF" + struct.pack("<I", size) + kind


def test_avi_of_several_lists(examined):
    assert examined(riff(14) + bytes(10) + riff(20, b"AVIX") + bytes(16)).exact_count
    with pytest.raises(DataError, match="clip: cut short"):
        examined(riff(14) + bytes(10) + riff(20, b"AVIX") + bytes(15))


def test_avi_never_finished_states_nothing(examined):
    assert not examined(riff(0) + bytes(10)).exact_count


def test_other_files_state_nothing(examined):
    found = examined(b"G" * 376)
    assert (found.stamps_ns, found.end_ns, found.exact_count) == (None, None, False)


def test_an_empty_file(examined, tmp_path):
    with pytest.raises(DataError, match="clip: an empty file"):
        examined(b"")
    with pytest.raises(DataError, match="none: No such file"):
        examine(tmp_path / "none")

"""Headers of video files, with files made byte by byte."""

from __future__ import annotations

import struct
from fractions import Fraction

import pytest

from adv2e.errors import DataError
from adv2e.sources.video.containers import examine


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
    assert (found.tick_ns, found.tiny, found.rate) == (10**6, 4, None)


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
    for filling in (bytes(16), b"\xff" * 16):
        with pytest.raises(DataError, match="clip: damaged at byte"):
            examined(matroska(tracks(1), filling, after))


def full(kind, *contents, version=0):
    return box(kind, bytes([version, 0, 0, 0]), *contents)


def table(kind, *rows, version=0):
    """Return a table of 32-bit numbers behind the number of its rows."""
    numbers = [n for row in rows for n in row]
    count = struct.pack(">I", len(rows))
    return full(kind, count, struct.pack(f">{len(numbers)}i", *numbers), version=version)


def track(handler, *tables, scale=1000, edits=b""):
    media = full(b"mdhd", struct.pack(">IIIII", 0, 0, scale, 0, 0))
    who = full(b"hdlr", bytes(4), handler, bytes(12))
    inner = box(b"minf", full(b"hdlr", bytes(4), b"url ", bytes(12)), box(b"stbl", *tables))
    return box(b"trak", edits, box(b"mdia", media, who, inner))


def samples(sizes, offset, durations=((4, 40),), shifts=()):
    """Return the tables of samples that lie in one chunk."""
    return [
        table(b"stts", *durations),
        *([table(b"ctts", *shifts)] if shifts else []),
        full(b"stsz", struct.pack(f">II{len(sizes)}I", 0, len(sizes), *sizes)),
        table(b"stsc", (1, len(sizes), 1)),
        table(b"stco", (offset,)),
    ]


def mp4(tables=None, *, edits=b"", after=b"", sound=True):
    """Return a file of four pictures of 10 bytes, 40 ms apart, whose samples begin at byte 16."""
    movie = full(b"mvhd", struct.pack(">IIII", 0, 0, 600, 9))
    tracks = [track(b"vide", *(tables or samples([10] * 4, 24)), edits=edits)]
    if sound:
        tracks.insert(0, track(b"soun", *samples([3, 4], 64, ((2, 1),))))
    data = box(b"ftyp", b"mp42", bytes(4)) + box(b"mdat", bytes(47))
    return data + box(b"moov", movie, *tracks) + after


def ms(found):
    return [t / 10**6 for t in found.stamps_ns]


def test_mp4_lists_when_its_pictures_are_shown(examined):
    found = examined(mp4())
    assert ms(found) == [0, 40, 80, 120]
    assert (found.tick_ns, found.tiny, found.faults) == (0, 0, [])


def test_mp4_in_the_order_of_decoding(examined):
    shifts = ((1, 40), (1, 80), (1, -10), (1, 0))
    tables = samples([10, 10, 10, 5], 24, ((2, 40), (2, 30)), shifts)
    found = examined(mp4(tables))
    assert ms(found) == [40, 70, 110, 120]
    assert found.tiny == 1


@pytest.mark.parametrize(
    ("edits", "shown"),
    [
        ([(60, 40, 1 << 16)], [40, 80, 120]),  # 100 ms from 40 ms on
        ([(36, 40, 1 << 16)], [40, 80]),
        ([(600, -1, 1 << 16), (48, 0, 1 << 16)], [0, 40]),  # a second of nothing before it
        ([(0, 80, 1 << 16)], [80, 120]),  # to the end
    ],
)
def test_mp4_cut_by_its_edit_list(examined, edits, shown):
    assert ms(examined(mp4(edits=box(b"edts", table(b"elst", *edits))))) == shown


def test_mp4_of_several_pieces_or_videos_is_left_to_the_decoder(examined):
    pieces = box(b"edts", table(b"elst", (10, 0, 1 << 16), (10, 80, 1 << 16)))
    assert examined(mp4(edits=pieces)).stamps_ns is None
    second = track(b"vide", *samples([10], 24, ((1, 40),)))
    movie = full(b"mvhd", struct.pack(">IIII", 0, 0, 600, 9))
    both = box(b"moov", movie, second, second)
    assert examined(box(b"ftyp", b"mp42") + both + bytes(60)).stamps_ns is None


@pytest.mark.parametrize(
    "after",
    [
        bytes(64),
        b"\xff" * 7,
        b"trailing bytes of whatever kind, longer than a box",
        struct.pack(">I4s", 10**6, b"free"),
        struct.pack(">I4s", 10**6, b"uuid") + bytes(16),
        struct.pack(">I4sQ", 1, b"mdat", 10**9),
        struct.pack(">I4s", 0, b"skip") + bytes(9),
    ],
)
def test_mp4_may_be_followed_by_anything(examined, after):
    assert ms(examined(mp4(after=after))) == [0, 40, 80, 120]


def test_mp4_in_fragments_lists_nothing(examined):
    assert examined(mp4(after=box(b"moof", b""))).stamps_ns is None
    with pytest.raises(DataError, match="clip: cut short"):
        examined(mp4(after=box(b"moof", b"") + box(b"mdat", bytes(9))[:-1]))


def test_mp4_cut_short(examined):
    index = mp4()[71:]
    assert index[4:8] == b"moov"
    front = box(b"ftyp", b"mp42", bytes(4)) + index
    shifted = front.replace(struct.pack(">II", 1, 24), struct.pack(">II", 1, len(front) + 8))
    shifted = shifted.replace(struct.pack(">II", 1, 64), struct.pack(">II", 1, len(front) + 48))
    whole = shifted + box(b"mdat", bytes(47))
    assert ms(examined(whole)) == [0, 40, 80, 120]
    with pytest.raises(DataError, match="clip: cut short: it holds"):
        examined(whole[:-1])
    with pytest.raises(DataError, match="clip: cut short or never finished: its index"):
        examined(mp4()[:-1])
    with pytest.raises(DataError, match="clip: cut short or never finished: its index"):
        examined(box(b"ftyp", b"mp42") + box(b"mdat", bytes(100)))


def test_damage_that_is_allowed_is_a_fault(examined, tmp_path):
    (tmp_path / "clip").write_bytes(mp4()[:-1])
    found = examine(tmp_path / "clip", allow_damaged=True)
    assert found.stamps_ns is None
    assert found.faults[0].startswith("cut short or never finished")


def test_mp4_with_broken_headers(examined):
    broken = box(b"ftyp", b"mp42") + box(b"moov", box(b"mvhd", b"\0"))
    with pytest.raises(DataError, match="clip: its headers are damaged"):
        examined(broken)


def riff(*contents, kind=b"AVI ", size=None):
    data = b"".join(contents)
    return b"RIFF" + struct.pack("<I", 4 + len(data) if size is None else size) + kind + data


def chunk(kind, *contents):
    data = b"".join(contents)
    return kind + struct.pack("<I", len(data)) + data + bytes(len(data) % 2)


def listed(kind, *contents):
    return chunk(b"LIST", kind, *contents)


def stream(kind, scale, hz, *more):
    return listed(b"strl", chunk(b"strh", kind, bytes(16), struct.pack("<II", scale, hz)), *more)


HEADERS = listed(b"hdrl", stream(b"auds", 1, 44100), stream(b"vids", 1001, 30000))


def test_avi_states_its_rate_and_lists_its_pictures(examined):
    sizes = [(b"01dc", 90), (b"00wb", 4), (b"01dc", 0), (b"01db", 7), (b"01pc", 5)]
    index = chunk(b"idx1", *(kind + struct.pack("<III", 0, 0, size) for kind, size in sizes))
    found = examined(riff(HEADERS, listed(b"movi", bytes(8)), index))
    assert (found.rate, found.pictures) == (Fraction(30000, 1001), 2)
    assert found.decoding_times


def test_avi_of_several_lists(examined):
    large = riff(HEADERS) + riff(bytes(16), kind=b"AVIX")
    for data in (large, large + b"anything"):
        assert (examined(data).rate, examined(data).pictures) == (Fraction(30000, 1001), None)
    with pytest.raises(DataError, match="clip: cut short"):
        examined(large[:-1])


def test_avi_never_finished_states_nothing(examined):
    assert examined(riff(HEADERS, size=0)).rate is None


Y4M = b"YUV4MPEG2 W6 H3 F30000:1001 Ip A1:1 "


@pytest.mark.parametrize(
    ("layout", "size"),
    [
        (b"", 18 + 12), (b"C420jpeg", 18 + 12), (b"C420mpeg2", 18 + 12), (b"C422", 18 + 18),
        (b"C411", 18 + 12), (b"C444", 54), (b"Cmono", 18), (b"C444alpha", 72),
        (b"C420p10", 60), (b"Cmono16", 36), (b"C444p16 XYSCSS=444P16", 108),
    ],
)  # fmt: skip
def test_y4m_holds_pictures_of_one_size(examined, layout, size):
    data = Y4M + layout + b"\n" + b"".join(b"FRAME Ip\n" + bytes(size) for _ in range(3))
    found = examined(data)
    assert found.stamps_ns == [0, 33_366_667, 66_733_333]
    assert found.rate == Fraction(30000, 1001)
    with pytest.raises(DataError, match="clip: cut short: it holds"):
        examined(data[:-1])
    with pytest.raises(DataError, match="clip: cut short: it holds"):
        examined(data + b"FRA")
    with pytest.raises(DataError, match="clip: damaged after frame 1, at byte"):
        examined(data[: -size - 9] + bytes(size + 9))


def test_y4m_of_another_layout_is_left_to_the_decoder(examined):
    assert examined(Y4M + b"Cyuv2\nFRAME\n" + bytes(9)).stamps_ns is None


def test_other_files_state_nothing(examined):
    found = examined(b"G" * 376)
    assert (found.stamps_ns, found.rate, found.pictures) == (None, None, None)


def test_an_empty_file(examined, tmp_path):
    with pytest.raises(DataError, match="clip: an empty file"):
        examined(b"")
    with pytest.raises(DataError, match="none: No such file"):
        examine(tmp_path / "none")

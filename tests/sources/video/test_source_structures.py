"""Structure of video files without an index of their pictures, with files made byte by byte."""

from __future__ import annotations

import struct

import numpy as np
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


@pytest.fixture
def gif():
    image = (
        b"\x21\xf9\4\0\x0a\0\0\0" + b"\x2c" + struct.pack("<HHHHB", 0, 0, 1, 1, 0) + b"\2\2\x44\1\0"
    )
    return b"GIF89a" + struct.pack("<HHBBB", 1, 1, 0x80, 0, 0) + bytes(6) + 3 * image + b";"


def tag(kind, body):
    head = bytes([kind]) + len(body).to_bytes(3, "big") + bytes(7)
    return head + body + struct.pack(">I", 11 + len(body))


PICTURE = tag(9, b"\x17\1\0\0\0picture")
FLV = b"FLV\1\5" + struct.pack(">II", 9, 0) + tag(18, b"script") + PICTURE + tag(8, b"a") + PICTURE


def page(number, body=b"page", serial=7, flags=0):
    segments = bytes([255, len(body) - 255]) if len(body) > 254 else bytes([len(body)])
    head = struct.pack("<4sBBqII", b"OggS", 0, flags, 0, serial, number)
    rest = bytes([len(segments)]) + segments + body
    return head + bytes(4) + rest


OGG = page(0) + page(0, serial=8) + page(1, bytes(range(100)) * 3) + page(2, flags=4)


def pes(code, body):
    return struct.pack(">3sBH", b"\0\0\1", code, len(body)) + body


PACK = b"\0\0\1\xba\x44" + bytes(8) + b"\xf8"
OLD_PACK = b"\0\0\1\xba\x21" + bytes(7)
PS = PACK + pes(0xBB, b"system") + pes(0xE0, bytes(50)) + b"\0\0" + OLD_PACK + pes(0xC0, b"sound")


def packet(stream, counter, *, announced=False):
    control = 0x30 if announced else 0x10
    head = struct.pack(">BHB", 0x47, stream, control | counter % 16)
    return (head + b"\7\x80" if announced else head).ljust(188, b"\xff")


TS = b"".join(packet(256 + n % 2, n // 2) for n in range(200)) + packet(0x1FFF, 9)


def asf(count=3, size=40, lead=b"\x82", length=10**7, streams=1, flags=0):
    properties = bytes.fromhex("a1dcab8c47a9cf118ee400c00c205365")
    stream = bytes.fromhex("9107dcb7b7a9cf118ee600c00c205365") * streams
    head = bytes.fromhex("3026b2758e66cf11a6d900aa0062ce6c")
    total = 30 + 104 + len(stream) + 50 + count * size
    fields = struct.pack("<Q16xQ8xQQ8xQIIII", 104, total, count, length, 500, flags, size, size, 0)
    body = properties + fields[:88] + stream
    body = body.ljust(104 + len(stream), b"\0")
    data = bytes.fromhex("3626b2758e66cf11a6d900aa0062ce6c") + bytes(34)
    return (
        head + struct.pack("<Q6x", 30 + len(body)) + body + data + (lead.ljust(size, b"p")) * count
    )


def box(kind, *contents):
    data = b"".join(contents)
    return struct.pack(">I4s", 8 + len(data), kind) + data


def fragment(number, samples, track=1):
    run = box(b"traf", box(b"tfhd", struct.pack(">II", 0, track)),
              box(b"trun", struct.pack(">II", 0, samples)))  # fmt: skip
    return box(b"moof", box(b"mfhd", struct.pack(">II", 0, number)), run) + box(b"mdat", bytes(30))


def fragmented(*fragments):
    header = box(b"tkhd", struct.pack(">IIII", 0, 0, 0, 1) + bytes(68))
    handler = box(b"mdia", box(b"hdlr", bytes(8) + b"vide" + bytes(12)))
    movie = box(b"moov", box(b"trak", header, handler))
    return box(b"ftyp", b"iso5") + movie + b"".join(fragments)


FRAGMENTS = fragmented(fragment(1, 4), fragment(2, 9, track=2), fragment(3, 5))


@pytest.mark.parametrize("data", [FLV, PS, asf(), OGG, TS], ids=["flv", "ps", "asf", "ogg", "ts"])
def test_whole_files_are_not_doubted(examined, data):
    found = examined(data)
    assert (found.faults, found.doubts) == ([], [])


def test_images_are_counted(examined, gif):
    assert examined(gif).pictures == 3


def test_times_of_decoding(examined):
    ticks = {asf(): 10**6, PS: 11_112}
    for data, tick_ns in ticks.items():
        found = examined(data)
        assert (found.decoding_times, found.tick_ns) == (True, tick_ns)
    assert examined(b"\0\0\1\xb3" + bytes(90)).decoding_times
    assert not examined(TS).decoding_times


@pytest.mark.parametrize("data", [FLV, OGG, asf(), TS, FRAGMENTS])
@pytest.mark.parametrize("missing", [1, 5, 9])
def test_files_cut_short(examined, data, missing):
    with pytest.raises(DataError, match="clip: cut short: it holds"):
        examined(data[:-missing])


@pytest.mark.parametrize("data", [PS[:-1], PS[:-8], PS + b"\0\0\1\xe0\0", PACK + PACK[:9]])
def test_program_streams_cut_short(examined, data):
    with pytest.raises(DataError, match=r"clip: (cut short: it holds|damaged at byte)"):
        examined(data)


def test_a_program_stream_may_be_filled_with_zeros_to_a_sector(examined):
    assert examined(PS + b"\0\0\1\xb9" + bytes(1000)).faults == []
    with pytest.raises(DataError, match="clip: damaged at byte"):
        examined(PS + bytes(9000))


def without(data, part, place=0):
    found = data.index(part, place)
    return data[:found] + data[found + len(part) :]


@pytest.mark.parametrize(
    "data",
    [
        FLV.replace(PICTURE, bytes(len(PICTURE)), 1),
        without(OGG, page(1, bytes(range(100)) * 3)),
        PS.replace(b"\0\0\1\xe0", bytes(4)),
        asf().replace(b"\x82", b"\0", 2)[: len(asf())],
        TS[: 188 * 7] + bytes(188) + TS[188 * 8 :],
        without(FRAGMENTS, fragment(2, 9, track=2)),
        FRAGMENTS.replace(b"traf", bytes(4), 1),
    ],
)
def test_files_damaged_inside(examined, data):
    with pytest.raises(DataError, match=r"clip: damaged (at|before|between) byte"):
        examined(data)


def test_gif_cut_short_or_followed_by_something(examined, gif):
    with pytest.raises(DataError, match="clip: cut short"):
        examined(gif[:-3])
    assert examined(gif[:-1]).doubts == ["it has no end mark: it may be cut short"]
    assert examined(gif + b"!").doubts == ["bytes follow its end mark: it may be damaged there"]
    last = gif.rindex(b"\x2c\0\0\0\0")
    with pytest.raises(DataError, match="clip: damaged at byte"):
        examined(gif[:last] + bytes(9) + gif[last + 9 :])


def test_ogg_without_an_end_is_doubted(examined):
    assert examined(page(0) + page(1)).doubts == [
        "its last page has no end mark: it may be cut short"
    ]


@pytest.mark.parametrize("lead", [0, 4])
def test_transport_packets_that_are_missing_are_doubted(examined, lead):
    packets = [bytes(lead) + packet(256, n) for n in range(60)]
    assert examined(b"".join(packets)).doubts == []
    assert examined(b"".join([*packets[:9], *packets[8:]])).doubts == []  # sent twice
    (told,) = examined(b"".join([*packets[:9], *packets[11:30], *packets[33:]])).doubts
    assert told.startswith("packets are missing at 2 places")
    announced = [*packets[:9], bytes(lead) + packet(256, 3, announced=True)]
    announced += [bytes(lead) + packet(256, n) for n in range(4, 20)]
    assert examined(b"".join(announced)).doubts == []


def test_counters_of_transport_packets_agree_with_a_slow_count(examined):
    rng = np.random.default_rng(1)
    counters = {stream: int(rng.integers(16)) for stream in (256, 257, 258)}
    expected, packets = 0, []
    for _ in range(300):
        stream = int(rng.choice(list(counters)))
        jump = int(rng.integers(2, 16)) if rng.random() < 0.05 and packets else 1
        seen = any(p[1:3] == struct.pack(">H", stream) for p in packets)
        expected += jump > 1 and seen
        counters[stream] += jump
        packets.append(packet(stream, counters[stream]))
    assert f"at {expected} places" in examined(b"".join(packets)).doubts[0]


def test_asf_states_its_length_where_there_is_no_sound(examined):
    assert examined(asf(length=10**7)).end_ns == 500_000_000
    assert examined(asf(streams=2)).end_ns is None
    assert examined(asf(flags=1)[:-9]).end_ns is None  # broadcast: nothing is stated

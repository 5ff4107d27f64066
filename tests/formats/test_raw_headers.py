"""Headers of RAW files: they tell encoding and geometry, and nothing is guessed without them."""

import event_readers
import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.events import make_events, sort_events
from adv2e.formats.reading import read_events

EVT2 = np.array([8 << 28 | 2, 1 << 28 | 5 << 22 | 3 << 11 | 2], "<u4").tobytes()
EVT3 = np.array([0x8000, 0x6085, 2, 0x2803], "<u2").tobytes()


def read(path, header, words):
    path.write_bytes(header + words)
    return read_events(path)


@pytest.mark.parametrize(
    ("header", "words", "layout", "size"),
    [
        (b"% evt 3.0\n% geometry 1280x720\n", EVT3, "evt3", (1280, 720)),
        (b"% evt 2.0\r\n% geometry 640x480\r\n", EVT2, "evt2", (640, 480)),
        (b"% format EVT3;width=320;height=320\n% end\n", EVT3, "evt3", (320, 320)),
        (b"% format EVT2;height=480;width=640\n% evt 2.0\n% end\n", EVT2, "evt2", (640, 480)),
        (b"% Date 2014-02-28 13:37:42\n% system_ID 49\n% evt 3.0\n% end\n", EVT3, "evt3", (4, 3)),
        (b"% evt 3.0\n% geometry 9999999x1\n% end\n", EVT3, "evt3", (4, 3)),
        (b"% evt 3.0\n% geometry \xff0x\xb2\n% end\n", EVT3, "evt3", (4, 3)),
    ],
)
def test_headers_tell_encoding_and_geometry(tmp_path, header, words, layout, size):
    recording = read(tmp_path / "a.raw", header, words)

    assert recording.layout == layout
    assert (recording.width, recording.height) == size
    assert recording.events.tolist() == [(133, 3, 2, 1)]
    assert [p for p in recording.problems if "no geometry" not in p] == []


@pytest.mark.parametrize(
    ("header", "said"),
    [
        (b"", "events in an encoding that its header does not state; EVT2, EVT21, EVT3 are read"),
        (b"% Date 2014\n% end\n", "an encoding that its header does not state"),
        (b"% evt 4.0\n", "events in EVT4;"),
        (b"% format HISTO3D;width=2;height=2\n", "events in HISTO3D;"),
        (b"% evt 3.0\n% endianness big\n", "EVT3 in big-endian words"),
        (b"% evt 3.0\n% t0 999999999999999999\n", "header: 't0': "),
        (b"% evt 3.0\n% t0 -5\n", "header: 't0' must be a whole number, not '-5'"),
        (b"% evt 3.0", "header: a line, at byte 0, does not end"),
    ],
)
def test_other_encodings_are_refused_by_name(tmp_path, header, said):
    with pytest.raises(DataError) as raised:
        read(tmp_path / "a.raw", header, b"" if header == b"% evt 3.0" else EVT3)

    assert str(raised.value).startswith(f"{tmp_path / 'a.raw'}: ")
    assert said in str(raised.value)


def test_times_of_faery_begin_where_its_header_says(tmp_path):
    faery = pytest.importorskip("faery")
    events = np.zeros(3, faery.EVENTS_DTYPE)
    events["t"], events["x"], events["p"] = [5_000_000, 5_000_700, 9_000_000], [0, 3, 2], [1, 0, 1]
    for version in ("evt2", "evt3"):
        path = tmp_path / f"{version}.raw"
        faery.events_stream_from_array(events, (4, 3)).to_file(path, version=version)

        recording = read_events(path)

        assert recording.layout == version
        assert (recording.width, recording.height) == (4, 3)
        for name in "txyp":
            assert np.array_equal(recording.events[name], events[name])


def test_evt2_of_expelliarmus(tmp_path):
    wizard = pytest.importorskip("expelliarmus").Wizard(encoding="evt2")
    events = np.zeros(400, [("t", "<i8"), ("x", "<i2"), ("y", "<i2"), ("p", "u1")])
    events["t"], events["x"], events["p"] = np.arange(400) * 999, np.arange(400), np.arange(400) % 2
    wizard.save(tmp_path / "a.raw", events)

    recording = read_events(tmp_path / "a.raw")

    assert recording.layout == "evt2"
    for name in "txyp":
        assert np.array_equal(recording.events[name], events[name])


def test_evt2_times_begin_again(tmp_path):
    t = np.array([2**34 - 3, 2**34 + 70, 2**34 + 64, 2**34 + 2**33 + 8, 2**35 + 1])
    words = []
    for number, time in enumerate(t.tolist()):
        words += [8 << 28 | time >> 6 & 0xFFF_FFFF, (time & 63) << 22 | number << 11]
    words += [0xA << 28, 0xE << 28, 0xF << 28]

    recording = read(tmp_path / "a.raw", b"% evt 2.0\n% end\n", np.array(words, "<u4").tobytes())

    assert recording.events["t"].tolist() == sorted(t.tolist())
    assert len(recording.problems) == 2  # geometry, and the step back


def test_evt2_before_the_first_time_is_left_out(tmp_path):
    words = np.array([5 << 22, 8 << 28, 5 << 22 | 1], "<u4").tobytes()

    recording = read(tmp_path / "a.raw", b"% evt 2.0\n% geometry 2x2\n", words)

    assert recording.events.tolist() == [(5, 0, 1, 0)]
    assert recording.problems == ["1 events without a time, row or column before them: left out"]


def evt21(t, x, y, p, order):
    """Words of EVT 2.1, one for each time, row, polarity and group of 32 columns."""
    words, high = [], None
    groups = {}
    for event in zip(t.tolist(), x.tolist(), y.tolist(), p.tolist(), strict=True):
        key = event[0], event[2], event[3], event[1] & ~31
        groups[key] = groups.get(key, 0) | 1 << (event[1] & 31)
    for (time, row, on, column), mask in groups.items():
        if high != time >> 6:
            high = time >> 6
            words.append(0x8 << 60 | (high & 0xFFFFFFF) << 32)
        words.append(on << 60 | (time & 63) << 54 | column << 43 | row << 32 | mask)
    words.append(0xE << 60 | 0x0123456789ABCDE)
    halves = [word.to_bytes(8, "little") for word in words]
    return b"".join(half[4:] + half[:4] if order == "legacy" else half for half in halves)


@pytest.mark.parametrize("order", ["little", "legacy"])
@pytest.mark.parametrize(
    "header",
    [
        "% evt 2.1\n% format EVT21;height=720;width=1280;endianness={}\n% end\n",
        "% evt 2.1\n% geometry 1280x720\n% endianness {}\n",
        "% evt 2.1\n% geometry 1280x720\n% end\n",
        "% format EVT21;height=720;width=1280\n% t0 1468941032229165\n% end\n",
    ],
)
def test_evt21_in_both_orders_of_its_words(tmp_path, order, header):
    draw = np.random.default_rng(0)
    t = np.sort(draw.integers((1 << 34) - 5000, (1 << 34) + 3000, 4000))
    x, y = draw.integers(0, 1280, 4000), draw.integers(0, 720, 4000)
    events = np.unique(make_events(t, x, y, draw.integers(0, 2, 4000)))
    data = evt21(events["t"], events["x"], events["y"], events["p"], order)

    recording = read(tmp_path / "a.raw", header.format(order).encode(), data)

    events["t"] += 1468941032229165 if "t0" in header else 0
    assert recording.layout == "evt21"
    assert (recording.width, recording.height) == (1280, 720)
    assert np.array_equal(np.sort(recording.events), np.sort(events))
    assert recording.problems == []


def test_evt21_is_what_evlib_makes_of_it(tmp_path):
    draw = np.random.default_rng(1)
    t, p = np.sort(draw.integers(0, 90_000, 3000)), draw.integers(0, 2, 3000)
    data = evt21(t, draw.integers(0, 1280, 3000), draw.integers(0, 720, 3000), p, "little")
    header = b"% evt 2.1\n% format EVT21;height=720;width=1280\n% geometry 1280x720\n% end\n"
    ours = read(tmp_path / "a.raw", header, data).events

    _, theirs = event_readers.evlib(tmp_path / "a.raw")

    assert np.array_equal(sort_events(ours.copy()), sort_events(theirs))


def test_evt21_of_a_recording_that_was_cut(tmp_path):
    words = evt21(*(np.array([value]) for value in (70, 33, 5, 1)), "little")
    recording = read(tmp_path / "a.raw", b"% evt 2.1\n% end\n", words[:-3])
    assert recording.events.tolist() == [(70, 33, 5, 1)]
    assert any("5 bytes at the end" in problem for problem in recording.problems)
    alone = read(tmp_path / "a.raw", b"% evt 2.1\n% end\n", words[8:])
    assert alone.events.size == 0
    assert "1 events without a time, row or column before them: left out" in alone.problems


@pytest.mark.parametrize(
    ("name", "version"), [("a.raw", "evt2"), ("a.raw", "evt3"), ("a.dat", "dat2")]
)
def test_times_of_faery_are_those_before_it_took_the_first_off(tmp_path, name, version):
    faery = pytest.importorskip("faery")
    events = np.zeros(5, faery.EVENTS_DTYPE)
    events["t"] = 1468941032229165 + np.array([0, 1, 70, 5000, 2**24 + 9])
    events["x"], events["y"] = [0, 1, 2, 600, 639], [0, 5, 6, 7, 479]
    events["on"] = [1, 0, 1, 1, 0]
    faery.events_stream_from_array(events, (640, 480)).to_file(tmp_path / name, version=version)

    recording = read_events(tmp_path / name)

    assert recording.events.tolist() == [tuple(event) for event in events.tolist()]
    assert recording.problems == []

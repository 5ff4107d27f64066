"""Event Stream as others write it: its header, and bytes that stand between events."""

import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.formats.reading import read_events

HEADER = b"Event Stream\x02\x00\x00\x01\x0a\x00\x08\x00"


def read(path, data, header=HEADER):
    path.write_bytes(header + data)
    return read_events(path)


def event(passed, x, y, p):
    return bytes([passed << 1 | p, x & 255, x >> 8, y & 255, y >> 8])


@pytest.mark.parametrize("events", [1, 100, 3000, 250_000])
@pytest.mark.quick_cases(1)
def test_bytes_that_stand_alone_lie_anywhere(tmp_path, events):
    draw = np.random.default_rng(3)
    x, y, passed, p = (draw.integers(0, n, events).tolist() for n in (10, 8, 127, 2))
    resets, overflows = (np.maximum(0, draw.integers(-3, 4, events)).tolist() for _ in range(2))
    data, t, expected = b"", 0, []
    pieces = []
    for k in range(events):
        pieces.append(b"\xfe" * resets[k] + b"\xff" * overflows[k])
        pieces.append(event(passed[k], x[k], y[k], p[k]))
        t += 127 * overflows[k] + passed[k]
        expected.append((t, x[k], 7 - y[k], p[k]))
    data = b"".join(pieces) + b"\xfe\xff"

    recording = read(tmp_path / "a.es", data)

    assert recording.events.tolist() == expected
    assert (recording.width, recording.height) == (10, 8)
    assert [p for p in recording.problems if "repeat" not in p] == []


def test_coordinates_like_the_bytes_that_stand_alone(tmp_path):
    header = HEADER[:16] + b"\xff\xff\x10\x00"
    data = event(1, 0xFEFE, 3, 1) + event(126, 0xFFFE, 0, 0) + b"\xff" + event(0, 0xFF, 15, 1)

    recording = read(tmp_path / "a.es", data, header)

    assert recording.events.tolist() == [(1, 65278, 12, 1), (127, 65534, 15, 0), (254, 255, 0, 1)]


def test_rows_outside_are_left_out(tmp_path):
    rest = event(1, 9, 7, 1) * 100
    recording = read(tmp_path / "a.es", event(1, 0, 8, 1) + rest)

    assert recording.events.tolist() == [(k, 9, 0, 1) for k in range(2, 102)]
    assert recording.problems == ["1 events with a coordinate below 0 or above 65535: left out"]


def test_a_part_of_an_event_at_the_end_is_told(tmp_path):
    recording = read(tmp_path / "a.es", event(1, 0, 7, 1) + event(1, 9, 7, 1)[:3])

    assert recording.events.tolist() == [(1, 0, 0, 1)]
    assert recording.problems == ["the last 3 bytes are no whole event: left out"]


@pytest.mark.parametrize(
    ("header", "said"),
    [
        (b"Event Stream\x01\x00\x00\x01\x0a\x00\x08\x00", "version 1.0.0, must be 2"),
        (b"Event Stream\x02\x00\x00\x02\x0a\x00\x08\x00", "holds ATIS events, must be DVS events"),
        (b"Event Stream\x02\x00\x00\x09\x0a\x00\x08\x00", "holds events of type 9, must be DVS"),
        (b"Event Stream\x02\x00\x00", "cut short, within the header"),
        (b"Event", "does not begin as Event Stream does"),
    ],
)
def test_others_are_refused(tmp_path, header, said):
    with pytest.raises(DataError) as raised:
        read(tmp_path / "a.es", b"", header)

    assert str(raised.value).startswith(f"{tmp_path / 'a.es'}: ")
    assert said in str(raised.value)


def test_files_of_event_stream(tmp_path):
    library = pytest.importorskip("event_stream")
    events = np.zeros(4, library.dvs_dtype)
    events["t"], events["x"], events["on"] = [3, 130, 130, 2**24 + 9], [0, 9, 3, 1], [1, 0, 0, 1]
    events["y"] = [0, 7, 1, 2]
    with library.Encoder(tmp_path / "a.es", "dvs", 10, 8) as encoder:
        encoder.write(events)

    recording = read_events(tmp_path / "a.es")

    assert sorted(recording.events.tolist()) == sorted(
        (int(t), int(x), 7 - int(y), int(on)) for t, x, y, on in events.tolist()
    )

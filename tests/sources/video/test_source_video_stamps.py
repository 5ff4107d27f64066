"""How the stamps of a capture become times of frames, with captures made up for the purpose."""

from __future__ import annotations

import struct
from fractions import Fraction

import cv2
import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.sources import open_source


def times_of(source):
    return [frame.t_ns for frame in source.frames()]


def at_rate(hz, count):
    return [round(Fraction(n * 10**9) / hz) for n in range(count)]


class Capture:
    """A capture of five small pictures that fails after some of them."""

    def __init__(self, stamps_ms, fails=()):
        self.stamps_ms, self.fails, self.number = stamps_ms, fails, -1

    def isOpened(self):
        return True

    def get(self, key):
        stamp = self.stamps_ms[min(self.number, len(self.stamps_ms) - 1)]
        known = {cv2.CAP_PROP_POS_MSEC: stamp, cv2.CAP_PROP_FPS: 24.0}
        return known.get(key, len(self.stamps_ms) if key == cv2.CAP_PROP_FRAME_COUNT else 0)

    def grab(self):
        self.number += 1
        return self.number < len(self.stamps_ms) and self.number not in self.fails

    def retrieve(self):
        return True, np.full((4, 4, 3), self.number, np.uint8)

    def release(self):
        pass


@pytest.fixture
def fake(monkeypatch, tmp_path):
    """Open a file of an unknown container whose frames a made-up capture provides."""

    def opened(*arguments, data=b"G" * 188):
        monkeypatch.setattr(cv2, "VideoCapture", lambda *_: Capture(*arguments))
        path = tmp_path / "clip.ts"
        path.write_bytes(data)
        return open_source(path)

    return opened


def test_stamps_are_counted_from_the_first(fake):
    assert times_of(fake([1000.0, 1033.4, 1100.0])) == [0, 33_400_000, 100_000_000]


def test_what_stops_and_goes_on_is_read_to_its_end(fake):
    frames = times_of(fake([0.0, 40.0, 80.0, 120.0, 160.0, 200.0], (3, 4)))
    assert frames == [0, 40_000_000, 80_000_000, 200_000_000]


def test_no_frame_at_all(fake):
    with pytest.raises(DataError, match=r"clip\.ts: no frame in it can be decoded"):
        fake([0.0], (0,))


def matroska(*times_ms):
    """Return the smallest Matroska file with empty pictures at these times."""

    def element(kind, data):
        return bytes.fromhex(kind) + struct.pack(">Q", 1 << 56 | len(data)) + data

    blocks = [element("a3", struct.pack(">BhB", 0x81, ms, 0)) for ms in times_ms]
    tracks = element("1654ae6b", element("ae", element("d7", b"\1") + element("83", b"\1")))
    cluster = element("1f43b675", element("e7", b"\0") + b"".join(blocks))
    return element("1a45dfa3", b"") + element("18538067", tracks + cluster)


def test_blocks_that_are_never_shown_do_not_hide_the_rate(fake):
    data = matroska(0, 42, 42, 83, 125, 125, 167)
    source = fake([0.0, 42.0, 83.0, 125.0, 167.0], data=data)
    assert times_of(source) == at_rate(Fraction(24), 5)


def test_a_frame_that_could_not_be_shown_does_not_move_the_others(fake):
    data = matroska(0, 42, 83, 125, 167, 208)
    source = fake([0.0, 42.0, 125.0, 167.0, 208.0], data=data)
    expected = at_rate(Fraction(24), 6)
    assert times_of(source) == [*expected[:2], *expected[3:]]

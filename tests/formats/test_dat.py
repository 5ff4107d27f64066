"""DAT as others write it: its header, types of events, and times that begin again."""

import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.formats.reading import read_events

HEADER = (
    b"% Data file containing CD events.\n% Version 2\n% Date 2019-5-8\n% Height 9\n% Width 20\n"
)


def read(path, words, header=HEADER, kind=b"\x0c\x08"):
    path.write_bytes(header + kind + np.array(words, "<u4").tobytes())
    return read_events(path)


@pytest.mark.parametrize("kind", [b"\x0c\x08", b"\x00\x08"])
def test_header_tells_the_geometry_and_polarities_above_zero_are_on(tmp_path, kind):
    words = [5, 19 | 8 << 14 | 1 << 28, 6, 1 | 2 << 14, 7, 3 | 15 << 28]

    recording = read(tmp_path / "a.dat", words, kind=kind)

    assert recording.events.tolist() == [(5, 19, 8, 1), (6, 1, 2, 0), (7, 3, 0, 1)]
    assert (recording.width, recording.height, recording.problems) == (20, 9, [])


def test_times_begin_again(tmp_path):
    recording = read(tmp_path / "a.dat", [2**32 - 5, 0, 4, 0, 2**31 + 9, 0, 3, 0])

    expected = [2**32 - 5, 2**32 + 4, 2**32 + 2**31 + 9, 2 * 2**32 + 3]
    assert recording.events["t"].tolist() == expected


@pytest.mark.parametrize(
    ("header", "kind", "said"),
    [
        (HEADER.replace(b"n 2", b"n 1"), b"\0\x08", "its header states version 1, must be"),
        (b"% Width 3\n", b"\0\x08", "its header states no version, must be version 2"),
        (b"", b"\0\x08", "does not begin as DAT of Prophesee's cameras does"),
        (HEADER, b"\x28\x08", "type 40 of 8 bytes, must be type 12"),
        (HEADER, b"\x0c\x10", "type 12 of 16 bytes, must be type 12"),
        (HEADER, b"\x0c", f"at byte {len(HEADER)}: cut short, must be type 12"),
        (HEADER + b"% Width many\n", b"\x0c\x08", "'width' must be a whole number, not 'many'"),
    ],
)
def test_others_are_refused(tmp_path, header, kind, said):
    with pytest.raises(DataError) as raised:
        read(tmp_path / "a.dat", [], header, kind)

    assert str(raised.value).startswith(f"{tmp_path / 'a.dat'}: ")
    assert said in str(raised.value)


def test_nothing_behind_the_header_is_no_events(adv2e, tmp_path):
    (tmp_path / "a.dat").write_bytes(HEADER)
    recording = read_events(tmp_path / "a.dat")
    assert recording.events.size == 0
    assert recording.problems == ["nothing follows its header", "no events"]
    made = adv2e("convert", tmp_path / "a.dat", "-o", tmp_path / "b.csv")
    assert (made.status, "nothing follows its header" in made.err) == (0, True)
    assert adv2e("info", tmp_path / "a.dat").status == 0


def test_times_of_faery_begin_where_its_header_says(tmp_path):
    faery = pytest.importorskip("faery")
    events = np.zeros(2, faery.EVENTS_DTYPE)
    events["t"], events["x"], events["p"] = [5_000_000, 9_000_000], [3, 2], [1, 0]
    faery.events_stream_from_array(events, (4, 3)).to_file(tmp_path / "a.dat")

    found = read_events(tmp_path / "a.dat").events

    assert all(np.array_equal(found[name], events[name]) for name in "txyp")


def test_dat_of_expelliarmus(tmp_path):
    wizard = pytest.importorskip("expelliarmus").Wizard(encoding="dat")
    events = np.zeros(3, [("t", "<i8"), ("x", "<i2"), ("y", "<i2"), ("p", "u1")])
    events["t"], events["x"], events["p"] = [1, 70_000, 2**31 + 5], [0, 7, 9], [1, 0, 1]
    wizard.save(tmp_path / "a.dat", events)

    found = read_events(tmp_path / "a.dat").events

    assert all(np.array_equal(found[name], events[name]) for name in "txyp")

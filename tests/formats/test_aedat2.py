"""AEDAT-2.0: addresses of the chips, frames, headers, and what other programs get."""

import event_readers
import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.events import make_events, sort_events
from adv2e.formats.reading import open_events, read_events
from adv2e.formats.writing import write_events

SIZE = 346, 260
DAVIS = b"# AEChip: eu.seebetter.ini.chips.davis.Davis346blue\r\n"
SMALL = b'# adv2e {"adv2e": "9", "width": 12, "height": 7}\r\n'


def write(path, pairs, *lines, first=b"#!AER-DAT2.0\r\n", end=b"#End Of ASCII Header\r\n"):
    data = np.array(pairs, ">u4").tobytes() if len(pairs) else b""
    path.write_bytes(first + b"".join(lines) + end + data)
    return path


def corners(width, height):
    x, y = [0, 0, width - 1, width - 1, 5], [0, height - 1, 0, height - 1, 3]
    return sort_events(make_events([1, 1, 7, 2**24 + 3, 2**31 - 1], x, y, [1, 0, 0, 1, 1]))


@pytest.mark.parametrize("size", [(346, 260), (240, 180)])
def test_eventcv_reads_events_and_leaves_their_columns_turned_round(tmp_path, size):
    write_events(tmp_path / "a.aedat", corners(*size), size)

    stated, found = event_readers.eventcv(tmp_path / "a.aedat")

    found["x"] = size[0] - 1 - found["x"]
    assert stated == size
    assert np.array_equal(sort_events(found), corners(*size))


def test_layout_of_tonic_and_v2e(tmp_path):
    """With the arithmetic of tonic.io.read_davis_346, which needs too much to be installed here."""
    write_events(tmp_path / "a.aedat", corners(*SIZE), SIZE)
    lines, _, data = (tmp_path / "a.aedat").read_bytes().rpartition(b"Header\r\n")
    created = next(line for line in lines.split(b"\r\n") if b"Creation time:" in line)

    words = np.frombuffer(data, np.dtype([("address", ">u4"), ("t", ">u4")]))
    address = words["address"]

    assert int(created.split()[4]) == 0
    found = make_events(
        words["t"],
        (346 - 1) - ((address & 4190208) >> 12),
        (260 - 1) - ((address & 2143289344) >> 22),
        (address & 2048) >> 11,
    )
    assert np.array_equal(found, corners(*SIZE))


@pytest.mark.parametrize("row", range(115, 121))
def test_an_event_that_looks_like_a_line_of_the_header(tmp_path, row):
    events = make_events([5, 6], [1, 3], [row, 4], [1, 0])
    write_events(tmp_path / "a.aedat", events, SIZE)

    assert np.array_equal(read_events(tmp_path / "a.aedat").events, events)
    assert np.array_equal(event_readers.eventcv(tmp_path / "a.aedat")[1]["y"], events["y"])


def test_external_signals_and_inertial_samples_are_left_out(tmp_path):
    pairs = [(1 << 10, 1), (3 << 10 | 1 << 31, 2), (3 << 10, 3), (2 << 10 | 1 << 31, 4)]
    event = (6 << 22 | 11 << 12 | 1 << 11, 5)

    recording = read_events(write(tmp_path / "a.aedat", [*pairs, event], SMALL))

    assert recording.events.tolist() == [(5, 0, 0, 1)]
    assert recording.problems == []


def test_times_begin_again_after_32_bits(tmp_path):
    t = [2**31 - 1, 2**31 + 5, 2**32 - 1, 2**32 + 7]
    pairs = [(number << 12, time % 2**32) for number, time in enumerate(t)]

    recording = read_events(write(tmp_path / "a.aedat", pairs, SMALL))

    assert recording.events["t"].tolist() == t


@pytest.mark.parametrize("chip", [b"# AEChip: ch.unizh.ini.jaer.chip.retina.DVS128\r\n", b""])
def test_dvs128(tmp_path, chip):
    pairs = [(127 << 8 | 127 << 1, 4), (1, 5), (0x8000, 6), (100 << 8 | 3 << 1 | 1, 7)]

    recording = read_events(write(tmp_path / "a.aedat", pairs, chip))

    assert recording.events.tolist() == [(4, 0, 0, 1), (5, 127, 127, 0), (7, 124, 27, 0)]
    assert (recording.width, recording.height) == (128, 128)
    assert bool(recording.problems) == (chip == b"")


@pytest.mark.parametrize(
    ("column", "row", "size"),
    [(239, 179, (240, 180)), (240, 0, (346, 260)), (3, 259, (346, 260)), (346, 1, (640, 480))],
)
def test_without_a_chip_the_smallest_is_taken_and_told(tmp_path, column, row, size):
    pairs = [(row << 22 | column << 12, 9), (5 << 22, 10)]

    recording = read_events(write(tmp_path / "a.aedat", pairs))

    assert (recording.width, recording.height) == size
    assert recording.events.tolist()[0] == (9, size[0] - 1 - column, size[1] - 1 - row, 0)
    assert recording.problems == [
        f"no chip stated: a DAVIS of {size[0]}x{size[1]} pixels taken, the smallest that all"
        " addresses fit"
    ]


@pytest.mark.parametrize(
    ("first", "lines", "said"),
    [
        (
            b"#!AER-DAT3.1\r\n",
            [],
            "AEDAT-3.1, which is not read; iniVation's DV converts it to AEDAT4, which is",
        ),
        (b"#!AER-DAT1.0\r\n", [], "AEDAT-1.0; AEDAT-2.0 is read"),
        (b"#!AER-DAT4.0\r\n", [], "AEDAT-4.0, which is called .aedat4: rename it"),
        (b"# a file\r\n", [], "does not begin with '#!AER-DAT2.0'"),
        (b"#!AER-DAT2.0\r\n", [b"# AEChip: org.Cochlea\r\n"], "of the chip 'org.Cochlea'"),
    ],
)
def test_others_are_refused_by_name(tmp_path, first, lines, said):
    path = write(tmp_path / "a.aedat", [(0, 1)], *lines, first=first)

    with pytest.raises(DataError) as raised:
        read_events(path)

    assert str(raised.value).startswith(f"{path}: ")
    assert said in str(raised.value)


def test_addresses_that_fit_no_chip_are_refused(tmp_path):
    path = write(tmp_path / "a.aedat", [(700 << 12, 1), (500 << 22, 1)])

    with pytest.raises(DataError, match="no chip stated, and addresses of 701x501 pixels"):
        read_events(path)


def samples(reset, signal, *, corner, rolling, begin, step=10):
    """Samples of a frame, read from a corner on, along the columns."""
    height, width = reset.shape
    xs, ys = np.arange(width), np.arange(height)
    x, y = np.meshgrid(xs if corner[0] == 0 else xs[::-1], ys if corner[1] == 0 else ys[::-1],
                       indexing="ij")  # fmt: skip
    columns = []
    for kind, image in enumerate((reset, signal)):
        address = 1 << 31 | y << 22 | x << 12 | kind << 10 | image[height - 1 - y, x]
        columns.append(address.reshape(width, height))
    if rolling:  # the signal of a column is read when three more were reset
        resets, signals = list(columns[0]), list(columns[1])
        order = resets[:3]
        for k in range(width):
            order += [signals[k], *resets[k + 3 : k + 4]]
    else:
        order = [*columns[0], *columns[1]]
    words = np.concatenate(order)
    return np.stack([words, begin + np.arange(words.size) * step], axis=1)


def scene(seed, width=12, height=7):
    draw = np.random.default_rng(seed)
    reset = draw.integers(500, 1024, (height, width))
    return reset, np.minimum(reset, draw.integers(0, 1024, (height, width)))


@pytest.mark.parametrize("corner", [(0, 0), (0, 1), (1, 0), (1, 1)])
@pytest.mark.parametrize("rolling", [False, True])
@pytest.mark.parametrize("lost", [0, 40])
def test_frames(tmp_path, corner, rolling, lost):
    """Also where the recording begins within a frame, and ends within one."""
    pairs = [samples(*scene(k), corner=corner, rolling=rolling, begin=k * 5000) for k in range(4)]
    event = [(3 << 22 | 2 << 12, 4990)]
    pairs = np.concatenate([pairs[0][lost:], event, *pairs[1:3], pairs[3][: -lost or None]])

    recording = read_events(write(tmp_path / "a.aedat", pairs, SMALL))

    kept = range(1, 3) if lost else range(4)
    frames = list(recording.frames())
    assert len(frames) == len(kept)
    for number, frame in zip(kept, frames, strict=True):
        reset, signal = scene(number)
        assert np.array_equal(frame.image, reset - signal)
        assert (frame.image.dtype, frame.white) == (np.uint16, 1023)
        assert frame.t_ns == (number * 5000 + 835) * 1000
    assert recording.light.encoding == "linear"
    assert recording.events.tolist() == [(4990, 9, 3, 0)]
    told = [p for p in recording.problems if "not whole" in p]
    assert len(told) == (1 if lost else 0)


def test_a_frame_of_which_samples_are_lost_is_left_out(tmp_path):
    pairs = [samples(*scene(k), corner=(0, 1), rolling=False, begin=k * 5000) for k in range(3)]
    pairs[1] = np.delete(pairs[1], slice(60, 70), axis=0)

    recording = read_events(write(tmp_path / "a.aedat", np.concatenate(pairs), SMALL))

    assert recording.frame_times_ns.tolist() == [835_000, 10_835_000]
    assert "1 of 3 frames are not whole: left out" in recording.problems


def test_a_frame_with_a_pixel_twice_is_an_error(tmp_path):
    pairs = samples(*scene(0), corner=(0, 1), rolling=False, begin=0)
    pairs[5] = pairs[6]
    file = open_events(write(tmp_path / "a.aedat", pairs, SMALL))

    with pytest.raises(DataError, match="a frame holds some pixels twice"):
        next(file.shots()).load()


def test_colour_is_told(tmp_path):
    pairs = samples(*scene(0, *SIZE), corner=(0, 1), rolling=False, begin=0, step=0)
    chip = b"# AEChip: eu.seebetter.ini.chips.davis.Davis346redColor\r\n"

    recording = read_events(write(tmp_path / "a.aedat", pairs, chip))

    assert (recording.width, recording.height) == SIZE
    assert "frames hold a mosaic of colours, taken as grey" in recording.problems


def test_eventcv_gets_the_same_frames_but_for_the_reset(tmp_path):
    """It takes the signal off what was read after the next reset; jAER, off what was read before.

    Where all resets read the same, the frames are the same.  It leaves the last one out, and its
    times are those of the first signal.
    """
    eventcv = pytest.importorskip("eventcv")
    scenes = [scene(k, *SIZE) for k in range(3)]
    path = tmp_path / "a.aedat"

    def both(resets):
        pairs = [
            samples(reset, signal, corner=(0, 1), rolling=False, begin=k * 400_000, step=1)
            for k, (reset, (_, signal)) in enumerate(zip(resets, scenes, strict=True))
        ]
        write(path, np.concatenate(pairs), DAVIS)
        theirs = eventcv.read_frames(eventcv.open(str(path)))
        assert [t for t, _ in theirs] == [89_960, 489_960]
        return [image.numpy()[0] for _, image in theirs], read_events(path)

    theirs, ours = both([np.full(SIZE[::-1], 1000)] * 3)
    assert ours.frame_times_ns.tolist() == [89_959_500, 489_959_500, 889_959_500]
    for image, frame in zip(theirs, ours.frames(), strict=False):
        assert np.array_equal(image, frame.image)

    theirs, ours = both([reset for reset, _ in scenes])
    for k, (image, frame) in enumerate(zip(theirs, ours.frames(), strict=False)):
        assert np.array_equal(image, (scenes[k + 1][0] - scenes[k][1]).clip(0))
        assert np.array_equal(frame.image, scenes[k][0] - scenes[k][1])

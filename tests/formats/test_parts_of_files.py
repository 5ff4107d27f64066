"""Parts of event files in time and space: each command that reads events takes the same."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from streams import random_events

import adv2e as package
from adv2e.errors import DataError, UsageError
from adv2e.formats import hdf5
from adv2e.formats.event_file import EventFile, Facts
from adv2e.formats.reading import assemble
from adv2e.formats.writing import open_sink
from adv2e.sources.frame import Shot

SIZE = WIDTH, HEIGHT = 12, 9
EVENTS = np.unique(random_events(1, 4000, first=1_000_000, last=2_000_000, size=SIZE))
FRAMES = np.random.default_rng(2).integers(0, 256, (11, HEIGHT, WIDTH), np.uint8)
TIMES_NS = 1_000_000_000 + 100_000_000 * np.arange(11)
FIRST = int(EVENTS["t"][0])
PART = {"start_s": 0.25, "stop_s": 0.6, "crop": (2, 1, 8, 6)}
WORDS = ("--start", "0.25", "--stop", "0.6", "--crop", "2,1,8,6")


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def written(name="a.h5", events=EVENTS, **more):
    more |= {"width": WIDTH, "height": HEIGHT, "metadata": {}, "with_frames": True}
    with open_sink(name, **more) as sink:
        for t_ns, frame in zip(TIMES_NS.tolist(), FRAMES, strict=True):
            sink.write_frame(t_ns, frame)
        sink.write_events(events)
    return name


def cut(events, first, x=2, y=1, columns=8, rows=6):
    """Return the events of PART of a stream that begins at `first`, one by one."""
    return [
        (t, i - x, j - y, p)
        for t, i, j, p in events.tolist()
        if first + 250_000 <= t <= first + 600_000
        if x <= i < x + columns and y <= j < y + rows
    ]


@pytest.mark.parametrize("name", ["a.h5", "a.zip", "a"])
def test_events_and_frames_are_cut_alike(name):
    part = package.read_events(written(name), **PART)
    assert part.events.tolist() == cut(EVENTS, FIRST)
    assert (part.width, part.height) == (8, 6)
    inside = (FIRST * 1000 + 250_000_000 <= TIMES_NS) & (TIMES_NS <= FIRST * 1000 + 600_000_000)
    assert part.frame_times_ns.tolist() == TIMES_NS[inside].tolist()
    for frame, whole in zip(part.frames(), FRAMES[inside], strict=True):
        assert np.array_equal(frame.image, whole[1:7, 2:10])


def test_a_file_read_in_several_pieces_ends_where_it_is_told_to(adv2e, monkeypatch):
    """Also where its times begin below zero, and are moved while it is read."""
    monkeypatch.setattr(hdf5, "PART", 500)
    events = EVENTS.copy()
    events["t"] -= FIRST + 400_000
    words = ("--from", "events", "--t0", "zero", "--stop", "0.6")
    assert adv2e("convert", written(events=events), "-o", "b.h5", *words).status == 0
    assert package.read_events("b.h5").events["t"].tolist() == [
        t - FIRST for t in EVENTS["t"].tolist() if t <= FIRST + 600_000
    ]


def test_frames_are_listed_once():
    """A list may take as long as the events: that of a bag reads every message."""
    listed = []
    facts = Facts(Path("a.bag"))
    facts.state(SIZE, "the test")
    columns = tuple(EVENTS[name] for name in "txyp")
    shots = [Shot(int(t_ns), "a frame", lambda: None) for t_ns in TIMES_NS]
    file = EventFile(
        "bag", facts, lambda: iter([columns]), shots=lambda: listed.append(1) or iter(shots)
    )
    assert len(assemble(file).frame_times_ns) == len(shots)
    assert len(listed) == 1


@pytest.mark.filterwarnings("ignore:.*which size states. left out")
@pytest.mark.parametrize(
    "more", [{}, {"rotate180": True}, {"size": (10, 7), "crop_events": True, "crop": (2, 1, 5, 4)}]
)
def test_what_is_read_is_what_is_copied(more):
    part = package.read_events(written(), **{**PART, **more})
    done = package.convert("a.h5", "b.zip", take="events", **{**PART, **more})
    copied = package.read_events("b.zip")
    assert np.array_equal(copied.events, part.events)
    assert (done.events, done.frames) == (len(part), len(part.frame_times_ns))
    assert (copied.width, copied.height) == (part.width, part.height)
    for one, other in zip(copied.frames(), part.frames(), strict=True):
        assert (one.t_ns, one.image.tolist()) == (other.t_ns, other.image.tolist())


def test_a_part_of_what_is_turned_is_cut_after_that():
    turned = EVENTS.copy()
    turned["x"], turned["y"] = WIDTH - 1 - turned["x"], HEIGHT - 1 - turned["y"]
    part = package.read_events(written(), rotate180=True, **PART)
    assert part.events.tolist() == cut(turned, FIRST)
    first = next(part.frames())
    assert np.array_equal(first.image, np.rot90(FRAMES[3], 2)[1:7, 2:10])


def test_times_count_from_the_earliest_event_of_a_file_out_of_order():
    blocks = np.array_split(EVENTS, 50)
    for k in range(0, 50, 2):
        blocks[k], blocks[k + 1] = blocks[k + 1], blocks[k]
    mixed = np.concatenate(blocks)
    lines = [f"{t / 1e6:.6f} {x} {y} {p}\n" for t, x, y, p in mixed.tolist()]
    Path("a.txt").write_text("12 9\n" + "".join(lines))
    assert mixed["t"][0] > FIRST
    part = package.read_events("a.txt", **PART)
    assert part.events.tolist() == cut(EVENTS, FIRST)
    with pytest.warns(UserWarning, match="not in the order of time"):
        package.convert("a.txt", "b.h5", **PART)
    assert package.read_events("b.h5").events.tolist() == cut(EVENTS, FIRST)


def test_without_events_times_count_from_the_first_frame():
    part = package.read_events(written(events=EVENTS[:0]), start_s=0.25, stop_s=0.5)
    assert part.frame_times_ns.tolist() == TIMES_NS[3:6].tolist()


def test_times_count_from_the_first_event_of_the_track_that_is_named():
    later = EVENTS[EVENTS["t"] > 1_400_000]
    written("a.h5", layout="mvsec")
    written("b.h5", later, layout="mvsec")
    with h5py.File("a.h5", "a") as left, h5py.File("b.h5") as right:
        del left.attrs["adv2e"]
        right.copy("davis/left", left["davis"], "right")
    part = package.read_events("a.h5", track="right", **PART)
    assert part.events.tolist() == cut(later, int(later["t"][0]))


def test_the_part_is_described(adv2e):
    found = json.loads(adv2e("info", written(), "--json", *WORDS).out)
    assert found == json.loads(json.dumps(package.info("a.h5", **PART)))
    expected = cut(EVENTS, FIRST)
    assert (found["width"], found["height"], found["events"]["count"]) == (8, 6, len(expected))
    assert found["events"]["first_us"] == expected[0][0]
    assert found["frames"]["count"] == 4


def test_of_frames_alone_the_part_is_described(adv2e):
    np.save("s.npy", FRAMES)
    found = json.loads(adv2e("info", "s.npy", "--fps", "10", "--json", *WORDS).out)
    assert (found["width"], found["height"]) == (8, 6)
    frames = found["frames"]
    assert (frames["count"], frames["first_ns"], frames["last_ns"]) == (4, 300_000_000, 600_000_000)


def test_windows_of_an_export_begin_with_the_part(adv2e):
    told = adv2e("export", written(), "-o", "out", "--to", "voxel", "--window", "50ms", *WORDS)
    assert told.status == 0, told.err
    bounds = np.loadtxt("out/a/boundary_timestamps.txt")
    assert bounds[:, 1].tolist() == [(FIRST + 250_000 + 50_000 * k) / 1e6 for k in range(6)]
    assert np.load("out/a/event_tensor_0000000000.npy").shape == (5, 6, 8)
    assert json.loads(Path("out/export.json").read_text())["part"] == {
        "start_s": 0.25,
        "stop_s": 0.6,
        "crop": [2, 1, 8, 6],
    }


def test_images_of_an_export_are_of_the_part():
    with pytest.warns(UserWarning, match="4 images; a loader of 40"):
        package.export(written(), "out", "e2vid", valid=0.0, **PART)
    made = package.read_events("out/sequences/a.h5")
    assert made.events.tolist() == cut(EVENTS, FIRST)
    assert made.frame_times_ns.tolist() == TIMES_NS[3:7].tolist()
    assert next(made.frames()).image.tolist() == FRAMES[3, 1:7, 2:10].tolist()


def test_a_picture_is_of_the_part_of_the_sensor():
    part = package.read_events(written(), crop=PART["crop"])
    given = {"start_s": 0.25, "stop_s": 0.6, "count": 2, "scale": 3}
    drawn = package.render("a.h5", crop=PART["crop"], **given)
    assert np.array_equal(drawn, package.render(part, **given))
    assert drawn.shape[0] < package.render("a.h5", **given).shape[0]


COMMANDS = {
    "info": (),
    "convert": ("--from", "events", "-o", "b.h5"),
    "export": ("--to", "voxel", "--count", "9", "-o", "out"),
    "render": ("-o", "b.png"),
    "view": (),
    "compare": ("a.h5",),
    "diagnose": ("-o", "found"),
}


@pytest.mark.parametrize("command", COMMANDS)
def test_parts_that_cannot_be_are_one_line(command, adv2e):
    written()
    for words, status, text in (
        (("--start", "9"), 1, "leave no event of its 0.99"),
        (("--crop", "9,0,8,6"), 1, "--crop 9,0,8,6 does not lie on the sensor of 12x9 pixels"),
        (("--start", "0.5", "--stop", "0.2"), 2, "--stop 0.2 must be after --start 0.5"),
    ):
        told = adv2e(command, "a.h5", *COMMANDS[command], *words)
        assert (told.status, told.err.count("\n")) == (status, 1), told.err
        known = text if status == 2 or command not in ("render", "view", "diagnose") else ""
        assert known in told.err
    assert [path.name for path in Path().iterdir()] == ["a.h5"]


def test_a_quiet_part_is_told_as_empty():
    busy = EVENTS[(EVENTS["x"] != 3) | (EVENTS["t"] < 1_200_000)]
    package.write_events("a.h5", busy, SIZE)
    with pytest.raises(DataError, match="start_s, stop_s and crop leave no event of its"):
        package.read_events("a.h5", start_s=0.3, crop=(3, 0, 1, 9))
    with pytest.raises(DataError, match="leave no event"):
        package.convert("a.h5", "b.h5", start_s=0.3, crop=(3, 0, 1, 9))
    with pytest.raises(UsageError, match="start_s: must be seconds"):
        package.read_events("a.h5", start_s=-1)


def test_a_frame_too_small_for_the_part_is_named():
    with open_sink("a.h5", width=4, height=3, metadata={}, with_frames=True) as sink:
        sink.write_frame(0, FRAMES[0, :3, :4])
    part = package.read_events("a.h5", size=SIZE, crop=(2, 1, 8, 6))
    with pytest.raises(DataError, match="crop 2,1,8,6 is not inside its 4x3 pixels"):
        list(part.frames())

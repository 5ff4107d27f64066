"""A point marked in the frames lies where the frames show it: all fits, crops and turns."""

import json
from fractions import Fraction

import cv2
import numpy as np
import pytest
from sequences import HEIGHT, LINEAR, STEP_NS, WIDTH, expected, found, middle, plain, write_frames

from adv2e import convert, read_events
from adv2e.geometry import Rectangle, Size
from adv2e.side.placement import Clock, Placement
from adv2e.sources.base import Selection

COUNT = 4


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """A sequence whose square has a box, a mask, flow, and is at the principal point in frame 1."""
    folder = tmp_path_factory.mktemp("marked")
    times = write_frames(folder, COUNT)
    for kind in ("masks", "flow"):
        (folder / kind).mkdir()
    images, boxes = [], []
    for number, t_ns in enumerate(times):
        x, y = middle(number)
        images.append({"id": number + 7, "file_name": f"{t_ns}.png"})
        box = [x - 1.5, y - 2.5, 3, 5]
        boxes.append({"id": number, "image_id": number + 7, "bbox": box, "category_id": 3})
        mask = np.zeros((HEIGHT, WIDTH), np.uint8)
        mask[int(y) - 4 : int(y) + 5, int(x) - 4 : int(x) + 5] = 9
        cv2.imwrite(str(folder / "masks" / f"{t_ns}.png"), mask)
        flow = np.zeros((HEIGHT, WIDTH, 2), np.float32)
        flow[mask > 0] = (2.0, 1.0)
        if number + 1 < COUNT:
            np.save(folder / "flow" / f"{t_ns}.npy", flow)
    (folder / "boxes.json").write_text(json.dumps({"images": images, "annotations": boxes}))
    x, y = middle(1)
    (folder / "calib.txt").write_text(f"80 90 {x - 0.5} {y - 0.5} -0.1 0.01 0.002 0.003 0\n")
    return folder


PLACES = [
    {},
    {"turned": True},
    {"crop": (7, 3, 80, 50)},
    {"size": (48, 32)},
    {"size": (48, 48), "fit": "crop"},
    {"size": (40, 40), "fit": "pad"},
    {"size": (70, 30), "fit": "stretch"},
    {"size": (130, 100), "fit": "crop"},
    {"size": (61, 44), "fit": "pad", "turned": True, "crop": (9, 5, 77, 51)},
    {"size": (50, 53), "fit": "crop", "turned": True, "crop": (9, 1, 77, 61)},
]


@pytest.mark.parametrize("place", PLACES, ids=str)
def test_a_point_lies_where_the_frames_show_it(source, place, tmp_path):
    config = ["ideal", LINEAR]
    if "fit" in place:
        config.append({"sensor": {"fit": place["fit"]}})
    done = convert(
        source,
        tmp_path / "out",
        config,
        size=place.get("size"),
        crop=place.get("crop"),
        rotate180=place.get("turned", False),
    )
    out = tmp_path / "out"
    boxes = np.load(out / "boxes_bbox.npy")
    assert len(boxes) == COUNT
    scale = np.divide(expected((9, 9), **place), 1) - expected((8, 8), **place)
    for number in range(COUNT):
        frame = cv2.imread(str(out / f"images/frame_{number:08d}.png"), cv2.IMREAD_GRAYSCALE)
        assert frame.shape == (done.height, done.width)
        shown, point = found(frame), expected(middle(number), **place)
        assert shown == pytest.approx(point, abs=0.1)  # the drawing itself
        box = boxes[number]
        centre = box["x"] + box["w"] / 2, box["y"] + box["h"] / 2
        assert centre == pytest.approx(point, abs=1e-3)
        assert box["w"] == pytest.approx(3 * abs(scale[0]), abs=1e-3)
        mask = cv2.imread(str(out / f"masks/{number:08d}.png"), cv2.IMREAD_UNCHANGED)
        rows, columns = np.nonzero(mask == 9)
        assert set(np.unique(mask)) <= {0, 9}
        assert (columns.mean() + 0.5, rows.mean() + 0.5) == pytest.approx(point, abs=0.5)
        if number + 1 < COUNT:  # flow leads from the square to the next one
            flow = np.load(out / f"flow/{number:08d}.npy")
            step = flow[int(point[1]), int(point[0])]
            after = expected(middle(number + 1), **place)
            assert step == pytest.approx(np.subtract(after, point), abs=1e-4)
    intrinsics = np.loadtxt(out / "calib.txt")
    at_1 = expected(middle(1), **place)
    assert intrinsics[2:4] + 0.5 == pytest.approx(at_1, abs=1e-6)
    assert intrinsics[:2] == pytest.approx(np.abs(scale) * (80, 90), rel=1e-6)
    sign = -1 if place.get("turned") else 1
    assert intrinsics[4:] == pytest.approx([-0.1, 0.01, sign * 0.002, sign * 0.003, 0])


def test_a_shift_of_the_frames_moves_points_as_it_moves_their_events(source, tmp_path):
    still = ["ideal", LINEAR]
    convert(source, tmp_path / "a.h5", still)
    moved = [*still, {"frames": {"shift_px": [3.0, -2.0]}}]
    convert(source, tmp_path / "b.h5", moved)
    places = []
    for name in ("a.h5", "b.h5"):
        events = read_events(tmp_path / name).events
        box = np.load(tmp_path / f"{name}.side" / "boxes_bbox.npy")[1]
        places.append((events["x"].mean() - box["x"], events["y"].mean() - box["y"]))
    assert places[0] == pytest.approx(places[1], abs=1e-6)
    assert read_events(tmp_path / "a.h5").events["x"].mean() - 3 == pytest.approx(
        events["x"].mean()
    )


@pytest.mark.parametrize(
    ("frames", "options"),
    [
        ({}, {}),
        ({"clock_offset_us": 1234.5}, {}),
        ({"clock_drift_ppm": 70_000.0, "clock_offset_us": -321.0}, {}),
        ({"clock_drift_ppm": -20_000.0}, {"start_s": 0.01, "t0": "zero"}),
        ({}, {"fps": 37}),
        ({"clock_drift_ppm": 500.0}, {"fps": "30000/1001"}),
    ],
    ids=str,
)
def test_a_time_goes_where_events_go(frames, options, tmp_path):
    """The events of plain frames are the marks: their times in a table end where events end."""
    folder = tmp_path / "sequence"
    write_frames(folder, COUNT)
    part = {name: value for name, value in options.items() if name == "start_s"}
    config = ["ideal", LINEAR, {"max_events": 10**7}]
    convert(folder, tmp_path / "plain.h5", config, t0="keep", **part)
    marks = read_events(tmp_path / "plain.h5").events["t"]
    lines = "".join(f"{t}000 0 0 {n} 0 0 0\n" for n, t in enumerate(marks.tolist()))
    (folder / "imu.txt").write_text("# time[ns] ax ay az gx gy gz\n" + lines)
    convert(folder, tmp_path / "out.h5", [*config, {"frames": frames}], **options)
    ends = np.sort(read_events(tmp_path / "out.h5").events["t"])
    times, rest = plain((tmp_path / "out.h5.side" / "imu.txt").read_text())
    assert len(times) == len(ends) == len(marks)
    assert rest[:, 2].tolist() == [str(n) for n in range(len(marks))]
    # each time is rounded to a microsecond, before it is stretched and after
    stretched = STEP_NS * float(Fraction(options["fps"])) / 1e9 if "fps" in options else 1
    off = [
        abs(Fraction(t, 1000) - end) for t, end in zip(times.tolist(), ends.tolist(), strict=True)
    ]
    assert max(off) <= 0.5 / min(stretched, 1) + 0.6


def test_times_of_frames_go_where_a_rate_puts_these(tmp_path):
    folder = tmp_path / "sequence"
    stamps = write_frames(folder, COUNT)
    lines = "".join(f"{t} 0 0 0 0 0 0\n" for t in stamps)
    (folder / "imu.txt").write_text("# time[ns] ax ay az gx gy gz\n" + lines)
    convert(folder, tmp_path / "out", ["ideal", LINEAR], fps="30000/1001")
    times, _ = plain((tmp_path / "out" / "imu.txt").read_text())
    frames, _ = plain((tmp_path / "out" / "images.txt").read_text())
    assert times.tolist() == frames.tolist() == [0, 33366667, 66733333, 100100000]


def test_a_cut_leaves_what_lies_within(tmp_path):
    folder = tmp_path / "sequence"
    times = write_frames(folder, 6)
    stamps = np.arange(times[0] - 5_000_000, times[-1] + 5_000_001, 1_000_000)
    lines = "".join(f"{t} 0 0 0 0 0 0 1\n" for t in stamps.tolist())
    (folder / "groundtruth.txt").write_text("# t[ns] px py pz qx qy qz qw\n" + lines)
    convert(folder, tmp_path / "out.h5", ["ideal", LINEAR], start_s=0.012, stop_s=0.041)
    kept, _ = plain((tmp_path / "out.h5.side" / "groundtruth.txt").read_text())
    inside = (stamps >= times[0] + 12_000_000) & (stamps <= times[0] + 41_000_000)
    assert kept.tolist() == stamps[inside].tolist()


def test_nearest_points_outside_the_frame_are_filled():
    place = Placement(Size(4, 2), Size(4, 4), origin=(0.0, -1.0))
    taken = place.taken(np.arange(1, 9).reshape(2, 4))
    assert taken.tolist() == [[0] * 4, [1, 2, 3, 4], [5, 6, 7, 8], [0] * 4]
    assert place.points((1, 1)).tolist() == [1, 2]
    cut = Placement.of(Size(4, 2), Selection(crop=Rectangle(1, 1, 2, 1), rotate180=True))
    assert cut.taken(np.arange(1, 9).reshape(2, 4)).tolist() == [[3, 2]]


def test_a_clock_that_is_replaced_goes_on_beyond_its_frames():
    own, used = np.array([0, 10, 30], np.int64), np.array([100, 200, 300], np.int64)
    times, _ = Clock(used, own=own).of([-5, 0, 5, 20, 40])
    assert times.tolist() == [50, 100, 150, 250, 350]

"""Boxes of each kind come out where they lie in the frames; what is cut, and what is refused."""

import json

import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.geometry import Size
from adv2e.side.boxes import of_coco, of_mot, of_prophesee, of_yolo
from adv2e.side.placement import Clock, Placement

WHOLE = Size(100, 50)
SAME = Placement(WHOLE, WHOLE)
CLOCK = Clock(np.array([1000, 2000, 3000], np.int64) * 1000, ["a/x1.png", "a/x2.png", "a/x3.png"])


def rows(boxes, place=SAME, clock=CLOCK):
    return [tuple(map(float, box)) for box in boxes.placed(place, clock)[0].tolist()]


def coco(**more):
    images = [{"id": 5, "file_name": "b/x2.jpg", "width": 100, "height": 50, **more}]
    box = {"id": 1, "image_id": 5, "bbox": [10, 20, 30, 15], "category_id": 4, "track_id": 8}
    return {"images": images, "annotations": [box], "categories": [{"id": 4, "name": "car"}]}


def test_all_kinds_say_the_same():
    found = (2000, 10, 20, 30, 15, 4)
    assert rows(of_coco(json.dumps(coco()).encode(), "a"))[0] == (*found, 8, 1)
    assert rows(of_mot(b"2,8,11,21,30,15,0.5,4,1\n", "a"))[0] == (*found, 8, 0.5)
    yolo = {"labels/x2.txt": b"4 0.25 0.55 0.3 0.3\n", "labels/x3.txt": b"\n"}
    assert rows(of_yolo(yolo, "a"))[0] == (*found, 0, 1)


def test_boxes_of_prophesee_are_carried_by_their_times(tmp_path):
    fields = [("ts", "<u8"), ("x", "<f4"), ("y", "<f4"), ("w", "<f4"), ("h", "<f4")]
    fields += [("class_id", "u1"), ("confidence", "<f4"), ("track_id", "<u4")]
    times = [1_500_000_000_000_003, 1_500_000_000_000_001]
    np.save(tmp_path / "a.npy", np.array([(t, 1, 2, 3, 4, 1, 0.25, 7) for t in times], fields))
    found = of_prophesee((tmp_path / "a.npy").read_bytes(), "a")
    made, ns = found.placed(SAME, CLOCK)
    assert made["t"].tolist() == sorted(times)
    assert ns.tolist() == [t * 1000 for t in sorted(times)]
    assert made[0].tolist() == (times[1], 1, 2, 3, 4, 1, 7, 0.25)


def test_what_is_written_is_read_again():
    found = of_coco(json.dumps(coco()).encode(), "a")
    files = dict(found.written(SAME, CLOCK))
    again = of_coco(files["boxes.json"], "b")
    made, _ = again.placed(SAME, CLOCK)
    assert again.classes == {4: "car"}
    assert made.tobytes() == found.placed(SAME, CLOCK)[0].tobytes()
    image = json.loads(files["boxes.json"])["images"][0]
    assert image["t_ns"] == 2_000_000


def test_a_box_is_cut_where_the_sensor_ends():
    place = Placement(WHOLE, Size(20, 10), origin=(20.0, 15.0))
    boxes = of_mot(b"1,1,11,21,30,15,1,0\n1,2,1,1,15,10,1,0\n", "a")
    assert rows(boxes, place) == [(1000, 0, 5, 20, 5, 0, 1, 1)]


def test_a_cut_of_time_leaves_boxes_out():
    clock = Clock(CLOCK.frames, begin=2_000_000, end=2_500_000)
    boxes = of_mot(b"1,1,1,1,5,5\n2,2,1,1,5,5\n3,3,1,1,5,5\n", "a")
    assert [box[6] for box in rows(boxes, clock=clock)] == [2]


@pytest.mark.parametrize(
    ("read", "told"),
    [
        (lambda: of_coco(b"[]", "a.json"), "a.json: not boxes of COCO"),
        (lambda: of_coco(b"{", "a.json"), "a.json: not boxes of COCO"),
        (lambda: of_coco(json.dumps(coco(id=9)).encode(), "a.json"), "KeyError: 5"),
        (lambda: of_mot(b"1,2,3\n", "gt.txt"), "gt.txt line 1: must be 6 numbers, or more"),
        (lambda: of_mot(b"1,2,3,4,5,6\n1,2,3,4,5,b\n", "gt.txt"), "gt.txt line 2"),
        (lambda: of_yolo({"a.txt": b"0 0.5 0.5 20 20\n"}, "a"), "a.txt: .* shares of the frame"),
        (lambda: of_prophesee(b"x", "a.npy"), "a.npy: not a .npy array"),
        (lambda: rows(of_coco(json.dumps(coco(width=90)).encode(), "a.json")), "90x50"),
        (lambda: rows(of_mot(b"4,1,1,1,5,5\n", "gt.txt")), "a box of frame 4 of 3"),
        (lambda: rows(of_yolo({"q.txt": b"0 .5 .5 .1 .1\n"}, "q")), "1 files for 3 frames"),
    ],
)
def test_what_are_no_boxes_is_refused(read, told):
    with pytest.raises(DataError, match=told):
        read()

"""Flow that is given moves the frames: also what is too fast to be found."""

import cv2
import numpy as np
import pytest

from adv2e import convert, read_events, simulate
from adv2e.config.model import Sampling
from adv2e.errors import ConfigError, DataError
from adv2e.light.interpolation import make_upsampler
from adv2e.motion.estimate import estimate_motion

ROWS, COLUMNS, SIDE, STEP = 64, 160, 12, 30
"""A patch that moves by more than twice its own size, over ground at rest."""

GIVEN = {"sampling": {"interpolation": "given"}}
CONFIG = ["ideal", {"frames": {"encoding": "linear"}}]


def frame(place):
    """Return the scene with the patch at a column, whole or not."""
    rows, columns = np.indices((ROWS, COLUMNS))
    ground = 80 + 30 * np.sin(0.9 * rows) * np.sin(0.7 * columns)
    patch = 200 - 6.0 * (rows - 20) + 3 * np.sin(1.3 * (columns - place))
    inside = np.clip(np.minimum(columns + 0.5 - place, place + SIDE - columns + 0.5), 0, 1)
    inside *= (rows >= 20) & (rows < 20 + SIDE)
    return (ground + inside * (patch - ground)).astype(np.float32)


def flow_from(place, step=STEP):
    flow = np.zeros((ROWS, COLUMNS, 2), np.float32)
    flow[20 : 20 + SIDE, int(place) : int(place) + SIDE, 0] = step
    return flow


def test_what_is_too_fast_to_be_found_is_moved_where_its_flow_is_given():
    a, b = frame(10), frame(10 + STEP)
    errors = {}
    for kind, given in (("given", lambda number: flow_from(10)), ("flow", None), ("linear", None)):
        made = list(make_upsampler(Sampling(interpolation=kind, L=5), given=given).between(a, b))
        truth = [frame(10 + STEP * share) for share in (0.2, 0.4, 0.6, 0.8)]
        errors[kind] = np.mean([np.abs(m - t).mean() for m, t in zip(made, truth, strict=False)])
    assert errors["given"] < 0.15 * min(errors["flow"], errors["linear"])


def test_ground_that_comes_into_view_is_told_from_gaps_between_pixels():
    a, b = frame(10), frame(10 + STEP)
    there, back = estimate_motion(a, b, flow_from(10))
    assert np.array_equal(there.u[20:32, 10:22], np.full((12, 12), STEP, np.float32))
    assert np.array_equal(back.u[21:31, 41:51], np.full((10, 10), -STEP, np.float32))
    assert np.all(back.u[20:32, 12:20] == 0)  # the ground's own motion: it was covered before
    unknown = flow_from(10)
    unknown[40:50] = np.nan
    assert np.all(estimate_motion(a, b, unknown)[0].u[40:50] == 0)


@pytest.fixture
def folder(tmp_path):
    return write(tmp_path / "frames", [10, 40, 70, 100])


def write(folder, places, change=lambda array: array):
    """Write frames and flow of the patch at these columns."""
    (folder / "flow").mkdir(parents=True)
    for number, place in enumerate(places):
        image = np.ascontiguousarray(change(np.rint(frame(place)).astype(np.uint8)))
        cv2.imwrite(str(folder / f"{number:03d}.png"), image)
        if number + 1 < len(places):
            flow = change(flow_from(place, places[number + 1] - place))
            np.save(folder / "flow" / f"{number:03d}.npy", flow)
    return folder


def events(source, output, config=GIVEN, **options):
    convert(source, output, [*CONFIG, config], fps=20, overwrite=True, **options)
    return read_events(output).events


def counts(found):
    made = np.zeros((ROWS, COLUMNS))
    np.add.at(made, (found["y"], found["x"]), 1)
    return made


def test_events_of_a_conversion_are_nearer_to_the_truth(folder, tmp_path):
    dense = tmp_path / "dense"
    dense.mkdir()
    for number, place in enumerate(np.arange(10, 100.01, 0.5)):
        cv2.imwrite(str(dense / f"{number:04d}.png"), np.rint(frame(place)).astype(np.uint8))
    convert(dense, tmp_path / "truth.h5", CONFIG, fps=20 * 60)
    truth = counts(read_events(tmp_path / "truth.h5").events)
    off = {}
    for kind in ("given", "flow"):
        config = {"sampling": {"interpolation": kind, "L": 60}}
        off[kind] = np.abs(counts(events(folder, tmp_path / "a.h5", config)) - truth).sum()
    assert off["given"] < 0.5 * off["flow"]


def test_flow_is_turned_and_cut_as_the_frames_are(folder, tmp_path):
    turned = events(folder, tmp_path / "a.h5", rotate180=True, crop=(20, 4, 120, 56))
    twin = tmp_path / "twin"
    (twin / "flow").mkdir(parents=True)
    for number in range(4):
        image = cv2.imread(str(folder / f"{number:03d}.png"), cv2.IMREAD_GRAYSCALE)
        part = np.ascontiguousarray(image[::-1, ::-1][4:60, 20:140])
        cv2.imwrite(str(twin / f"{number:03d}.png"), part)
        if number < 3:
            flow = -np.load(folder / "flow" / f"{number:03d}.npy")[::-1, ::-1][4:60, 20:140]
            np.save(twin / "flow" / f"{number:03d}.npy", flow)
    assert turned.tobytes() == events(twin, tmp_path / "b.h5").tobytes()
    assert turned.tobytes() != events(folder, tmp_path / "c.h5", crop=(20, 4, 120, 56)).tobytes()


def test_a_part_has_the_flow_of_its_own_frames(tmp_path):
    whole = write(tmp_path / "whole", [10, 40, 55, 95])
    part = events(whole, tmp_path / "a.h5", start_s=0.05, t0="zero")
    alone = write(tmp_path / "alone", [40, 55, 95])
    assert part.tobytes() == events(alone, tmp_path / "b.h5").tobytes()


def test_flow_of_other_times_or_none_is_refused(folder, tmp_path):
    (folder / "flow" / "001.npy").rename(folder / "flow" / "003.npy")
    with pytest.raises(DataError, match=r"no flow from .*001\.png to the next frame"):
        events(folder, tmp_path / "a.h5")
    with pytest.raises(DataError, match="given needs pictures, or a stack, with flow beside them"):
        events(folder, tmp_path / "a.h5", side="none")
    (folder / "flow.txt").write_text("0.0 0.05 flow/000.npy\n0.07 0.1 flow/002.npy\n")
    with pytest.raises(DataError, match="flow: its times are not those of the frames"):
        events(folder, tmp_path / "a.h5")
    with pytest.raises(ConfigError, match="given is for 'adv2e convert'"):
        next(simulate([frame(10) / 255, frame(40) / 255], fps=20, config=[*CONFIG, GIVEN]))

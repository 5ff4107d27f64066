"""Estimates against what conversions then make."""

import cv2
import numpy as np
import pytest
from pictures import picture

from adv2e import convert
from adv2e.conversion import estimate as module
from adv2e.conversion.estimate import Estimate, estimate, may_be_much
from adv2e.errors import DataError
from adv2e.formats.frames import open_frames


def video(path, count, size=(96, 64)):
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"FFV1"), 30, size)
    for k in range(count):
        writer.write(cv2.cvtColor(cv2.resize(picture(k), size), cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


def folder(path, count):
    """Make a recording whose frames come at uneven times, and whose motion is not the same."""
    (path / "images").mkdir(parents=True)
    times = np.cumsum(np.random.default_rng(1).uniform(0.02, 0.06, count))
    lines = []
    for k in range(count):
        cv2.imwrite(str(path / "images" / f"{k:04}.png"), cv2.resize(picture(k), (96, 64)))
        lines.append(f"{times[k]:.6f} images/{k:04}.png\n")
    (path / "images.txt").write_text("".join(lines))
    return path


def seen_of(found):
    """Return how many frames an estimate is made from, and of how many."""
    seen, frames = found.basis.removesuffix(" frames").split(" of ")
    return int(seen), int(frames)


@pytest.mark.thorough
@pytest.mark.parametrize("make", [video, folder])
@pytest.mark.parametrize("part", [{}, {"start_s": 0.5, "stop_s": 2.5}])
@pytest.mark.parametrize("name", ["a.h5", "a.txt"])
def test_the_estimate_is_near_what_is_made(tmp_path, monkeypatch, make, part, name):
    monkeypatch.setattr(module, "_PART_PIXELS", 20 * 96 * 64)
    source = make(tmp_path / ("in.avi" if make is video else "in"), 120)
    found = estimate(source, name, "adv2e", threads=1, **part)
    made = convert(source, tmp_path / name, "adv2e", threads=1, **part)
    seen, frames = seen_of(found)
    assert frames == made.frames
    assert 30 < seen < 70  # not all
    assert found.events == pytest.approx(made.events, rel=0.1)
    assert found.bytes == pytest.approx((tmp_path / name).stat().st_size, rel=0.1)
    assert found.seconds > 0


@pytest.mark.parametrize("share", [0.1, 0.3])
@pytest.mark.quick_cases(1)
def test_a_share_of_the_frames_is_enough_or_nothing_is_told(tmp_path, share):
    source = video(tmp_path / "in.avi", 120)
    found = estimate(source, "a.h5", "adv2e", threads=1, share=share)
    made = convert(source, tmp_path / "a.h5", "adv2e", threads=1)
    assert seen_of(found)[0] <= share * 120
    assert found.events == pytest.approx(made.events, rel=0.5)
    assert estimate(source, "a.h5", "adv2e", threads=1, share=0.05) is None


@pytest.mark.parametrize("count", [2, 3, 5])
@pytest.mark.quick_cases(1)
def test_of_few_frames_all_are_seen(tmp_path, count):
    source = folder(tmp_path / "in", count)
    found = estimate(source, "a.h5", "adv2e", threads=1)
    # not the same events: references are at random
    assert seen_of(found) == (count, count)
    made = convert(source, tmp_path / "a.h5", "adv2e", threads=1)
    assert found.events == pytest.approx(made.events, rel=0.5)


def test_only_what_is_very_much_is_told(tmp_path, monkeypatch):
    source = open_frames(video(tmp_path / "in.avi", 4))
    assert not may_be_much(source)
    source.count = module._LARGE // (96 * 64) + 1
    assert may_be_much(source)
    monkeypatch.setattr(module, "free_bytes", lambda folder: 50e9)
    assert not Estimate(1e9, 9e9, 60, "").is_much(tmp_path)
    found = Estimate(4.321e9, 18e9, 4000, "60 of 9000 frames")
    told = "about 4,300,000,000 events, 18.0GB and 1:06:40, by 60 of 9000 frames"
    assert found.is_much(tmp_path)
    assert found.text(tmp_path) == told
    assert Estimate(4e10, 160e9, 4000, "").text(tmp_path).endswith("; there is room for 50.0 GB")
    # however little it is, if there is no room for it
    monkeypatch.setattr(module, "free_bytes", lambda folder: 1e6)
    assert Estimate(1e6, 4e6, 1, "").is_much(tmp_path)
    assert "room for 0.0 GB" in Estimate(1e6, 4e6, 1, "").text(tmp_path)


def test_the_command_tells_what_will_be_very_much(adv2e, tmp_path, monkeypatch):
    source = video(tmp_path / "in.avi", 30)
    call = ("convert", source, "-o", tmp_path / "a.h5", "--overwrite", "--threads", 1)
    assert "about" not in adv2e(*call).err
    monkeypatch.setattr(module, "_LARGE", 1000)
    monkeypatch.setattr(module, "MUCH", 1000)
    done = adv2e(*call)
    assert done.status == 0
    assert " events, " in done.err
    assert "of 30 frames" in done.err


def test_amounts_are_rounded(tmp_path):
    told = Estimate(123456, 5.1e6, 75, "").text(tmp_path)
    assert told.startswith("about 120,000 events, 5.10MB and 01:15")


@pytest.mark.thorough
def test_more_events_than_max_events_are_an_error_that_leaves_nothing(adv2e, tmp_path):
    source = video(tmp_path / "in.avi", 30)
    done = adv2e("convert", source, "-o", tmp_path / "a.h5", "--set", "max_events=1000")
    assert done.status == 1
    assert "max_events: more than 1,000 events were made by " in done.err
    assert done.err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["in.avi"]
    made = convert(source, tmp_path / "b.h5", "adv2e")
    again = convert(source, tmp_path / "c.h5", {"max_events": made.events})
    assert again.events == made.events
    with pytest.raises(DataError, match="max_events"):
        convert(source, tmp_path / "d.h5", {"max_events": made.events - 1})

"""Recordings that can be diagnosed, and what is said of those that cannot."""

import re
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest

from adv2e.config import load_config
from adv2e.config.model import Sensor
from adv2e.diagnosis.data.evidence import LEAST_EVENTS, part_of, read_evidence
from adv2e.diagnosis.recordings import how_far
from adv2e.errors import DataError
from adv2e.geometry import Rectangle

WIDTH, HEIGHT = 12, 8


@pytest.fixture
def record(tmp_path):
    """Write a DAVIS240C folder; images and lines as given."""

    def write(images=None, times=None, events=2000, span=(0.0, 0.09), sizes=(WIDTH, HEIGHT)):
        folder = tmp_path / "recording"
        (folder / "images").mkdir(parents=True)
        draw = np.random.default_rng(1)
        if images is None:
            images = [np.full((HEIGHT, WIDTH), 20 * k, np.uint8) for k in range(10)]
        times = 0.01 * np.arange(len(images)) if times is None else times
        lines = []
        for k, (t, image) in enumerate(zip(times, images, strict=True)):
            assert cv2.imwrite(str(folder / f"images/{k}.png"), image)
            lines.append(f"{t:.9f} images/{k}.png\n")
        (folder / "images.txt").write_text("".join(lines))
        t = np.sort(draw.integers(int(span[0] * 1e6), int(span[1] * 1e6), events))
        text = (
            f"{us / 1e6:.9f} {draw.integers(sizes[0])} {draw.integers(sizes[1])} {us % 2}\n"
            for us in t.tolist()
        )
        (folder / "events.txt").write_text("".join(text))
        return folder

    return write


def grey(shape=(HEIGHT, WIDTH), kind=np.uint8):
    return np.full(shape, 7, kind)


def complaint(adv2e, folder):
    """Return what `adv2e diagnose` says of a recording: one line; and nothing is left."""
    status, out, err = adv2e("diagnose", folder, "-o", folder.parent / "found", "--threads", 1)
    assert (status, out) == (1, "")
    assert err.count("\n") == 1
    assert err.startswith("adv2e: error: ")
    assert str(folder) in err
    assert not (folder.parent / "found").exists()
    return err


def test_frames_and_events_are_on_one_clock(record):
    evidence = read_evidence(record(times=5.0 + 0.01 * np.arange(10), span=(4.9, 5.2), events=9000))
    assert (evidence.width, evidence.height) == (WIDTH, HEIGHT)
    assert len(evidence.frames) == 10
    assert evidence.seconds == pytest.approx(0.09)
    assert evidence.times_ns == [5_000_000_000 + 10_000_000 * k for k in range(10)]
    stream = evidence.stream
    assert stream.t.min() >= 5_000_000
    assert stream.t.max() < 5_090_000
    (masked,) = evidence.masked
    assert masked.share == pytest.approx(1 - len(stream) / 9000)
    assert masked.share == pytest.approx(0.7, abs=0.03)


def test_a_part_holds_its_frames_and_events_and_what_pixels_saw_before(record):
    whole = read_evidence(record(times=5.0 + 0.01 * np.arange(10), span=(5.0, 5.09), events=9000))
    part = part_of(whole, 0.03, 0.07, Rectangle(2, 1, 8, 6))
    assert part.times_s == pytest.approx(5.0 + 0.01 * np.arange(3, 8))
    assert (part.width, part.height) == (8, 6)
    assert [frame.shape for frame in part.frames] == [(6, 8)] * 5
    assert (part.stream.t.min() >= 5_030_000) and (part.stream.t.max() < 5_070_000)
    x, y = whole.stream.pixel % WIDTH, whole.stream.pixel // WIDTH
    inside = (x >= 2) & (x < 10) & (y >= 1) & (y < 7)
    inside &= (whole.stream.t >= 5_030_000) & (whole.stream.t < 5_070_000)
    assert len(part.stream) == np.count_nonzero(inside)
    assert 0 < len(part.run_in.times_s) <= 3
    assert part.masked[-1].share == pytest.approx(1 - inside.mean())
    assert part_of(whole) is whole


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--start", "0.08"), "leave 2 of its 10 frames, which last 0.09 s; at least 3"),
        (("--stop", "0.001"), "leave 1 of its 10 frames"),
        (("--start", "9"), "leave 0 of its 10 frames"),
        (("--crop", "0,0,13,8"), "--crop 0,0,13,8 does not lie on the sensor of 12x8 pixels"),
        (("--crop", "0,0,2,2"), "in the part that is asked for; at least 1000"),
    ],
)
def test_a_part_that_cannot_be_is_refused(adv2e, record, words, said):
    folder = record()
    outcome = adv2e("diagnose", folder, "-o", folder.parent / "found", *words)
    assert (outcome.status, outcome.err.count("\n")) == (1, 1)
    assert said in outcome.err
    assert adv2e("diagnose", folder, "--start", "2", "--stop", "1").status == 2


def test_how_far_a_diagnosis_is_tells_its_stage_and_an_estimate():
    told = how_far("searching", 600, 60.0)
    assert (
        told == "searching: 600 simulations in 60 s; about 60 s more where one effect explains all"
    )
    assert "takes longer" in how_far("searching", 5000, 600.0)
    assert how_far("reading", 0, 31.0) == "reading: 0 simulations in 31 s"


def test_nothing_is_masked_between_the_frames(record):
    evidence = read_evidence(record())
    assert evidence.masked == []
    assert len(evidence.stream) == 2000


@pytest.mark.parametrize(
    ("span", "kept", "which"),
    [
        ((0.0, 0.125), (0, 13), "0.07 s at the last frames"),
        ((0.061, 0.2), (6, 20), "0.06 s at the first frames"),
        ((0.061, 0.125), (6, 13), "0.06 s at the first frames and 0.07 s at the last frames"),
    ],
)
def test_frames_that_the_events_do_not_cover_are_set_aside(record, span, kept, which):
    images = [np.full((HEIGHT, WIDTH), 10 * k, np.uint8) for k in range(21)]
    evidence = read_evidence(record(images=images, span=span))
    first, last = kept
    assert evidence.times_s == pytest.approx(0.01 * np.arange(first, last + 1))
    assert [int(frame[0, 0]) // 10 for frame in evidence.frames] == list(range(first, last + 1))
    before = [int(frame[0, 0]) // 10 for frame in evidence.run_in.frames]
    assert before == list(range(max(first - (last - first) // 2, 0), first))
    assert evidence.run_in.times_s == pytest.approx(0.01 * np.array(before))
    (masked,) = evidence.masked
    assert masked.what == f"{which}, which the events do not cover"
    assert len(evidence.stream) == 2000


def test_a_pause_at_the_end_like_others_is_one(record):
    folder = record(images=[np.full((HEIGHT, WIDTH), 10 * k, np.uint8) for k in range(21)])
    with (folder / "events.txt").open("a") as text:
        text.write("0.120000000 1 1 1\n")
    assert len(read_evidence(folder).frames) == 21


def test_light_is_as_declared(record):
    evidence = read_evidence(record())
    linear, srgb = (load_config([], [f"frames.encoding={name}"]) for name in ("linear", "srgb"))
    assert evidence.light(linear)[:, 0, 0].tolist() == pytest.approx([20 * k for k in range(10)])
    assert evidence.light(srgb)[5, 0, 0] < 50
    assert evidence.light(linear).shape == (10, HEIGHT, WIDTH)
    assert evidence.quantum_dn(linear) == 1.0
    white = load_config([], ["frames.full_scale=510"])
    assert evidence.quantum_dn(white) == 0.5


def test_colour_frames_of_a_camera_are_linear_as_in_a_conversion(record):
    shades = [np.full((HEIGHT, WIDTH, 3), 20 * k, np.uint8) for k in range(10)]
    evidence = read_evidence(record(shades))
    assert evidence.frames[0].ndim == 3
    light = evidence.light(load_config())
    np.testing.assert_allclose(light[:, 0, 0], 20.0 * np.arange(10), atol=0.1)
    curved = load_config([], ["frames.encoding=srgb"])
    assert evidence.light(curved)[5, 0, 0] < 60.0


def test_step_of_16_bit_frames(record):
    evidence = read_evidence(record([np.full((HEIGHT, WIDTH), k, np.uint16) for k in range(10)]))
    assert evidence.quantum_dn(load_config()) == pytest.approx(255 / 65535)


def test_there_is_no_such_recording(adv2e, tmp_path):
    err = complaint(adv2e, tmp_path / "nowhere.zip")
    assert "no such file" in err


def test_no_frames(adv2e, record):
    folder = record()
    (folder / "images.txt").unlink()
    assert "holds no frames" in complaint(adv2e, folder)


def test_too_few_frames(adv2e, record):
    folder = record([grey(), grey()], span=(0.0, 0.01))
    assert "holds 2 frames, at least 3 are needed" in complaint(adv2e, folder)


@pytest.mark.parametrize("events", [0, LEAST_EVENTS - 1])
def test_too_few_events(adv2e, record, events):
    err = complaint(adv2e, record(events=events))
    assert f"{events} events between its first and its last frame" in err
    assert str(LEAST_EVENTS) in err


def test_as_few_events_as_can_be(record):
    assert len(read_evidence(record(events=LEAST_EVENTS)).stream) == LEAST_EVENTS


def test_events_at_another_time(adv2e, record):
    said = complaint(adv2e, record(span=(50.0, 60.0)))
    assert re.search(r"events come from 50\.\d+ to 59\.\d+ s, frames from 0\.000 to \d", said)
    assert "one clock" in said


def test_a_list_out_of_order_is_put_in_order(record):
    images = [np.full((HEIGHT, WIDTH), k, np.uint8) for k in (0, 60, 30, 90)]
    evidence = read_evidence(record(images, [0, 0.06, 0.03, 0.09]))
    assert [image[0, 0] for image in evidence.frames] == [0, 30, 60, 90]
    np.testing.assert_allclose(evidence.times_s, [0, 0.03, 0.06, 0.09])


def test_two_frames_at_one_time(adv2e, record):
    folder = record([grey()] * 4, [0, 0.01, 0.01, 0.02])
    assert "images.txt line 3: times must increase" in complaint(adv2e, folder)


def test_frames_out_of_order(adv2e, tmp_path):
    path = tmp_path / "recording.h5"
    with h5py.File(path, "w") as file:
        draw = np.random.default_rng(2)
        for name, high in (("xs", WIDTH), ("ys", HEIGHT), ("ps", 2)):
            file[f"events/{name}"] = draw.integers(0, high, 2000).astype(np.int16)
        file["events/ts"] = np.sort(draw.random(2000)) * 0.03
        file.attrs["sensor_resolution"] = (HEIGHT, WIDTH)
        for k, t in enumerate((0.0, 0.02, 0.01, 0.03)):
            file[f"images/image{k:09d}"] = grey()
            file[f"images/image{k:09d}"].attrs["timestamp"] = t
    assert "frame 2 is not later than the one before it" in complaint(adv2e, path)


def test_frames_of_another_size_than_the_events_say(adv2e, record, monkeypatch):
    from adv2e.diagnosis.data import evidence

    read = evidence.read_events

    def wider(path, **options):
        recording = read(path, **options)
        object.__setattr__(recording, "width", 50)
        return recording

    monkeypatch.setattr(evidence, "read_events", wider)
    assert "frames have 12x8 pixels, events 50x8" in complaint(adv2e, record())


@pytest.mark.parametrize(
    ("odd", "text"),
    [
        (grey((HEIGHT, WIDTH + 1)), "frame 3 is 13x8 grey uint8, frame 0 is 12x8 grey uint8"),
        (grey((HEIGHT, WIDTH, 3)), "frame 3 is 12x8 colour uint8, frame 0 is 12x8 grey uint8"),
        (grey(kind=np.uint16), "frame 3 is 12x8 grey uint16, frame 0 is 12x8 grey uint8"),
    ],
)
def test_frames_that_are_not_alike(adv2e, record, odd, text):
    images = [np.full((HEIGHT, WIDTH), 9, np.uint8)] * 3 + [odd] + [grey()]
    assert text in complaint(adv2e, record(images, span=(0.0, 0.04)))


def test_a_broken_image(adv2e, record):
    folder = record()
    Path(folder / "images/4.png").write_bytes(b"nothing")
    assert "4.png" in complaint(adv2e, folder)


def test_a_recording_of_another_size_than_the_declared_sensor_is_refused(record):
    path = record()
    assert read_evidence(path, sensor=Sensor(width=WIDTH, height=HEIGHT)).width == WIDTH
    told = rf"events of {WIDTH}x{HEIGHT} pixels, but .* a sensor of {HEIGHT}x{WIDTH};"
    with pytest.raises(DataError, match=told):
        read_evidence(path, sensor=Sensor(width=HEIGHT, height=WIDTH))


def test_the_sensor_that_a_shipped_configuration_declares_counts(adv2e, record):
    path = record()
    words = ("-o", path.parent / "found", "-c", "davis346")
    status, _, err = adv2e("diagnose", path, *words)
    assert status == 1
    assert err.count("\n") == 1
    assert "but the configuration says a sensor of 346x260" in err
    assert "--set sensor=null" in err
    assert not (path.parent / "found").exists()

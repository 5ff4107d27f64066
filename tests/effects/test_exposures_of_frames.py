"""Exposures of their own for each frame: lists with start and end, and what is done with them."""

import cv2
import numpy as np
import pytest

from adv2e import convert, read_events
from adv2e.effects.frames.exposure_blur import ExposureBlurHooks
from adv2e.effects.frames.motion_blur import MotionBlurHooks
from adv2e.errors import DataError
from adv2e.sources.times.lists import parse_list

STEP_NS = 5_000_000


def restored(hooks, frames):
    return [light for _, light in hooks.light(iter(frames))]


def test_the_middle_is_the_time():
    text = "# exposure_start_timestamp_us, exposure_end_timestamp_us\n1000, 1600\n51000, 51200\n"
    stamps = parse_list(text, "a").stamps
    assert [(one.t_ns, one.exposure_ns) for one in stamps] == [
        (1_300_000, 600_000),
        (51_100_000, 200_000),
    ]
    named = parse_list("name start[ns] end[ns]\nb.png 30 50\na.png 0 10\n", "a").stamps
    assert [(one.name, one.t_ns, one.exposure_ns) for one in named] == [
        ("a.png", 5, 10),
        ("b.png", 40, 20),
    ]


def test_an_exposure_ends_after_it_starts():
    with pytest.raises(DataError, match="a line 3: the exposure ends before it starts"):
        parse_list("start end\n0.1 0.2\n0.3 0.25\n", "a")
    with pytest.raises(DataError, match="'x' is not a number"):
        parse_list("start end name\n0.1 0.2 a\n0.3 x b\n0.4 .5 c\n", "a")


def test_each_frame_is_sharpened_by_its_own_exposure_along_the_motion():
    rows, columns = np.indices((48, 64))
    frames = [
        (n * STEP_NS, (60 + 50 * np.sin(0.3 * (columns - 2 * n)) + rows).astype(np.float32))
        for n in range(5)
    ]
    each = [0.0, 4000.0, 1000.0, 2500.0, 4000.0]
    made = restored(MotionBlurHooks(0.0, each), frames)
    for number, exposure_us in enumerate(each):
        alone = restored(MotionBlurHooks(exposure_us), frames)
        assert np.array_equal(made[number], alone[number])
    assert not np.array_equal(made[1], restored(MotionBlurHooks(1000.0), frames)[1])


def test_each_frame_is_sharpened_by_its_own_exposure_in_time():
    """Light is averaged here over each exposure, in fine steps; the nearer, the better."""
    count, random = 90, np.random.default_rng(1)
    each = np.where(np.arange(count) % 2, 24_000.0, 6_000.0)
    phase = random.uniform(0, 6, 20)

    def light(t_ns):
        return 100 + 80 * np.sin(t_ns * 1e-9 * 2 * np.pi * 15 + phase)

    frames, truth = [], []
    for number, exposure_us in enumerate(each):
        t_ns = number * STEP_NS
        within = t_ns + np.linspace(-0.5, 0.5, 401) * exposure_us * 1e3
        mean = np.mean([light(t) for t in within], axis=0)
        frames.append((t_ns, mean.reshape(4, 5)))
        truth.append(light(t_ns).reshape(4, 5))

    def error(hooks):
        made = restored(hooks, frames)
        assert len(made) == count
        return np.mean([np.abs(made[k] - truth[k]) for k in range(10, count - 10)])

    own = error(ExposureBlurHooks(0.0, each.tolist()))
    assert own < 0.4 * error(ExposureBlurHooks(float(each.mean())))
    same = [12_000.0] * count
    for a, b in zip(
        restored(ExposureBlurHooks(0.0, same), frames),
        restored(ExposureBlurHooks(12_000.0), frames),
        strict=True,
    ):
        assert np.array_equal(a, b)


@pytest.fixture
def stack(tmp_path):
    noise = np.random.default_rng(3).uniform(0, 255, (48, 120))
    scene = cv2.GaussianBlur(noise, (0, 0), 2.0) * 3 - 250
    frames = [np.clip(scene[:, 2 * n : 2 * n + 64], 10, 250) for n in range(12)]
    path = tmp_path / "stack.npy"
    np.save(path, np.array(frames, np.float32) / 255)
    return path


@pytest.mark.parametrize("interpolation", ["linear", "flow"])
def test_a_list_does_what_one_exposure_for_all_does(stack, interpolation, tmp_path):
    starts = np.arange(12) * STEP_NS
    rows = [f"{start} {start + 4_000_000}\n" for start in starts]
    (tmp_path / "list.txt").write_text("start_ns end_ns\n" + "".join(rows))
    (tmp_path / "middles.txt").write_text(
        "time_ns\n" + "".join(f"{start + 2_000_000}\n" for start in starts)
    )
    config = ["ideal", {"sampling": {"interpolation": interpolation}}]
    done = convert(stack, tmp_path / "a.h5", config, timestamps=tmp_path / "list.txt")
    assert "exposures of 4000 to 4000 us are those of the list" in done.notes
    one = [*config, {"frames": {"exposure_us": 4000}}]
    convert(stack, tmp_path / "b.h5", one, timestamps=tmp_path / "middles.txt")
    convert(stack, tmp_path / "c.h5", config, timestamps=tmp_path / "middles.txt")
    a, b, c = (read_events(tmp_path / f"{name}.h5").events for name in "abc")
    assert a.tobytes() == b.tobytes()
    assert a.tobytes() != c.tobytes()
    # a part has the exposures of its own frames
    how = {"timestamps": tmp_path / "list.txt", "start_s": 0.012, "stop_s": 0.042}
    changed = rows[:3] + [f"{start} {start + 1_000_000}\n" for start in starts[3:]]
    (tmp_path / "list.txt").write_text("start_ns end_ns\n" + "".join(changed))
    assert any(
        "1000 to 1000" in note for note in convert(stack, tmp_path / "d.h5", config, **how).notes
    )


def test_starts_and_ends_in_files_of_their_own(stack, tmp_path):
    starts = np.arange(12) * STEP_NS // 1000
    places = [tmp_path / f"Exposure_{name}.txt" for name in ("start", "end")]
    for path, after in zip(places, (0, 4000), strict=True):
        path.write_text("".join(f"{start + after}\n" for start in starts))
    (tmp_path / "both.txt").write_text(
        "start_us end_us\n" + "".join(f"{start} {start + 4000}\n" for start in starts)
    )
    convert(stack, tmp_path / "a.h5", "ideal", timestamps=places[0], time_unit="us")
    convert(stack, tmp_path / "b.h5", "ideal", timestamps=tmp_path / "both.txt")
    a, b = (read_events(tmp_path / f"{name}.h5").events for name in "ab")
    assert a.tobytes() == b.tobytes()
    places[1].write_text("1\n" * 11)
    with pytest.raises(DataError, match=r"Exposure_end\.txt: 11 lines for the 12 of Exposure_st"):
        convert(stack, tmp_path / "c.h5", "ideal", timestamps=places[0])
    places[1].write_text("1\n" * 12)
    with pytest.raises(DataError, match=r"Exposure_start\.txt line 2: the exposure ends before"):
        convert(stack, tmp_path / "c.h5", "ideal", timestamps=places[0], time_unit="us")
    places[1].write_text("1\n" * 11 + "x\n")
    with pytest.raises(DataError, match=r"Exposure_end\.txt: expected one number a line"):
        convert(stack, tmp_path / "c.h5", "ideal", timestamps=places[0])


def test_a_video_has_none_of_its_own(tmp_path):
    writer = cv2.VideoWriter(str(tmp_path / "a.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 30, (64, 48))
    for dn in (50, 90):
        writer.write(np.full((48, 64, 3), dn, np.uint8))
    writer.release()
    (tmp_path / "list.txt").write_text("start_ms end_ms\n0 4\n33 37\n")
    with pytest.raises(DataError, match=r"list\.txt: exposures, with start and end, are for"):
        convert(tmp_path / "a.avi", tmp_path / "a.h5", timestamps=tmp_path / "list.txt")

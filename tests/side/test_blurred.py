"""Blurred frames are means of light over whole exposures, encoded as the frames are."""

import cv2
import numpy as np
import pytest
from sequences import BEGIN_NS, LINEAR, plain, write_frames

from adv2e import batch, convert
from adv2e.errors import DataError

COUNT = 7


def srgb_light(values):
    share = np.asarray(values, float) / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize("colour", [False, True])
def test_a_blurred_frame_is_the_mean_of_the_light(colour, tmp_path):
    random = np.random.default_rng(2)
    shape = (COUNT, 20, 24, 3) if colour else (COUNT, 20, 24)
    frames = random.integers(0, 256, shape).astype(np.uint8)
    np.save(tmp_path / "a.npy", frames)
    times = np.array([0.0, 0.01, 0.03, 0.04, 0.07, 0.08, 0.1])
    (tmp_path / "t.txt").write_text("".join(f"{t:.3f}\n" for t in times))
    config = ["ideal", {"frames": {"encoding": "srgb"}, "max_events": 10**8}]
    convert(
        tmp_path / "a.npy",
        tmp_path / "a.h5",
        config,
        timestamps=tmp_path / "t.txt",
        blurred_frames=3,
    )
    side = tmp_path / "a.h5.side"
    assert len(list((side / "blurred").iterdir())) == 2
    light = srgb_light(frames)
    for number, begin in enumerate((0, 3)):
        at = slice(begin, begin + 4)
        length = times[begin + 3] - times[begin]
        mean = np.trapezoid(light[at], times[at], axis=0) / length
        made = cv2.imread(str(side / f"blurred/{number:08d}.png"), cv2.IMREAD_UNCHANGED)
        made = made[..., ::-1] if colour else made
        for value, sign in ((made + 0.5, 1), (made - 0.5, -1)):  # rounded to the nearest light
            assert np.all(sign * (srgb_light(np.clip(value, 0, 255)) - mean) > -2e-4)
    lines = (side / "blurred.txt").read_text().splitlines()
    assert lines == [
        "0.000000000 0.040000000 blurred/00000000.png",
        "0.040000000 0.100000000 blurred/00000001.png",
    ]


def test_they_are_on_the_clock_of_the_events_and_on_the_sensor(tmp_path):
    write_frames(tmp_path / "a")
    config = ["ideal", LINEAR, {"frames": {"clock_offset_us": 500}}]
    convert(tmp_path / "a", tmp_path / "out", config, start_s=0.01, size=(48, 32), blurred_frames=2)
    made = cv2.imread(str(tmp_path / "out/blurred/00000000.png"), cv2.IMREAD_GRAYSCALE)
    assert made.shape == (32, 48)
    names = [str(tmp_path / f"out/images/frame_{n:08d}.png") for n in range(3)]
    sharp = [cv2.imread(name, cv2.IMREAD_GRAYSCALE).astype(float) for name in names]
    mean = (sharp[0] + 2 * sharp[1] + sharp[2]) / 4
    assert np.abs(made - mean).max() <= 0.51
    assert np.ptp(mean) > 50
    times, rest = plain((tmp_path / "out/blurred.txt").read_text())
    step = 10_000_000
    assert times.tolist() == [BEGIN_NS + step + 500_000, BEGIN_NS + 3 * step + 500_000]
    assert int(rest[0, 0].replace(".", "")) == times[1]


def test_a_batch_writes_them_and_events_have_none(tmp_path):
    write_frames(tmp_path / "a" / "b")
    sets = ["frames.encoding=linear"]
    batch(tmp_path / "a", tmp_path / "dest", "ideal", sets=sets, blurred_frames=5)
    assert len(list((tmp_path / "dest").rglob("blurred/*.png"))) == 1
    (made,) = (tmp_path / "dest").rglob("*.h5")
    with pytest.raises(DataError, match="its events are written, nothing is simulated"):
        convert(made, tmp_path / "c.h5", blurred_frames=5)

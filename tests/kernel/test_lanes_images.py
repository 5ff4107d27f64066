"""What the lanes decide of a pixel, whatever the image around it."""

import numpy as np
import pytest
from harness import advance, by_pixel, quiet, start
from lane_light import walks
from reference.agreement import count_and_time_errors

from adv2e.config.model import Leak, Refractory, ShotNoise, Thresholds
from adv2e.kernel.screen import LARGEST_STEP
from adv2e.kernel.work_queue import STRIP

CLIP = walks(7, 25, 13, lo=3.0, steps=(0.05, 0.1, 0.2))
"""Light of 13 pixels without steps above an e-fold, which larger images repeat."""
CLIP_NS = [k * 4_166_667 for k in range(len(CLIP))]


LAST_BITS_US = 1e-8
"""Machine code for many lanes and for few may round the last bits of a time differently."""

SIZES = [1, 1023, 1024, 1025, STRIP - 1, STRIP, STRIP + 1, 2 * STRIP + 300]


def repeated(light, pixels):
    """Return which pixel of `light` each pixel of a larger image is, and that image."""
    which = np.arange(pixels) * 5 % light.shape[1]
    return which, light[:, which]


def image(light, tile_size=None, **sections):
    levels = Thresholds(on=0.08, off=0.07, mismatch=0.0)
    leak = Leak(photo_rate_hz=8.0, jitter=0.0)
    pixel = quiet(refractory=Refractory(), leak=leak, thresholds=levels, **sections)
    array = start(light, CLIP_NS, pixel, tile=tile_size, exact_times=True)
    return by_pixel(array, *advance(array, light, CLIP_NS))


def one_by_one(light):
    return [image(light[:, [k]])[0] for k in range(light.shape[1])]


@pytest.mark.parametrize("pixels", SIZES)
@pytest.mark.quick_cases(1)
def test_images_give_what_their_pixels_alone_give(pixels):
    assert np.abs(np.diff(np.log(CLIP), axis=0)).max() < LARGEST_STEP
    alone = one_by_one(CLIP)
    assert sum(map(len, alone)) > 50
    which, light = repeated(CLIP, pixels)
    found = count_and_time_errors(image(light, tile_size=STRIP), [alone[k] for k in which])
    assert not found.differing
    assert found.max_dt_us < LAST_BITS_US


@pytest.mark.parametrize("pixels", SIZES)
@pytest.mark.quick_cases(1)
def test_flashes_give_what_their_pixels_alone_give(pixels):
    clip = walks(7, len(CLIP), 13, lo=2.0, steps=(0.05, 0.5, 1.2))
    alone = one_by_one(clip)
    which, light = repeated(clip, pixels)
    found = count_and_time_errors(image(light, tile_size=STRIP), [alone[k] for k in which])
    assert found.count_b >= (100 if pixels > 1 else 5)
    assert not found.differing
    assert found.max_dt_us < LAST_BITS_US


def test_noise_does_not_depend_on_the_size_of_the_image():
    light = repeated(CLIP, 2 * STRIP + 300)[1]
    whole = image(light, tile_size=STRIP, shot_noise=ShotNoise(rate_hz=100.0))
    for part in (1, STRIP - 1, STRIP + 1):
        cut = image(light[:, :part], shot_noise=ShotNoise(rate_hz=100.0))
        found = count_and_time_errors(cut, whole[:part])
        assert not found.differing
        assert found.max_dt_us < LAST_BITS_US


@pytest.mark.thorough
def test_what_neighbours_do_does_not_count():
    """Each lane goes its own way, in whatever company: beside busy pixels, and beside resting ones.

    Pixels turn, pass the knee, wait through dead times and make noise in all combinations.
    """
    clip = walks(11, len(CLIP), 2000, lo=8.0, steps=(0.05, 0.3, 1.2), rest=0.05)
    noise = ShotNoise(rate_hz=100.0)
    whole = image(clip, shot_noise=noise)
    assert sum(map(len, whole)) > 50_000
    for k in range(0, 2000, 16):
        still = np.repeat(clip[:1], len(clip), axis=0)
        still[:, k : k + 16] = clip[:, k : k + 16]
        some = image(still, shot_noise=noise)[k : k + 16]
        found = count_and_time_errors(some, whole[k : k + 16])
        assert not found.differing
        assert found.max_dt_us < LAST_BITS_US

"""The six channels of Ev-SegNet, against a loop over events and pixels."""

from __future__ import annotations

import numpy as np
import pytest

from adv2e.events import empty_events, make_events
from adv2e.representations.voxel_grid import event_image

SIZE = 12, 9


def slow_image(events, window, scale=True):
    """The definition, pixel by pixel, with the functions of statistics."""
    image = np.zeros((9, 12, 6))
    start, stop = window
    for row in range(9):
        for column in range(12):
            for p, (number, mean, spread) in ((1, (0, 2, 3)), (0, (1, 4, 5))):
                times = [
                    2 * (int(e["t"]) - start) / (stop - start) - 1
                    for e in events
                    if (e["x"], e["y"], e["p"]) == (column, row, p)
                ]
                image[row, column, number] = len(times)
                if times:
                    image[row, column, mean] = np.mean(times)
                    image[row, column, spread] = np.std(times)
    if scale:
        image[..., :2] = image[..., :2] / max(image[..., :2].max(), 1) * 2 - 1
    return image


@pytest.mark.parametrize("scale", [True, False])
@pytest.mark.quick_cases(1)
def test_channels_are_those_of_the_definition(events, scale):
    window = 0, 100_001
    found = event_image(events, SIZE, window, scale_counts=scale)
    assert (found.dtype, found.shape) == (np.float32, (9, 12, 6))
    np.testing.assert_allclose(found, slow_image(events, window, scale), atol=1e-6)


def test_ranges_and_empty_pixels():
    events = make_events([0, 100, 100], [0, 0, 3], [0, 0, 2], [1, 1, 0])
    image = event_image(events, SIZE, (0, 100))
    assert image[0, 0].tolist() == [1, -1, 0, 1, 0, 0]  # two ON, at both ends
    assert image[2, 3].tolist() == [-1, 0, 0, 0, 1, 0]  # one OFF, at the end
    assert image[5, 5].tolist() == [-1, -1, 0, 0, 0, 0]


def test_no_events():
    image = event_image(empty_events(), SIZE, (0, 0))
    assert image[..., :2].tolist() == np.full((9, 12, 2), -1.0).tolist()
    assert not image[..., 2:].any()


def test_epoch_times_lose_nothing(events):
    later = events.copy()
    later["t"] += 1_468_941_032_229_165
    window = 1_468_941_032_229_165, 1_468_941_032_329_165
    expected = event_image(events, SIZE, (0, 100_000))
    np.testing.assert_allclose(event_image(later, SIZE, window), expected, atol=1e-9)

"""Tables of shares, and the pixel that does at one light what a fitted model does there."""

from __future__ import annotations

import numpy as np
import pytest
from real.noise_shares import config_at, distance, share_table

FITTED = {
    "pixel.leak.rate_hz": 0.06,
    "pixel.leak.photo_rate_hz": 0.08,
    "pixel.photoreceptor_noise.rms": 0.1,
    "pixel.low_pass.cutoff_hz": 6e4,
    "pixel.low_pass.dark_cutoff_hz": 16.0,
    "pixel.source_follower.cutoff_hz": 80.0,
    "pixel.thresholds.off": 0.24,
    "pixel.thresholds.mismatch": 0.05,
}


def test_shares_end_at_the_first_that_no_pixel_has():
    counts = [{"on": np.array([0, 1, 5, 9]), "off": np.zeros(4)}] * 3
    rows = [{"light_dn": dn, "pixels": 4, "duration_s": 2.0} for dn in (1.0, 2.0, 3.0)]
    table = share_table("made", rows, counts, (1, 5, 10, 20))
    assert table.texts("on_share_1") == ["0.75"] * 3
    assert table.texts("on_share_5") == ["0.5"] * 3
    assert table.texts("on_share_10") == ["0"] * 3
    assert table.texts("on_share_20") == [""] * 3
    assert table.texts("off_share_1") == ["0"] * 3
    assert table.texts("off_share_5") == [""] * 3


@pytest.mark.parametrize("light", [0.0, 0.001, 1.0])
def test_noise_behind_the_second_pole_is_that_of_the_fitted_model(light):
    pixel = config_at(FITTED, light).pixel
    first = 16.0 + (6e4 - 16.0) * light
    sigma = pixel.photoreceptor_noise.rms * (80.0 / (80.0 + pixel.low_pass.cutoff_hz)) ** 0.5
    assert sigma == pytest.approx(0.1 * (80.0 / (80.0 + first)) ** 0.5)
    assert pixel.low_pass.cutoff_hz <= 20.0 * 80.0
    assert pixel.leak.rate_hz == pytest.approx(0.06 + 0.08 * light)
    assert (pixel.thresholds.off, pixel.thresholds.mismatch) == (0.24, 0.05)


def test_distance_of_distributions_is_the_largest_difference_of_their_sums():
    assert distance([1, 1, 2], [2, 2, 4]) == 0.0
    assert distance([4, 0, 0], [0, 0, 9]) == 1.0
    assert distance([3, 1, 0], [1, 1, 2]) == pytest.approx(0.5)

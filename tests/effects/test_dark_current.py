"""Dark current: a constant light."""

from __future__ import annotations

import numpy as np
from through_hooks import run, still

from adv2e.effects.pixel.dark_current import DarkCurrent, DarkCurrentHooks


def test_dark_current_is_added():
    found = run(DarkCurrentHooks(DarkCurrent(dn=1.5)), still(0, 10, dtype=np.float64))[1]
    assert found[:, 1, 1].tolist() == [1.5, 11.5]
    assert found.dtype == np.float64

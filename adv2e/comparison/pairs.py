"""Compiled sum over the pairs of events of one pixel."""

from __future__ import annotations

import math
from typing import Any

from adv2e.compiled import kernel


@kernel
def add_pairs(key: Any, weight: Any, decay: Any, reach: Any, sums: Any) -> None:
    """Add 2 w_i w_j exp(-decay (key_j - key_i)^2) over all pairs i < j within reach.

    Parameters
    ----------
    key : array of int64, (events,)
        Increasing; keys of different pixels are farther apart than every reach.
    weight : array of float64, (events,)
        Signed weights.
    decay, reach : arrays of float64, (scales,)
        Scales with the widest reach first.
    sums : array of float64, (scales,)
        What is added to.
    """
    for i in range(key.shape[0]):
        for j in range(i + 1, key.shape[0]):
            apart = float(key[j] - key[i])
            if apart > reach[0]:
                break
            product = 2.0 * weight[i] * weight[j]
            for n in range(decay.shape[0]):
                if apart > reach[n]:
                    break
                sums[n] += product * math.exp(-decay[n] * apart * apart)

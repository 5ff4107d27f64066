"""Frames of a wave that moves."""

import numpy as np


def picture(k, shape=(24, 32)):
    """Return the wave after `k` steps, (rows, columns), 8 bit."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    return (120 + 100 * np.sin(0.4 * (x - 2 * k)) * np.cos(0.3 * y)).astype(np.uint8)

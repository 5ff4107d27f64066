"""How near images are to frames.

References
----------
.. [1] Z. Wang et al., "Image Quality Assessment: From Error Visibility to Structural Similarity",
   IEEE Transactions on Image Processing 13(4), 2004, doi:10.1109/TIP.2003.819861.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray


def similarity(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Return the mean structural similarity of two images between 0 and 1.

    As [1]_: means, variances and covariance under a Gaussian of 1.5 pixels (11 x 11), constants
    0.01**2 and 0.03**2.  1 for equal images.
    """
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)

    def mean(image: NDArray[Any]) -> NDArray[Any]:
        return cv2.GaussianBlur(image, (11, 11), 1.5)

    at_a, at_b = mean(a), mean(b)
    spread = mean(a * a) - at_a**2 + mean(b * b) - at_b**2
    both = mean(a * b) - at_a * at_b
    light = (2 * at_a * at_b + 1e-4) / (at_a**2 + at_b**2 + 1e-4)
    return float(np.mean(light * (2 * both + 9e-4) / (spread + 9e-4)))


def likeness(image: NDArray[Any], frame: NDArray[Any]) -> float:
    """Return the correlation of an image with a frame's light [DN], under a logarithm of DN + 5."""
    return float(np.corrcoef(np.ravel(image), np.log(np.ravel(frame) + 5.0))[0, 1])

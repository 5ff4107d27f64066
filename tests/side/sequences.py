"""Sequences with a bright square whose place is known, and the place of such a square in pictures.

What is drawn, and where a fit takes it, is worked out here with whole numbers and fractions, by the
words of the documentation and not by the code.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np

WIDTH, HEIGHT = 96, 64
SIDE = 5
BEGIN_NS, STEP_NS = 1_500_000_000_123_456_789, 10_000_000
LINEAR = {"frames": {"encoding": "linear"}}


def middle(number):
    """Return the middle of the square in a frame, from the frame's corner [px]."""
    return 30.5 + 2 * number, 20.5 + number


def picture(number):
    left, top = (int(one - SIDE / 2) for one in middle(number))
    image = np.full((HEIGHT, WIDTH), 4, np.uint8)
    image[top : top + SIDE, left : left + SIDE] = 204
    return image


def write_frames(folder: Path, count=6):
    """Write frames of EuRoC, as ``cam0/data`` below a folder; return their times [ns]."""
    data = folder / "cam0" / "data"
    data.mkdir(parents=True)
    times = [BEGIN_NS + number * STEP_NS for number in range(count)]
    for number, t_ns in enumerate(times):
        assert cv2.imwrite(str(data / f"{t_ns}.png"), picture(number))
    lines = "".join(f"{t_ns},{t_ns}.png\n" for t_ns in times)
    (folder / "cam0" / "data.csv").write_text("#timestamp [ns],filename\n" + lines)
    return times


def found(image):
    """Return the middle of what is brighter than the ground, from the corner [px]."""
    light = image.astype(float) - np.median(image)
    light[light < 8] = 0
    rows, columns = np.indices(image.shape)
    return tuple((light * (at + 0.5)).sum() / light.sum() for at in (columns, rows))


def expected(point, *, turned=False, crop=None, size=None, fit="crop"):
    """Return where a point of the frame lies after it is turned, cut, and brought to a size."""
    x, y = (Fraction(one) for one in point)
    if turned:
        x, y = WIDTH - x, HEIGHT - y
    left, top, width, height = crop or (0, 0, WIDTH, HEIGHT)
    x, y = x - left, y - top
    if size is None:
        return float(x), float(y)
    across, down = Fraction(size[0], width), Fraction(size[1], height)
    if fit == "crop":
        across = down = max(across, down)
    elif fit == "pad":
        across = down = min(across, down)
    # middle upon middle
    x, y = (x - Fraction(width, 2)) * across, (y - Fraction(height, 2)) * down
    return float(x + Fraction(size[0], 2)), float(y + Fraction(size[1], 2))


def plain(text):
    """Return the numbers of a text, (lines, columns), its times as whole nanoseconds apart."""
    rows = [line.split() for line in text.splitlines() if line.strip()]
    times = [int(row[0].replace(".", "")) for row in rows]
    return np.array(times, np.int64), np.array([row[1:] for row in rows], object)

r"""The voxel grid ("temporal bins") of the events of one window.

.. math::
    t^*_i = (B-1)\,\frac{t_i - t_{first}}{t_{last} - t_{first}}, \qquad
    E(k, y, x) = \sum_i s_i \max(0, 1 - |k - t^*_i|), \qquad s_i = \pm 1

A window without extent is divided by 1.

References
----------
.. [1] H. Rebecq, R. Ranftl, V. Koltun, D. Scaramuzza, "High Speed and High Dynamic Range Video
   with an Event Camera", TPAMI 2021, doi:10.1109/TPAMI.2019.2963386.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.events import Events, Window, checked_events, cut, is_sorted, pixels_of, with_fields
from adv2e.formats.recording import Recording

Grid = NDArray[np.float64]
"""(bins, rows, columns)."""

_GAUSS = np.exp(-0.5 * np.array([1.0, 0.0, 1.0]))
SMOOTHING = _GAUSS / _GAUSS.sum()
"""One axis of the 3x3 Gaussian, sigma 1 pixel."""


def signs(events: Events) -> NDArray[np.float64]:
    """Return +1 for each ON event and -1 for each OFF event."""
    return np.where(events["p"] > 0, 1.0, -1.0)


def voxel_grid(
    events: Events | Recording,
    bins: int,
    size: tuple[int, int] | None = None,
    window: Window | None = None,
) -> Grid:
    """Return the signed grid of events: ON counts +1, OFF -1, shared by the two nearest bins.

    Parameters
    ----------
    events : Recording, or (n,) array of EVENT_DTYPE sorted by time
        Events outside the window are left out.  Those in it are found by bisection, so that many
        windows of a long recording cost no more than their own events.
    bins : int
        Number of bins; with 1 all events weigh the same.
    size : (int, int), optional
        Width and height of the sensor [pixels]; default: those of the recording.
    window : (int, int), optional
        Times of the middles of the first and of the last bin [us], which belong to the window.
        Default: times of the first and the last event, as E2VID has it.

    Returns
    -------
    (bins, height, width) array of float64

    Raises
    ------
    DataError
        There is no bin, the window ends before it begins, an event lies outside the sensor, or
        events are not in the order of time; an array has no size.

    Examples
    --------
    >>> from adv2e import voxel_grid
    >>> from adv2e.events import make_events
    >>> events = make_events(t=[0, 25, 100], x=[0, 1, 2], y=[0, 0, 1], p=[1, 1, 0])
    >>> voxel_grid(events, 3, (3, 2))[:, 0]
    array([[1. , 0.5, 0. ],
           [0. , 0.5, 0. ],
           [0. , 0. , 0. ]])
    """
    if isinstance(events, Recording):
        size = size or (events.width, events.height)
        events = events.events
    if size is None:
        raise DataError("voxel grid: size is missing, (width, height) of the sensor [pixels]")
    if bins < 1:
        raise DataError(f"voxel grid: {bins} bins, at least 1 is needed")
    if window is None:
        events = checked_events(events, *size)
        window = own_window(events)
        return signed_grid(events, bins, size, window)
    first, last = window
    if last < first:
        raise DataError(f"voxel grid: the window ends at {last} us, before it begins at {first} us")
    events = with_fields(events)
    _check_order(events)
    inside = cut(events, first, last + 1)
    if not is_sorted(inside):
        raise DataError(_UNSORTED)
    return signed_grid(checked_events(inside, *size), bins, size, window)


_UNSORTED = (
    "voxel grid: events must be sorted by time to find a window:"
    " events[np.argsort(events['t'], kind='stable')]"
)
_SAMPLE = 256


def _check_order(events: Events) -> None:
    """Refuse an array whose events, some of which are looked at, are not in the order of time."""
    some = events[:: max(1, len(events) // _SAMPLE)]
    if len(events) and not (is_sorted(some) and some["t"][-1] <= events["t"][-1]):
        raise DataError(_UNSORTED)


def signed_grid(events: Events, bins: int, size: tuple[int, int], window: Window) -> Grid:
    """Return the grid of :func:`voxel_grid` for events inside the window and the sensor."""
    (width, height), (first, last) = size, window
    place = (bins - 1) * (events["t"] - first) / ((last - first) or 1)
    lower = np.minimum(place.astype(np.int64), max(bins - 2, 0))
    share = place - lower
    pixels = width * height
    cell = lower * pixels + pixels_of(events, width)
    sign = signs(events)
    grid: Grid = np.bincount(cell, sign * (1.0 - share), bins * pixels).astype(
        np.float64, copy=False
    )
    if bins > 1:
        grid += np.bincount(cell + pixels, sign * share, bins * pixels)
    return grid.reshape(bins, height, width)


def own_window(events: Events) -> Window:
    """Return the times of the first and last event [us], as E2VID takes them."""
    return (int(events["t"][0]), int(events["t"][-1])) if len(events) else (0, 0)


def z_scored(grid: Grid) -> Grid:
    """Return (E - mean)/deviation over the cells that are not zero; zeros stay zero.

    Cells that are all equal have no deviation and are divided by 1.
    """
    filled = grid != 0
    values = grid[filled]
    scored = np.zeros_like(grid)
    if values.size:
        scored[filled] = (values - values.mean()) / (values.std() or 1.0)
    return scored


def smoothed(grid: Grid) -> Grid:
    """Return the grid after a 3x3 Gaussian of sigma 1 pixel in space; nothing lies outside."""
    side, middle, _ = SMOOTHING
    rows: Grid = middle * grid
    rows[:, 1:] += side * grid[:, :-1]
    rows[:, :-1] += side * grid[:, 1:]
    both: Grid = middle * rows
    both[:, :, 1:] += side * rows[:, :, :-1]
    both[:, :, :-1] += side * rows[:, :, 1:]
    return both


def split_grid(events: Events, bins: int, size: tuple[int, int], window: Window) -> Grid:
    """Return a grid of ON events above one of OFF events, both counted up, (2 bins, rows, columns).

    Events lie inside the window and the sensor.
    """
    polarities = (events[events["p"] == on].copy() for on in (1, 0))
    halves = []
    for part in polarities:
        part["p"] = 1
        halves.append(signed_grid(part, bins, size, window))
    return np.concatenate(halves)


def robust(grid: Grid, most: float = 95.0) -> Grid:
    """Return the grid clipped to its 0th to `most`-th percentile, less its least, over its largest.

    As ``RobustNorm`` of event_cnn_minimal: percentiles are those of the cells in order, the nearest
    one and not interpolated; the largest is that of the clipped grid, before its least is taken
    off.  A grid of zeros stays as it is.

    References
    ----------
    .. [1] T. Stoffregen et al., "Reducing the sim-to-real gap for event cameras", ECCV 2020,
       arXiv:2003.09078; github.com/TimoStoff/event_cnn_minimal.
    """
    ordered = np.sort(grid, axis=None)
    low, high = ordered[0], ordered[round(0.01 * most * (grid.size - 1))]
    if low == 0 and high == 0:
        return grid
    scaled: Grid = (np.clip(grid, low, high) - low) / (high + 1e-6)
    return scaled


# ---- The six channels of Ev-SegNet: counts, mean and deviation of times, of each polarity.
#
# ========= ================================= ============ =====
# channel   what                              range        empty
# ========= ================================= ============ =====
# 0, 1      events, ON and OFF                -1 ... 1     -1
# 2, 3      mean and deviation of times, ON   -1...1, 0..1 0
# 4, 5      mean and deviation of times, OFF  -1...1, 0..1 0
# ========= ================================= ============ =====
#
# This is the order of the data that was released, which the article prints in another one. Times
# run from -1 at the start of the window to 1 at its end. Counts are divided by the largest of both
# polarities, so that it becomes 1: how the released ones were scaled was not published. The
# deviation is that of all events (divided by their number), which lies within 0 to 1.
#
# References
# ----------
# .. [1] I. Alonso, A. C. Murillo, "EV-SegNet: Semantic Segmentation for Event-based Cameras", CVPRW
#    2019, arXiv:1811.12039; github.com/Shathe/Ev-SegNet.


def event_image(
    events: Events, size: tuple[int, int], window: Window, *, scale_counts: bool = True
) -> NDArray[np.float32]:
    """Return the six channels of the events of a window.

    Parameters
    ----------
    events : array of EVENT_DTYPE
        Inside the window and the sensor.
    size : (int, int)
        Width and height of the sensor [pixels].
    window : (int, int)
        Its start and stop [us].
    scale_counts : bool
        Counts are scaled to -1 ... 1; else they are what was counted.

    Returns
    -------
    (rows, columns, 6) array of float32
    """
    (width, height), (start, stop) = size, window
    image = np.zeros((height, width, 6))
    place = 2.0 * (events["t"] - start) / max(stop - start, 1) - 1.0
    pixels = pixels_of(events, width)
    for half, channels in ((1, (0, 2, 3)), (0, (1, 4, 5))):
        chosen = events["p"] == half
        where, when = pixels[chosen], place[chosen]
        number = np.bincount(where, minlength=width * height)
        most = np.maximum(number, 1)
        mean = np.bincount(where, when, width * height) / most
        # about the mean, as the difference of two squares would lose digits
        spread = np.bincount(where, (when - mean[where]) ** 2, width * height) / most
        for channel, values in zip(channels, (number, mean, np.sqrt(spread)), strict=True):
            image[..., channel] = values.reshape(height, width)
    if scale_counts:
        image[..., :2] = 2 * image[..., :2] / max(image[..., :2].max(), 1) - 1
    return image.astype(np.float32)

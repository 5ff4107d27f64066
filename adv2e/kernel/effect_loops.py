"""Loops of effects on frames, before the pixel sees them, and on its events: the arbiter's."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import kernel


@kernel
def fill_luma(image, red, green, blue, luma):
    """Set `luma` (pixels,) to the sum of a table for each channel of `image` (pixels, 3).

    A third of the time of look-ups by NumPy.
    """
    for k in range(luma.shape[0]):
        luma[k] = green[image[k, 1]] + red[image[k, 0]] + blue[image[k, 2]]


@kernel
def sharpen(blurred, first, last, weights, norm, iterations, variation, light, mean, factor):
    """Find light from its means over exposures; see :mod:`adv2e.effects.frames.exposure_blur`.

    Parameters
    ----------
    blurred : (n, pixels)
        Frames [DN], above zero.
    first, last : (n,) int
        Where the weights of each row are not zero.
    weights : (n, n), norm : (n,)
        Rows, and sums of the columns.
    iterations : int
    variation : (2,)
        Lambda and the square of epsilon.
    light : (n, pixels)
        In: where to begin.  Out: the light.
    mean, factor : (pixels,), (n, pixels)
        Memory to work in.
    """
    n, pixels = blurred.shape
    cost, soft = variation
    one = blurred.dtype.type(1)
    two = one + one
    for _ in range(iterations):
        factor[:] = 0.0
        for k in range(n):
            mean[:] = 0.0
            for j in range(first[k], last[k]):
                weight, row = weights[k, j], light[j]
                for p in range(pixels):
                    mean[p] += weight * row[p]
            now = blurred[k]
            for p in range(pixels):
                mean[p] = now[p] / mean[p]
            for j in range(first[k], last[k]):
                weight, row = weights[k, j], factor[j]
                for p in range(pixels):
                    row[p] += weight * mean[p]
        mean[:] = 0.0  # from here on the pull of the step before
        for k in range(n):
            row, now, scale = light[k], factor[k], norm[k]
            coming = light[min(k + 1, n - 1)]
            for p in range(pixels):
                step = two * (coming[p] - row[p]) / (coming[p] + row[p])
                pull = step / np.sqrt(step * step + soft)
                row[p] *= now[p] * scale / (one - cost * (pull - mean[p]))
                mean[p] = pull


# ---- Readout times of the events of one channel; see :mod:`adv2e.effects.readout.arbiter`.


NOBODY = -1
"""Mark of a pixel of which no event waits."""

FREE, HEAD, ROWS, EVENTS = 0, 1, 2, 3
"""Entries of the record of a channel."""


class Requests(NamedTuple):
    """Events that ask for the channel, or that have passed it."""

    time: NDArray[np.float64]  # (n,) [us]
    pixel: NDArray[np.int64]  # (n,)
    polarity: NDArray[np.int8]  # (n,)


class Channel(NamedTuple):
    """Channel, and who waits for it."""

    record: NDArray[np.float64]  # (4,): FREE: from when on it is, HEAD: the first row of the queue,
    # ROWS: how many wait, EVENTS: likewise
    queue: NDArray[np.int64]  # (rows,): those that wait, in a ring, by their first requests
    asked: NDArray[np.float64]  # (rows,): time of the first request, -infinity: the row waits not
    waiting: NDArray[np.int8]  # (pixels,): polarity of the event that waits, or NOBODY
    left: NDArray[np.float64]  # (pixels,): when its last event was read out


@kernel
def serve(requests, known, row_us, event_us, columns, channel, served):
    """Take events in, and serve rows as long as all requests before their latch are known.

    Parameters
    ----------
    requests : Requests
        In order; all of them are taken in.
    known : float
        Time before which no further event will come [us].
    served : Requests
        Those that have passed, in that order.

    Returns
    -------
    int
        How many these are.
    """
    time, pixel, polarity = requests
    record, queue, asked, waiting, left = channel
    rows = queue.shape[0]
    arrived = np.int64(0)
    count = time.shape[0]
    head, length = np.int64(record[HEAD]), np.int64(record[ROWS])
    free, pending = record[FREE], record[EVENTS]
    written = np.int64(0)
    while arrived < count or length > 0:
        if length == 0 and time[arrived] <= left[pixel[arrived]]:
            arrived += 1  # lost, and nothing waits
            continue
        request = asked[queue[head]] if length > 0 else time[arrived]
        latch = max(free, request) + row_us
        while arrived < count and time[arrived] <= latch:
            place = pixel[arrived]
            if time[arrived] > left[place]:
                row = place // columns
                if asked[row] == -np.inf:
                    asked[row] = time[arrived]
                    queue[(head + length) % rows] = row
                    length += 1
                if waiting[place] == NOBODY:
                    waiting[place] = polarity[arrived]
                    pending += 1.0
            arrived += 1
        if latch >= known:
            break  # others may still ask before it
        row = queue[head]
        head = (head + 1) % rows
        length -= 1
        asked[row] = -np.inf
        free = latch
        for place in range(row * columns, (row + 1) * columns):
            if waiting[place] != NOBODY:
                free += event_us
                left[place] = free
                served.time[written] = free
                served.pixel[written] = place
                served.polarity[written] = waiting[place]
                waiting[place] = NOBODY
                pending -= 1.0
                written += 1
    record[FREE], record[HEAD], record[ROWS] = free, head, length
    record[EVENTS] = pending
    return int(written)

"""Readout times of the events of one channel; see :mod:`adv2e.effects.readout.arbiter`."""

from __future__ import annotations

import numpy as np

from adv2e.compiled import kernel

NOBODY = -1
"""Mark of a pixel of which no event waits."""

FREE, HEAD, ROWS, EVENTS = 0, 1, 2, 3
"""Entries of the record of a channel."""


@kernel
def serve(
    time, pixel, polarity, known, row_us, event_us, columns, channel, queue, asked, waiting, left,
    out_time, out_pixel, out_polarity,
):  # fmt: skip
    """Take events in, and serve rows as long as all requests before their latch are known.

    Parameters
    ----------
    time, pixel, polarity : (n,)
        Events in order, times [us]; all of them are taken in.
    known : float
        Time before which no further event will come [us].
    channel : (4,)
        Time from which the channel is free; first row of the queue, rows in it, events that wait.
    queue : (rows,) int
        Rows that wait, in a ring, in the order of their first requests.
    asked : (rows,)
        Time of the first request of each row that waits; below zero infinity: it does not.
    waiting : (pixels,) int8
        Polarity of the event that waits, or -1.
    left : (pixels,)
        Time at which the last event of each pixel was read out.

    Returns
    -------
    int
        Events written to the outputs.
    """
    rows = queue.shape[0]
    arrived = np.int64(0)
    count = time.shape[0]
    head, length = np.int64(channel[HEAD]), np.int64(channel[ROWS])
    free, pending = channel[FREE], channel[EVENTS]
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
                out_time[written] = free
                out_pixel[written] = place
                out_polarity[written] = waiting[place]
                waiting[place] = NOBODY
                pending -= 1.0
                written += 1
    channel[FREE], channel[HEAD], channel[ROWS] = free, head, length
    channel[EVENTS] = pending
    return int(written)

"""From the pixels' events to those in the file: arbiter, losses, stamps.

Each effect takes times [s] in order, pixels and polarities (1 or -1), and returns the same of the
events that go on.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from camera.settings import Settings, find, section


class Stream(NamedTuple):
    """Events in time order: time [s], pixel (row * width + column), polarity (1 or -1)."""

    time: NDArray[np.float64]
    pixel: NDArray[np.int64]
    polarity: NDArray[np.int64]

    def kept(self, which: NDArray[np.bool_]) -> Stream:
        """Return the events where `which` is true."""
        return Stream(self.time[which], self.pixel[which], self.polarity[which])

    def in_order(self) -> Stream:
        """Return the events sorted by time; those of one time stay in their order."""
        order = np.argsort(self.time, kind="stable")
        return Stream(self.time[order], self.pixel[order], self.polarity[order])


def arbiter(stream: Stream, width: int, event_s: float, row_s: float) -> Stream:
    """Read the events out row by row, through one channel.

    The channel, when free, takes the row that has waited longest; after `row_s` all requests that
    this row then has are latched and go out from left to right, one each `event_s`, stamped as they
    leave.  A pixel whose request still waits cannot make another: that event is lost, which is how
    the readout saturates.  Pixels are not told of their waiting: their dead time starts at the
    event, not at its acknowledgement.

    Source: Boahen, "Point-to-point connectivity between neuromorphic chips using address events",
    2000; Brandli et al. 2014 (row arbitration).
    """
    time, pixel = stream.time.tolist(), stream.pixel.tolist()
    waiting: dict[int, dict[int, int]] = {}  # row -> its pixels that wait -> their events
    rows: list[tuple[float, int]] = []  # (first request, row) of the rows that wait
    left = dict.fromkeys(pixel, -np.inf)  # when each pixel's last event went out
    order, stamps = [], []
    arrived, free = 0, -np.inf
    while arrived < len(time) or rows:
        if not rows and time[arrived] <= left[pixel[arrived]]:
            arrived += 1  # lost, and nothing waits
            continue
        latch = max(free, rows[0][0] if rows else time[arrived]) + row_s
        while arrived < len(time) and time[arrived] <= latch:
            t, place = time[arrived], pixel[arrived]
            line = place // width
            if line not in waiting and t > left[place]:
                waiting[line] = {}
                heapq.heappush(rows, (t, line))
            if t > left[place]:
                waiting[line].setdefault(place, arrived)
            arrived += 1
        free = latch
        for place, event in sorted(waiting.pop(heapq.heappop(rows)[1]).items()):
            free += event_s
            left[place] = free
            order.append(event)
            stamps.append(free)
    chosen = np.array(order, np.int64)
    return Stream(np.array(stamps), stream.pixel[chosen], stream.polarity[chosen])


def loss(stream: Stream, fraction: float, rng: np.random.Generator) -> Stream:
    """Lose each event with probability `fraction`.

    Source: full buffers between camera and computer; the simplest model of it.
    """
    return stream.kept(rng.random(len(stream.time)) >= fraction)


def double_read(
    stream: Stream, shares: tuple[float, float], one_is_on: bool, rng: np.random.Generator
) -> Stream:
    """Read a share of the ON, and one of the OFF events, again in the same or the next microsecond.

    `one_is_on`: one of both readings is ON.  Source: stamps of ATIS and DVS128 cameras.
    """
    chosen = rng.random(len(stream.time)) < np.where(stream.polarity > 0, *shares)
    again = stream.kept(chosen)
    again = again._replace(time=again.time + 1e-6 * rng.integers(0, 2, len(again.time)))
    if one_is_on:
        is_first = rng.random(len(again.time)) < 0.5
        stream = stream._replace(polarity=stream.polarity.copy())
        stream.polarity[np.flatnonzero(chosen)[is_first]] = 1
        again = again._replace(polarity=np.where(is_first, again.polarity, 1))
    return Stream(*map(np.concatenate, zip(stream, again, strict=True))).in_order()


def tick(stream: Stream, tick_s: float) -> Stream:
    r"""Stamp the events with a clock that ticks every `tick_s`, at the tick that follows.

    .. math:: t' = q\,\lceil t/q \rceil

    Source: reports of stamps grouped by drivers and message formats.
    """
    return stream._replace(time=np.ceil(stream.time / tick_s - 1e-9) * tick_s)


def echo(stream: Stream, share: float, delay_s: float, rng: np.random.Generator) -> Stream:
    """Repeat a `share` of the events, each `delay_s` later, as a receiver that reads twice would.

    Source: none; an effect that no library has.
    """
    again = stream.kept(rng.random(len(stream.time)) < share)
    return Stream(
        np.concatenate([stream.time, again.time + delay_s]),
        np.concatenate([stream.pixel, again.pixel]),
        np.concatenate([stream.polarity, again.polarity]),
    ).in_order()


def sign_flips(stream: Stream, share: float, rng: np.random.Generator) -> Stream:
    """Turn the polarity of a `share` of the events round, as a bad polarity line would.

    Source: none; an effect that no library has.
    """
    sign = np.where(rng.random(len(stream.time)) < share, -1, 1)
    return stream._replace(polarity=stream.polarity * sign)


def read_out(
    stream: Stream,
    settings: Settings,
    width: int,
    rng: Callable[[str], np.random.Generator],
) -> Stream:
    """Return the events as they come out of the camera, in the order in which they come."""
    queue = section(settings, "readout.arbiter")
    if queue is not None:
        stream = arbiter(stream, width, queue["event_ns"] * 1e-9, queue["row_ns"] * 1e-9)
    flips = section(settings, "outside.sign_flips")
    if flips is not None:
        stream = sign_flips(stream, flips["share"], rng("sign flips"))
    again = section(settings, "outside.echo")
    if again is not None:
        stream = echo(stream, again["share"], again["delay_us"] * 1e-6, rng("echo"))
    twice = section(settings, "readout.double_read")
    if twice is not None:
        shares, one_is_on = (twice["on"], twice["off"]), twice.get("polarity") == "on"
        stream = double_read(stream, shares, one_is_on, rng("double read"))
    lost = find(settings, "readout.loss.fraction", 0.0)
    if lost:
        stream = loss(stream, lost, rng("loss"))
    coarse = find(settings, "readout.tick_us", 0.0)
    return tick(stream, coarse * 1e-6) if coarse else stream

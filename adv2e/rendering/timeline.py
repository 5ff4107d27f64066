"""From a stream of events and frames to pictures at instants, in bounded memory."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.events import Events, empty_events
from adv2e.rendering.films import Album
from adv2e.rendering.layout import Cell
from adv2e.rendering.styles import Picture, Style, draw

Caption = Callable[[int, int], str]
"""Text of a picture from its time since the start [us] and the number of events it shows."""

_LONG_AGO, _FAR_OFF = -(1 << 62), 1 << 62


def caption(since_us: int, count: int) -> str:
    """Return time and number of events."""
    return f"{since_us * 1e-6:.3f} s   {count:,} events"


class Timeline:
    """Draws an instant as soon as all its events have come, and hands it to an album.

    Parameters
    ----------
    album : Album
        Takes the pictures.
    size : (int, int)
        Width and height of the sensor [pixels].
    style : Style
    step_us : float
        Time between the instants [us].
    instants_us : sequence of int, optional
        Increasing times [us] to draw instead.
    start_us : int, optional
        Time that counts as 0; by default that of the first frame or event.
    frames : bool, optional
        Keep a panel for the frames beside the events; by default, if a frame comes before the first
        picture is drawn.
    caption : callable
        What to write above a picture.
    """

    def __init__(
        self,
        album: Album,
        size: tuple[int, int],
        style: Style,
        *,
        step_us: float,
        instants_us: Sequence[int] | None = None,
        start_us: int | None = None,
        frames: bool | None = None,
        caption: Caption = caption,
    ) -> None:
        self._album, self._size, self._style = album, size, style
        self._step_us, self._given_us = step_us, instants_us
        self._start_us, self._with_frames, self._caption = start_us, frames, caption
        self._events = empty_events()
        self._frames: deque[tuple[int, Picture | None]] = deque()
        self._instants: Iterator[int] | None = None
        self._next_us: int | None = None
        self._number = 0
        self._drawn = 0
        self._complete_us = _LONG_AGO  # all events before this have come
        self._last_event_us = _LONG_AGO
        self._last_frame_us = _LONG_AGO

    def add_frame(self, t_ns: int, image: NDArray[Any]) -> None:
        """Take a frame (rows, columns) or (rows, columns, 3), 8 or 16 bit, of time `t_ns` [ns]."""
        t_us = t_ns // 1000
        self._begin(t_us)
        self._last_frame_us = t_us
        unseen = self._with_frames is False
        self._frames.append((t_us, None if unseen else _panel(image, self._size)))

    def add_events(self, events: Events) -> None:
        """Take events, sorted, not before those of earlier calls; there may be none."""
        if events.size:
            self._begin(int(events["t"][0]))
            self._last_event_us = int(events["t"][-1])
            self._complete_us = max(self._complete_us, self._last_event_us)
            self._events = np.concatenate([self._events, events])
        if len(self._frames) > 2:
            self._complete_us = max(self._complete_us, self._frames[-3][0])
        self._draw_up_to(self._complete_us)

    def finish(self) -> bool:
        """Draw what is left, the last event included; False if nothing came to draw."""
        if self._instants is None:
            return False
        if self._given_us is not None:
            self._draw_up_to(_FAR_OFF)
            return True
        self._draw_up_to(max(self._last_event_us, self._last_frame_us))
        assert self._next_us is not None
        if not self._drawn or self._next_us - self._step_us <= self._last_event_us:
            self._draw(self._next_us)
        return True

    def _begin(self, t_us: int) -> None:
        """Set the clock at the first frame or event."""
        if self._instants is not None:
            return
        if self._start_us is None:
            self._start_us = t_us
        if self._given_us is None:
            self._instants = _steps(self._start_us, self._step_us)
        else:
            self._instants = iter(self._given_us)
        self._next_us = next(self._instants, None)

    def _draw_up_to(self, t_us: int) -> None:
        """Draw the instants up to `t_us` and forget what no later one needs."""
        while self._next_us is not None and self._next_us <= t_us:
            self._draw(self._next_us)
            assert self._instants is not None
            self._next_us = next(self._instants, None)
        next_us = _FAR_OFF if self._next_us is None else self._next_us
        gone = np.searchsorted(self._events["t"], next_us - self._style.window_us)
        self._events = self._events[gone:]
        # three frames stay, by which add_events knows how far the events have come
        while len(self._frames) > 3 and self._frames[1][0] <= next_us:
            self._frames.popleft()

    def _draw(self, t_us: int) -> None:
        """Draw the instant `t_us`."""
        if self._with_frames is None:
            self._with_frames = bool(self._frames)
        if self._album.wants(self._number):
            assert self._start_us is not None
            window = [t_us - self._style.window_us, t_us]
            first, last = np.searchsorted(self._events["t"], window)
            events = self._events[first:last]
            panels = [draw(events, *self._size, t_us, self._style)]
            if self._with_frames:
                panels.insert(0, self._frame_at(t_us))
            text = self._caption(t_us - self._start_us, int(events.size))
            self._album.add(self._number, Cell(tuple(panels), text))
            self._drawn += 1
        self._number += 1

    def _frame_at(self, t_us: int) -> Picture:
        """Return the last frame at or before `t_us`, or a grey panel."""
        for time, picture in reversed(self._frames):
            if time <= t_us and picture is not None:
                return picture
        return np.full((self._size[1], self._size[0], 3), 128, np.uint8)


def _steps(start_us: int, step_us: float) -> Iterator[int]:
    """Yield the instants a step, two steps, ... after the start."""
    number = 0
    while True:
        number += 1
        yield start_us + round(number * step_us)


def _panel(image: NDArray[Any], size: tuple[int, int]) -> Picture:
    """Return a frame as a picture of `size` (width, height)."""
    if image.dtype == np.uint16:
        image = image >> 8
    picture = image.astype(np.uint8)  # a copy: the source may use its array again
    if picture.ndim == 2:
        picture = np.repeat(picture[:, :, None], 3, axis=2)
    if picture.shape[1::-1] != size:
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA).astype(np.uint8)
    return picture

"""From a stream of events and frames to pictures at instants, in bounded memory.

An instant is drawn when all that it shows is known to have come, so that the pictures do not hang
on the order and the size of the pieces in which it came.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.causes import without_causes
from adv2e.events import Events, empty_events
from adv2e.files.backlog import Backlog
from adv2e.light.pictures import eight_bit
from adv2e.options import MOST_PICTURES
from adv2e.rendering.films import NotWritten, PictureOutput
from adv2e.rendering.styles import Cell, Picture, Style, draw
from adv2e.ticks import microseconds

Caption = Callable[[int, int], str]
"""Text of a picture from its time since the start [us] and the number of events it shows."""

_A_FRAME = 20
"""Pictures that a film may have for each frame in any case."""

_LONG_AGO, _FAR_OFF = -(1 << 62), 1 << 62


def caption(since_us: int, count: int) -> str:
    return f"{since_us * 1e-6:.3f} s   {count:,} events"


class Timeline:
    """Draws the instants one after the other, and hands them to an output.

    That an event has come tells that those before it have, and likewise for frames; events and
    frames may come in any order relative to one another.  What is not drawn yet waits, beyond
    some memory on disk; :meth:`complete_until` and :meth:`no_more_frames` shorten the wait.

    Parameters
    ----------
    output : PictureOutput
        Takes the pictures.
    size : (int, int)
        Width and height of the sensor [pixels].
    step_us : float
        Time between the instants [us].
    instants_us : sequence of int, optional
        Increasing times [us] to draw instead.
    start_us : int, optional
        Time that counts as 0; by default that of the first frame or event.
    frames : bool, optional
        Keep a panel for the frames beside the events; by default, if there is a frame.  Without
        the panel, the first of them still counts as the start.
    caption : callable
        What to write above a picture.
    folder : Path, optional
        Where to keep what has to wait on disk.
    max_pictures : int
        Most pictures to draw, unless there are enough frames for more.
    """

    def __init__(
        self,
        output: PictureOutput,
        size: tuple[int, int],
        style: Style,
        *,
        step_us: float,
        instants_us: Sequence[int] | None = None,
        start_us: int | None = None,
        frames: bool | None = None,
        caption: Caption = caption,
        folder: Path | None = None,
        max_pictures: int = MOST_PICTURES,
    ) -> None:
        self._output, self._size, self._style = output, size, style
        self._step_us, self._given_us = step_us, instants_us
        self._start_us, self._with_frames, self._caption = start_us, frames, caption
        self._number = 0  # of the instant to draw next
        self._drawn = self._frames_came = 0
        self._most = max_pictures
        self._first_us: dict[str, int] = {}  # times of the first event and the first frame
        self._last_event_us = self._last_frame_us = _LONG_AGO
        self._told_us = _LONG_AGO  # all events before this have come
        self._frames_over = False
        self._coming, self._frames = Backlog(folder), Backlog(folder)
        self._events = empty_events()  # taken from those coming
        self._shown: Picture | None = None  # the frame taken last

    def add_frame(self, t_ns: int, image: NDArray[Any]) -> None:
        """Take a frame (rows, columns) or (rows, columns, 3), 8 or 16 bit, of time `t_ns` [ns].

        Frames come sorted by time.
        """
        t_us = microseconds(t_ns)
        self._frames_came += 1
        self._first_us.setdefault("frame", t_us)
        if self._with_frames is not False:
            self._with_frames = True
            self._last_frame_us = t_us
            self._frames.append(t_us, reduced(image, self._size))
        self._draw_up_to(self._known_us())

    def add_events(self, events: Events) -> None:
        """Take events, sorted, not before those of earlier calls; there may be none."""
        if events.size:
            self._first_us.setdefault("event", int(events["t"][0]))
            self._last_event_us = int(events["t"][-1])
            self._coming.append(self._last_event_us, without_causes(events))
            self._draw_up_to(self._known_us())

    def complete_until(self, t_us: int) -> None:
        """Take notice that no event before `t_us` will come any more."""
        self._told_us = max(self._told_us, t_us)
        self._draw_up_to(self._known_us())

    def no_more_frames(self) -> None:
        """Take notice that no frame will come any more."""
        self._frames_over = True
        self._draw_up_to(self._known_us())

    def finish(self) -> bool:
        """Draw the remaining instants, the last event included; False without events and frames."""
        if max(self._last_event_us, self._last_frame_us) == _LONG_AGO:
            return False
        if self._start_us is None:
            self._start_us = min(self._first_us.values())
        if self._given_us is not None:
            self._draw_up_to(_FAR_OFF)
            return True
        self._draw_up_to(max(self._last_event_us, self._last_frame_us))
        next_us = self._next_us()
        to_come = self._output.whole and next_us - self._step_us <= self._last_event_us
        if to_come or not self._drawn:
            self._draw(next_us)
        return True

    def close(self) -> None:
        self._coming.close()
        self._frames.close()

    def _known_us(self) -> int:
        """Return the time of the last instant of which everything has come."""
        events_us = max(self._last_event_us, self._told_us)
        if self._frames_over or self._with_frames is False:
            return events_us
        return min(events_us, self._last_frame_us - 1)

    def _begin(self) -> bool:
        """Set the clock once the first frame and event are known; tell whether it is set."""
        if self._start_us is None:
            first = self._first_us
            frame_known = "frame" in first or self._frames_over
            event_known = "event" in first or self._told_us > first.get("frame", _FAR_OFF)
            if frame_known and event_known:
                self._start_us = min(first.values())
        return self._start_us is not None

    def _next_us(self) -> int:
        """Return the instant to draw next; far off if there is none."""
        assert self._start_us is not None
        self._number = self._output.wanted_from(self._number)
        if self._given_us is None:
            return self._start_us + round((self._number + 1) * self._step_us)
        return self._given_us[self._number] if self._number < len(self._given_us) else _FAR_OFF

    def _draw_up_to(self, t_us: int) -> None:
        """Draw the instants up to `t_us` and forget what no later one needs."""
        if not self._begin():
            return
        while (next_us := self._next_us()) <= t_us and next_us != _FAR_OFF:
            self._draw(next_us)
        since_us = next_us - self._style.window_us
        self._events = self._events[np.searchsorted(self._events["t"], since_us) :]
        while self._coming and self._coming.time(0) < since_us:
            self._coming.drop()
        self._drop_frames(next_us)

    def _draw(self, t_us: int) -> None:
        assert self._start_us is not None
        while self._coming and not (self._events.size and self._events["t"][-1] >= t_us):
            self._events = np.concatenate([self._events, self._coming.take()])
        window = [t_us - self._style.window_us, t_us]
        first, last = np.searchsorted(self._events["t"], window)
        events = self._events[first:last]
        panels = [draw(events, *self._size, t_us, self._style)]
        if self._with_frames:
            panels.insert(0, self._frame_at(t_us))
        text = self._caption(t_us - self._start_us, int(events.size))
        if self._drawn >= max(self._most, _A_FRAME * self._frames_came):
            raise NotWritten(
                f"over {self._drawn:,} pictures of {self._frames_came:,} frames, as with a wrong"
                " time: leave it out, and let 'adv2e render' draw a part"
            )
        self._output.add(self._number, Cell(tuple(panels), text))
        self._drawn += 1
        self._number += 1

    def _drop_frames(self, t_us: int) -> None:
        """Forget the frames that have a later one at or before `t_us`."""
        while len(self._frames) > 1 and self._frames.time(1) <= t_us:
            self._frames.drop()

    def _frame_at(self, t_us: int) -> Picture:
        self._drop_frames(t_us)
        if self._frames and self._frames.time(0) <= t_us:
            image = self._frames.take()
            self._shown = image if image.ndim == 3 else np.repeat(image[:, :, None], 3, axis=2)
        if self._shown is None:
            self._shown = np.full((self._size[1], self._size[0], 3), 128, np.uint8)
        return self._shown


def reduced(image: NDArray[Any], size: tuple[int, int]) -> Picture:
    """Return a frame in 8 bits and of `size` (width, height)."""
    image = eight_bit(image)
    if image.shape[1::-1] != size:
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return image.astype(np.uint8, copy=False)

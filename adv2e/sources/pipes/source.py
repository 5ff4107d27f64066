"""Frames through standard input: each is read once, and none is kept."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from io import BufferedIOBase
from pathlib import Path

from adv2e.errors import DataError
from adv2e.geometry import Size
from adv2e.process.signals import first_interrupt
from adv2e.sources.base import GivenTimes, Selection, Source
from adv2e.sources.bayer import in_colour, light_of
from adv2e.sources.frame import Shot
from adv2e.sources.pipes.stream import (
    LONGEST_LINE,
    MAGIC,
    NAME,
    PIXEL_FORMATS,
    Layout,
    Stream,
    raw_layout,
    standard_input,
    y4m_layout,
)

_A_MOMENT_S = 0.2
"""A terminal interrupts one process after the other: a producer may end before we hear of it."""


def open_source(
    given: GivenTimes,
    selection: Selection,
    *,
    pixel_format: str | None = None,
    size: Size | None = None,
    file: BufferedIOBase | None = None,
) -> PipeSource:
    """Return the frames that come through standard input, or another stream.

    Parameters
    ----------
    pixel_format : str, optional
        One of `PIXEL_FORMATS`: raw video comes, of this `size`; default: Y4M does.
    file : binary file, optional
        Default: standard input.

    Raises
    ------
    DataError
        Nothing that can be read, no times, or fewer than one frame.
    """
    stream = Stream(standard_input() if file is None else file)
    begin = stream.peek(len(MAGIC))
    if not begin:
        raise DataError(f"{NAME}: nothing came through it")
    if begin == MAGIC:
        if pixel_format is not None:
            raise DataError(f"{NAME}: is Y4M, which says its pixels: leave --pixel-format out")
        return PipeSource(stream, y4m_layout(stream), given, selection)
    if pixel_format is None or size is None:
        raise DataError(
            f"{NAME}: is not Y4M; let FFmpeg write -f yuv4mpegpipe, or raw frames, -f rawvideo, and"
            f" say --size WxH and --pixel-format: {', '.join(PIXEL_FORMATS)}"
        )
    return PipeSource(stream, raw_layout(size, pixel_format), given, selection)


class PipeSource(Source):
    """Frames of a stream that is read once."""

    def __init__(
        self, stream: Stream, layout: Layout, given: GivenTimes, selection: Selection
    ) -> None:
        has_clock = given.timestamps is not None
        super().__init__(Path(NAME), layout.kind, selection, has_clock)
        self.waits = True
        self._stream, self._layout, self._given = stream, layout, given
        self._times: list[int] | None = None
        self._rate = given.rate or layout.rate
        self._take_times()
        self._first: bytes | None = self._next(0)
        if self._first is None:
            raise DataError(f"{NAME}: no frames came through it")
        shot = self._shot(0, self._first)
        light = layout.light
        if selection.bayer is not None:
            light = replace(light_of(selection.bayer), full_scale=light.full_scale)
        self._describe(shot.load(), shot.label, light)
        if layout.note and selection.bayer is None:
            self.notes.append(layout.note)

    @contextmanager
    def capturing(self, told: str) -> Iterator[None]:
        """Within the context, end the frames by the first SIGINT, which says `told`."""
        if self._stream.pipe is None:
            yield
            return
        with first_interrupt(told) as interrupt:
            self._stream.interrupt = interrupt
            try:
                yield
            finally:
                self._stream.interrupt = None

    def _take_times(self) -> None:
        if self._given.timestamps is not None:
            self._times, self._rate = self._take_list(self._given), None
        elif self._given.time_unit is not None:
            raise DataError(f"{NAME}: --time-unit is for lists of times, and none is given")
        elif self._rate is None:
            raise DataError(
                f"{NAME}: no times of its frames are known: give --fps F or --timestamps FILE"
            )
        if self._given and self._layout.rate is not None:
            self.notes.append(f"{self._given} replaces the {self._layout.rate.hz} Hz of the stream")

    def _time_ns(self, number: int) -> int:
        if self._rate is not None:
            return self._rate.time_ns(number)
        assert self._times is not None
        if number >= len(self._times):
            raise DataError(f"{self._given.timestamps}: {number} times, and more frames come")
        return self._times[number]

    def _next(self, number: int) -> bytes | None:
        """Return the bytes of the next frame; None at the end."""
        before = f"{NAME}: ends within frame {number}"
        if self._layout.marked:
            line = self._stream.line(LONGEST_LINE)
            if not line:
                return None
            begins = line.startswith(b"FRAME ")
            if line != b"FRAME\n" and not (begins and line.endswith(b"\n")):
                if b"FRAME\n".startswith(line) or (begins and len(line) < LONGEST_LINE):
                    self._cut_short(before)
                    return None
                raise DataError(f"{NAME}: damaged before frame {number}: no line FRAME")
        data = self._stream.read(self._layout.nbytes)
        if len(data) == self._layout.nbytes:
            return data
        if not data and not self._layout.marked:
            return None
        self._cut_short(f"{before}, after {len(data):,} of {self._layout.nbytes:,} bytes")
        return None

    def _cut_short(self, fault: str) -> None:
        if self._was_interrupted():
            return
        if not self.selection.allow_damaged:
            raise DataError(f"{fault}; --allow-damaged takes those before")
        self._note(fault)

    def _was_interrupted(self) -> bool:
        """Tell whether a SIGINT ended the frames, which may be known a moment after their end."""
        interrupt = self._stream.interrupt
        return interrupt is not None and interrupt.comes_before(within_s=_A_MOMENT_S)

    def _shot(self, number: int, data: bytes) -> Shot:
        label = f"{NAME}: frame {number}"
        shot = Shot(self._time_ns(number), label, partial(self._layout.frame, data, label))
        return shot if self.selection.bayer is None else in_colour(shot, self.selection.bayer)

    def shots(self) -> Iterator[Shot]:
        """Yield every frame as it comes.

        Raises
        ------
        DataError
            The stream ends within a frame, or does not fit the times; it was read before.
        """
        if self._first is None:
            raise DataError(f"{NAME}: its frames were read, and come only once")
        data: bytes | None = self._first
        self._first = None
        number = 0
        while data is not None:
            yield self._shot(number, data)
            number += 1
            data = self._next(number)
        fault = ""
        if self._times is not None and number != len(self._times):
            fault = f"{self._given.timestamps}: {len(self._times)} times for {number} frames"
            if not self._was_interrupted():
                raise DataError(fault)
        if self._stream.interrupt is not None and self._stream.interrupt.came:
            self.ended_by_hand = number
            self._note(f"{NAME}: ended by hand (Ctrl-C) after {number} frames")
            if fault:
                self._note(f"{fault}: the first {number} are taken")

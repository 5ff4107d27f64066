"""A recording: events, the frames beside them if there are any, and what is wrong with it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.events import Events
from adv2e.sources.frame import Frame, Image, Light, Pixels, as_pixels, odd_white
from adv2e.sources.stored import recorded_light


@dataclass(frozen=True)
class Recording:
    """The content of an event file.

    Attributes
    ----------
    path : str
        What was read.
    layout : str
        ``text``, ``davis240c``, ``monash`` and others: see :mod:`adv2e.formats.registry`.
    width, height : int
        Geometry [pixels]; zero when nothing tells.
    events : array of EVENT_DTYPE
        Sorted by time, those of one time as in the file; all inside the geometry.  Of CAUSED_DTYPE
        where the file has causes.
    frame_times_ns : array of int64 or None
        Times of the frames on the clock of the events [ns]; None without frames.
    metadata : dict
        What the file says of itself, if this program wrote it.
    problems : list of str
        What is doubtful in the file and what was done about it, a line each.
    images : callable
        Returns an iterator over the images of the frames.
    """

    path: str
    layout: str
    width: int
    height: int
    events: Events
    frame_times_ns: NDArray[np.int64] | None = None
    metadata: dict[str, Any] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    images: Callable[[], Iterator[Image | Pixels]] = field(default=lambda: iter(()), repr=False)

    @property
    def light(self) -> Light:
        """What the numbers of the frames stand for; see :func:`recorded_light`."""
        return recorded_light(self.metadata, self.path)

    @property
    def encoding(self) -> str:
        """What ``frames.encoding: auto`` means for the frames."""
        return self.light.encoding

    def frames(self) -> Iterator[Frame]:
        """Yield the frames one by one, as often as asked.

        Raises
        ------
        DataError
            An image cannot be read.
        """
        times = [] if self.frame_times_ns is None else self.frame_times_ns.tolist()
        stored = self.light.full_scale
        first: float | None = None
        for number, (t_ns, image) in enumerate(zip(times, self.images(), strict=True)):
            pixels = as_pixels(image)
            first = pixels.white if number == 0 else first
            odd = "" if stored is not None else odd_white(pixels, first)
            label = f"{self.path}: frame {number}"
            yield Frame(t_ns, pixels.image, label, pixels.alpha, stored or first, odd)

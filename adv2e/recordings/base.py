"""A recording: events, the frames beside them if there are any, and what is wrong with it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.events import Events
from adv2e.sources.base import Frame, Image


def _no_images() -> Iterator[Image]:
    return iter(())


@dataclass(frozen=True)
class Recording:
    """The content of an event file.

    Attributes
    ----------
    path : str
        What was read.
    layout : str
        ``text``, ``davis240c``, ``monash`` or ``npz``.
    width, height : int
        Geometry [pixels]; zero when nothing tells.
    events : array of EVENT_DTYPE
        Sorted by (t, y, x, p); all inside the geometry.
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
    images: Callable[[], Iterator[Image]] = field(default=_no_images, repr=False)

    @property
    def encoding(self) -> str:
        """What ``frames.encoding: auto`` means for the frames, as a conversion of them takes it.

        Frames that cameras recorded beside events are linear; those that this program stored are
        encoded as it read them.
        """
        stored = self.metadata.get("source")
        return str(stored.get("encoding", "linear")) if isinstance(stored, dict) else "linear"

    def frames(self) -> Iterator[Frame]:
        """Yield the frames one by one, as often as asked.

        Raises
        ------
        DataError
            An image cannot be read.
        """
        times = [] if self.frame_times_ns is None else self.frame_times_ns.tolist()
        for t_ns, image in zip(times, self.images(), strict=True):
            yield Frame(t_ns, image)


def parse_description(text: str, label: str, problems: list[str]) -> dict[str, Any]:
    """Return what a file of ours says of itself; if that is broken, {} and a problem."""
    try:
        description = json.loads(text)
    except ValueError:
        description = None
    if isinstance(description, dict):
        return description
    problems.append(f"{label}: not a JSON mapping, ignored")
    return {}


def described_geometry(description: dict[str, Any]) -> tuple[int, int] | None:
    """Return (width, height) [pixels] that a description holds, or None."""
    width, height = description.get("width"), description.get("height")
    if isinstance(width, int) and isinstance(height, int) and width > 0 and height > 0:
        return width, height
    return None

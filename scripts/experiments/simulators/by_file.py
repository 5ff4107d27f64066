"""Any simulator, by the events that it wrote: in every format that adv2e reads."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from adv2e.errors import DataError
from adv2e.events import Events
from adv2e.formats.reading import open_events, read_events
from adv2e.geometry import Size
from experiments.simulators.clip import Clip

FIRST_FRAME = "start"
"""In place of a number of seconds: that of the clip's first frame."""


@dataclass(frozen=True)
class ByFile:
    """Events that are there already.

    Attributes
    ----------
    name : str
    path : Path
    added : float or None
        What is added to their times [s]; None: the time of the clip's first frame.
    """

    name: str
    path: Path
    added: float | None = 0.0

    @property
    def nature(self) -> str:
        """Where they come from."""
        return f"events that it wrote, {self.path.name}"

    @cached_property
    def _held(self) -> tuple[Events, tuple[int, int], bool]:
        """Events, their size, and whether the file states it."""
        recording = read_events(self.path)
        stated = open_events(self.path).facts.geometry is not None
        return recording.events, (recording.width, recording.height), stated

    def events(self, clip: Clip, seed: int) -> Events:
        """Return the events of a clip.

        Raises
        ------
        DataError
            They are of another size, or none is within the clip.
        """
        events, size, stated = self._held
        if size != clip.size if stated else size[0] > clip.size[0] or size[1] > clip.size[1]:
            raise DataError(
                f"{self.path}: events of {Size(*size)} pixels, but frames of {Size(*clip.size)}"
            )
        first, last = (int(t) // 1000 for t in clip.times_ns[[0, -1]])
        events = events.copy()
        events["t"] += first if self.added is None else round(1e6 * self.added)
        if not ((events["t"] >= first) & (events["t"] <= last)).any():
            raise DataError(
                f"{self.path}: no event between the first and last frame, {first / 1e6:g} to"
                f" {last / 1e6:g} s; {self.name}={self.path}@{FIRST_FRAME} is for times that begin"
                " with the first frame, and @SECONDS adds so many"
            )
        return events

    @property
    def levels(self) -> None:
        """None: it cannot be simulated anew."""
        return None

    def with_levels(self, on: float, off: float) -> ByFile:
        """Return it as it is."""
        return self

"""Any simulator, by the events that it wrote: in every format that adv2e reads."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from adv2e.errors import DataError
from adv2e.events import Events
from adv2e.formats.reading import read_events
from adv2e.formats.recording import Recording
from experiments.simulators.clip import Clip


@dataclass(frozen=True)
class ByFile:
    """Events that are there already, on the clock of the clip."""

    name: str
    path: Path

    @property
    def nature(self) -> str:
        """Where they come from."""
        return f"events that it wrote, {self.path.name}"

    @cached_property
    def recording(self) -> Recording:
        """The file, read once."""
        return read_events(self.path)

    def events(self, clip: Clip, seed: int) -> Events:
        """Return the events of a clip.

        Raises
        ------
        DataError
            They are of another size, or none is within the clip.
        """
        recording = self.recording
        if (recording.width, recording.height) != clip.size:
            raise DataError(
                f"{self.path}: events of {recording.width}x{recording.height} pixels, but frames of"
                f" {clip.size[0]}x{clip.size[1]}"
            )
        first, last = (int(t) // 1000 for t in clip.times_ns[[0, -1]])
        events = recording.events
        if not ((events["t"] >= first) & (events["t"] <= last)).any():
            raise DataError(
                f"{self.path}: no event between the first and last frame, {first / 1e6:g} to"
                f" {last / 1e6:g} s; its times must be on the clock of the recording"
            )
        return events

    @property
    def levels(self) -> None:
        """None: it cannot be simulated anew."""
        return None

    def with_levels(self, on: float, off: float) -> ByFile:
        """Return it as it is."""
        return self

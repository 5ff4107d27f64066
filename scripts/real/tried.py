"""What is tried in search of a model of a real recording, and what is not."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from adv2e.config import Config
from adv2e.diagnosis.fitting.candidates import Candidate, FitParameter
from adv2e.diagnosis.fitting.library import library
from adv2e.diagnosis.hints.collect import Hints
from adv2e.diagnosis.hints.readouts import Pulse

NOISE_HZ = 0.1
NOISES = ("leak", "photo_leak", "shot_noise", "photoreceptor_noise", "hot_pixels")
"""What makes events by itself is not added if it moves still pixels farther from the measured rate
by more [Hz]: noise at random costs this score less than events in the wrong place, and is no
explanation.  Other effects change the rate of still pixels through the thresholds that match the
totals, by which noise of the frames fires, which is no noise of the camera's."""

EXACT = Candidate("exact filter", (), ((),), (("pixel.low_pass.update", "exact"),))
"""Replaces the printed filter, whose gain is known to be wrong, whatever that does to the score."""

OWN = (
    Candidate(
        "interpolation",
        (),
        ((),),
        (("sampling.interpolation", "flow"), ("sampling.last_interval", "corrected")),
    ),
    Candidate("initial_reference", (), ((),), (("pixel.initial_reference", "random"),)),
    Candidate(
        "log_response",
        (FitParameter("pixel.log_response.linear_below", 1.01, 100.0),),
        ((2.72,), (10.0,), (40.0,)),
        (("pixel.log_response.floor", 0.5),),
    ),
)
"""What is no effect of the camera, but of how its frames were simulated."""

CLIPPED_BLACK = Candidate(
    "clipped_black",
    (
        FitParameter("frames.black_level_dn", 0.02, 100.0),
        FitParameter("frames.black_depth_dn", 0.01, 100.0),
    ),
    ((9.0, 3.0), (14.0, 5.0)),
)
"""Beside the black level of the library: how far light falls on where it is clipped at black."""

UNSEEN = {
    "initial_reference": "a choice of the simulation, tried before the camera's effects",
    "thresholds": "matched to the totals each time",
    "timestamp_tick": "does not move this score",
    "readout": "does not move this score at these rates",
    "flicker": "its frequency is that of a line in the rate, which is not looked for",
    "threshold_drift": "not within half a second",
    "clock_drift": "not within half a second",
    "hot_pixels": "a few pixels do not move this score",
    "dead_pixels": "a few pixels do not move this score",
}
"""Effects of the library that are left out, and why."""


COUPLING = "frame_coupling"
"""Tried where bursts of events after each frame tell when the signal leaps, not to be guessed from
events that all hang on the frames."""


def of_the_camera(
    declared: Config, seconds: float, only: Collection[str] = (), pulse: Pulse | None = None
) -> list[Candidate]:
    """Return the effects of the camera to try.

    Parameters
    ----------
    declared : Config
    seconds : float
        Length of what is fitted to.
    only : collection of str
        With these names; empty: all.
    pulse : Pulse, optional
        That follows each frame.
    """
    found = [CLIPPED_BLACK, *library(declared, Hints(seconds, (), 1, pulse=pulse))]
    unseen = {*UNSEEN, *(() if pulse else (COUPLING,))}
    return [one for one in found if one.name not in unseen and (not only or one.name in only)]


def tried_names() -> list[str]:
    """Return the names of the effects of the camera that can be tried."""
    return [*dict.fromkeys(one.name for one in of_the_camera(Config(), 1.0)), COUPLING]


def label(name: str) -> Candidate:
    """Return what changes no key, for the name of a step."""
    return Candidate(name, (), ((),))


@dataclass(frozen=True)
class Added:
    """A model with the effect that was added last, or one that was tried.

    Attributes
    ----------
    candidate : Candidate
        What was added; without parameters where no key is to be told.
    values : tuple of float
        Of its parameters.
    config : Config
        The model, its thresholds matched.
    score : float
    still_hz : float, optional
        Rate of the still pixels [Hz].
    """

    candidate: Candidate
    values: tuple[float, ...]
    config: Config
    score: float
    still_hz: float | None

    @classmethod
    def plain(
        cls, name: str, config: Config, score: float = np.nan, still_hz: float | None = None
    ) -> Added:
        """Return a step that adds no key."""
        return cls(label(name), (), config, score, still_hz)

    def named(self, name: str) -> Added:
        """Return the model under the name of a step that adds no key."""
        return replace(self, candidate=label(name), values=())

    def noisier(self, before: Added, measured_hz: float | None) -> bool:
        """Tell whether it is noise that takes the still pixels away from what was measured."""
        if self.candidate.name not in NOISES:
            return False
        if measured_hz is None or self.still_hz is None or before.still_hz is None:
            return False
        miss, was = abs(self.still_hz - measured_hz), abs(before.still_hz - measured_hz)
        return miss > was + NOISE_HZ

    def text(self) -> str:
        """Return name and values."""
        keys = self.candidate.settings_in(self.config, self.candidate.scaled(self.values))
        named = ((key.rpartition(".")[2], value) for key, value in keys.items())
        values = ", ".join(f"{key} {_short(value)}" for key, value in named)
        return f"{self.candidate.name}{f' ({values})' if values else ''}"


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)

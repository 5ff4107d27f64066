"""Progress of a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Progress:
    """Progress of a diagnosis: its stage, and the simulations done.

    The total number of simulations is not known before: it depends on their results.

    Attributes
    ----------
    stage : str
        In a few words.
    simulations : int
        Done since the diagnosis began, in all stages.
    """

    stage: str
    simulations: int

"""How far a diagnosis is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Progress:
    """What a diagnosis is doing.

    How many simulations there will be in all is not known: it depends on what they show.

    Attributes
    ----------
    stage : str
        In a few words.
    simulations : int
        Done since the diagnosis began, in all stages.
    """

    stage: str
    simulations: int

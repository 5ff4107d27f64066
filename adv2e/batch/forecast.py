"""Forecast of the events, bytes and time of a batch, from short parts of some sequences.

A sequence is sampled with a probability in proportion to its bytes, at even steps along all of
them.  Then the mean over the sample of the events from each byte, times all bytes, is an unbiased
estimate of the total (Hansen and Hurwitz, 1943, doi:10.1214/aoms/1177731356).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from adv2e.batch.plan import Task
from adv2e.batch.work import Job, config_of
from adv2e.conversion.estimate import amount_text, estimate, room_text
from adv2e.errors import Adv2eError
from adv2e.files.states import free_bytes

_LOOKED_AT = 6
_SHARE = 0.1
"""Longest time of a forecast, as a share of the time of the batch."""

_FAR_APART = 5.0
"""Factor from which on it is said how far sequences differ."""


@dataclass(frozen=True)
class Forecast:
    """Estimate of the events, bytes and time of a batch.

    Attributes
    ----------
    events, bytes, seconds : float
        Of all sequences that are to be converted.
    sequences, looked_at : int
        Number of these sequences, and of those in the sample.
    apart : float
        Ratio between the sampled sequences in the events from a byte of source.
    room : int
        Free disk space where the results go [bytes].
    """

    events: float
    bytes: float
    seconds: float
    sequences: int
    looked_at: int
    apart: float
    room: int

    def text(self) -> str:
        """Return it for people."""
        told = amount_text(self.events, self.bytes, self.seconds)
        text = f"{told}, by short parts of {self.looked_at} of {self.sequences} sequences"
        if self.apart > _FAR_APART:
            text += f"; from a byte of source, some make {self.apart:.0f} times as many as others"
        return text + room_text(self.bytes, self.room)


def forecast(
    tasks: Sequence[Task], dest: Path, job_of: Callable[[Task], Job], jobs: int
) -> Forecast | None:
    """Return an estimate for the conversion of all `tasks`; None where there is too little to tell.

    It takes about a tenth of the time of the conversion at most, which is too little where
    sequences are few and short.

    Parameters
    ----------
    tasks : sequence of Task
    dest : Path
        Where the results go.
    job_of : callable
        Returns the conversion of a task.
    jobs : int
        Conversions at a time.
    """
    total = sum(max(1, task.state.bytes) for task in tasks)
    rates: list[tuple[float, float, float]] = []
    looked_at, spent = 0, 0.0
    for task, weight in _chosen(tasks, total):
        if rates and spent > _SHARE * total * sum(rate[2] for rate in rates) / len(rates):
            break
        job = job_of(task)
        share = _SHARE * total / max(1, task.state.bytes) * weight / _LOOKED_AT
        how: dict[str, Any] = {"threads": job.threads, "share": share, **job.options}
        try:
            found = estimate(job.source, job.output, config_of(job), **how)
            if found is None and not rates:  # it alone may have all of it
                how["share"] *= _LOOKED_AT / weight
                found = estimate(job.source, job.output, config_of(job), **how)
        except (Adv2eError, OSError):  # what is wrong is told when it is converted
            continue
        if found is not None:
            size = max(1, task.state.bytes)
            rates += [(found.events / size, found.bytes / size, found.seconds / size)] * weight
            looked_at += 1
            spent += found.spent
    if not rates:
        return None
    events, made, seconds = (total * sum(one) / len(rates) for one in zip(*rates, strict=True))
    least, most = min(rates)[0], max(rates)[0]
    return Forecast(
        events,
        made,
        seconds / jobs,
        len(tasks),
        looked_at,
        most / least if least else 1.0,
        free_bytes(dest),
    )


def _chosen(tasks: Sequence[Task], total: int) -> list[tuple[Task, int]]:
    """Return the tasks at even steps along the bytes of all, with how many steps end in each."""
    marks = [(k + 0.5) * total / _LOOKED_AT for k in range(_LOOKED_AT)]
    chosen, end = [], 0
    for task in tasks:
        begin, end = end, end + max(1, task.state.bytes)
        here = sum(begin <= mark < end for mark in marks)
        if here:
            chosen.append((task, here))
    middle = len(chosen) // 2  # what is looked at may be less than all
    return chosen[middle:] + chosen[:middle]

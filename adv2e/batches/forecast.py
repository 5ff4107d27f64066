"""Forecast of the events, bytes and time of a batch, from short parts of some sequences."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from adv2e.batches.plan import Task
from adv2e.batches.work import Job, config_of
from adv2e.conversion.estimate import Estimate, estimate
from adv2e.errors import Adv2eError

_LOOKED_AT = 6
_SHARE = 0.1
"""Longest time of a forecast, as a share of the time of the batch."""

_FAR_APART = 5.0
"""Factor from which on it is said how far sequences differ."""


def forecast(tasks: Sequence[Task], job_of: Callable[[Task], Job], jobs: int) -> Estimate | None:
    """Estimate the conversion of all `tasks`; None where there is too little to tell.

    A sequence is sampled with a probability in proportion to its bytes, at even steps along all of
    them.  Then the mean over the sample of the events from each byte, times all bytes, is an
    unbiased estimate of the total (Hansen and Hurwitz, 1943, doi:10.1214/aoms/1177731356).

    It takes about a tenth of the time of the conversion at most, which is too little where
    sequences are few and short.

    Parameters
    ----------
    tasks : sequence of Task
    job_of : callable
        Returns the conversion of a task.
    jobs : int
        Conversions at a time.
    """
    total = sum(max(1, task.state.bytes) for task in tasks)
    marks = [(k + 0.5) * total / _LOOKED_AT for k in range(_LOOKED_AT)]
    chosen, end = [], 0
    for task in tasks:
        begin, end = end, end + max(1, task.state.bytes)
        if weight := sum(begin <= mark < end for mark in marks):
            chosen.append((task, weight))
    middle = len(chosen) // 2  # begin there, as what is looked at may be less than all
    rates: list[tuple[float, float, float]] = []
    looked_at, spent = 0, 0.0
    for task, weight in chosen[middle:] + chosen[:middle]:
        if rates and spent > _SHARE * total * sum(rate[2] for rate in rates) / len(rates):
            break
        job, size = job_of(task), max(1, task.state.bytes)
        share = _SHARE * total / size * weight / _LOOKED_AT
        how: dict[str, Any] = {"threads": job.threads, "share": share, **job.options}
        try:
            found = estimate(job.source, job.output, config_of(job), **how)
            if found is None and not rates:  # it alone may have all of it
                how["share"] *= _LOOKED_AT / weight
                found = estimate(job.source, job.output, config_of(job), **how)
        except (Adv2eError, OSError):  # what is wrong is told when it is converted
            continue
        if found is not None:
            rates += [(found.events / size, found.bytes / size, found.seconds / size)] * weight
            looked_at += 1
            spent += found.spent
    if not rates:
        return None
    events, made, seconds = (total * sum(one) / len(rates) for one in zip(*rates, strict=True))
    basis = f"short parts of {looked_at} of {len(tasks)} sequences"
    least, most = min(rates)[0], max(rates)[0]
    if least and most / least > _FAR_APART:
        basis += f"; from a byte of source, some make {most / least:.0f} times as many as others"
    return Estimate(events, made, seconds / jobs, basis, spent)

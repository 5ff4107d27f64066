"""One conversion of a batch, as any process does it: here, or on another machine."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from adv2e.batch.states import digest_of
from adv2e.errors import Adv2eError


@dataclass(frozen=True)
class Job:
    """One conversion.

    Attributes
    ----------
    name : str
        Of the sequence.
    source, output : str
    config : dict
        The configuration, as :func:`adv2e.config.to_dict` gives it.
    drawn : dict
        Which of its numbers were drawn.
    effect_files : tuple of str
        Effects of the user's own.
    options : dict
        Further arguments of :func:`adv2e.convert`.
    threads : int
    """

    name: str
    source: str
    output: str
    config: dict[str, Any]
    drawn: dict[str, int | float]
    effect_files: tuple[str, ...]
    options: dict[str, Any] = field(default_factory=dict)
    threads: int = 1


def do(job: Job) -> dict[str, Any]:
    """Convert, and return what the manifest says of it: ``error`` where that went wrong."""
    from adv2e.config import from_dict  # noqa: PLC0415 - in the process that converts
    from adv2e.config.effect_files import load_effects  # noqa: PLC0415
    from adv2e.conversion.convert import convert  # noqa: PLC0415

    try:
        source = digest_of(Path(job.source))
        effects = [effect for file in job.effect_files for effect in load_effects(file)]
        config = from_dict(job.config, effects=effects)
        with warnings.catch_warnings(record=True) as doubts:
            warnings.simplefilter("always")
            made = convert(
                job.source,
                job.output,
                config,
                overwrite=True,
                take="frames",
                threads=job.threads,
                **job.options,
            )
        return {
            "source_sha256": source,
            "sha256": digest_of(Path(job.output)),
            "events": made.events,
            "frames": made.frames,
            "duration_s": made.duration_s,
            "seconds": round(made.seconds, 3),
            "notes": [*made.notes, *(str(one.message) for one in doubts)],
        }
    except Adv2eError as error:
        return {"error": str(error)}
    except OSError as error:
        return {"error": f"{error.filename or job.source}: {error.strerror or error}"}
    except Exception as error:
        return {"error": f"internal error: {type(error).__name__}: {error}"}


Engine = Callable[[Iterable[Job], int], Iterator[tuple[Job, dict[str, Any]]]]
"""Does jobs, so many at a time, and yields each with what :func:`do` returned, as they end."""

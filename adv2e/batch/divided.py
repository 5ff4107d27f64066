"""Sequences in parts: which jobs there are, in which order, and where their parts lie."""

from __future__ import annotations

import hashlib
import shutil
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from adv2e.batch.work import Job


def parts_folder(dest: Path, name: str) -> Path:
    """Return the folder of the parts of a sequence."""
    # one each, so that nobody removes a folder in which another is about to make one
    digest = hashlib.sha256(name.encode("utf-8", "surrogateescape")).hexdigest()
    return dest / f".adv2e-parts-{digest[:16]}"


def remove_parts(dest: Path, name: str) -> None:
    """Remove the parts of a sequence."""
    shutil.rmtree(parts_folder(dest, name), ignore_errors=True)


class Jobs(Iterator[Job | None]):
    """The jobs of a batch, for an engine (:data:`adv2e.batch.work.Engine`).

    Of each sequence its parts come first.  As soon as all of them are made, they are merged: so no
    more of them lie on the disk than are at work.

    Parameters
    ----------
    jobs : iterable of Job
        A whole sequence each.
    dest : Path
    split : int
        Parts of each; 1: it is converted whole.
    """

    def __init__(self, jobs: Iterable[Job], dest: Path, split: int) -> None:
        self._waiting: deque[Job] = deque()
        self._ready: deque[Job] = deque()
        self._missing: dict[str, int] = {}
        self._merging: dict[str, Job] = {}
        for job in jobs:
            if split == 1 or job.only_export:
                self._waiting.append(job)
                continue
            folder = parts_folder(dest, job.name)
            paths = tuple(str(folder / f"{k}-of-{split}.part") for k in range(1, split + 1))
            self._waiting += (
                replace(job, output=path, share=(k, split), export=None, export_folder="")
                for k, path in enumerate(paths, start=1)
            )
            self._missing[job.name] = split
            self._merging[job.name] = replace(job, parts=paths)

    def __next__(self) -> Job | None:
        if self._ready:
            return self._ready.popleft()
        while self._waiting:
            job = self._waiting.popleft()
            if job.share is None:
                return job
            if job.name in self._merging:
                Path(job.output).parent.mkdir(exist_ok=True)
                return job
        if self._merging:
            return None
        raise StopIteration

    def part_made(self, job: Job) -> None:
        """Take notice of a part."""
        self._missing[job.name] -= 1
        if not self._missing[job.name] and job.name in self._merging:
            self._ready.append(self._merging.pop(job.name))

    def give_up(self, job: Job) -> bool:
        """Drop what is left of the sequence of a job; return whether that is new."""
        return self._merging.pop(job.name, None) is not None or job.share is None

"""Batches of which SOURCE or DEST is a URL.

A remote tree is mirrored as a temporary tree of local files with the same names, sizes and times,
which are empty but for manifests.  Changes of remote files are recognised by size and time, or by
the digest that an object store reports; their content is not read for that.

The manifest is written locally and uploaded from time to time, as object stores cannot append.
Nor can they lock: nothing refuses a second batch.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path, PurePosixPath
from types import TracebackType
from typing import Any

from adv2e.batch import processes
from adv2e.batch.manifest import read_records
from adv2e.batch.transfer import (
    Scratch,
    changed_s,
    files_below,
    is_url,
    open_url,
    put,
    reaching,
    token,
)
from adv2e.batch.work import Engine, Job
from adv2e.errors import DataError

COPY_S = 10.0
"""Time between copies of the manifest."""


class Remote:
    """Shadows of what lies at URLs; a context that removes them.

    Parameters
    ----------
    source, dest : str
        URLs or paths.

    Attributes
    ----------
    source, dest : Path
        The shadows, or the paths.

    Raises
    ------
    Adv2eError
        One of them cannot be opened.
    """

    def __init__(self, source: str, dest: str) -> None:
        self._stack = ExitStack()
        self._urls: dict[Path, str] = {}
        self._tokens: dict[str, str] = {}
        self._dest_url = dest if is_url(dest) else ""
        try:
            with reaching(source):
                self.source = self._shadow(source) if is_url(source) else Path(source)
            with reaching(dest):
                self.dest = self._shadow(dest, is_dest=True) if is_url(dest) else Path(dest)
        except BaseException:
            self._stack.close()
            raise

    def __enter__(self) -> Remote:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stack.close()

    def _shadow(self, url: str, *, is_dest: bool = False) -> Path:
        system, path = open_url(url)
        scratch = self._stack.enter_context(Scratch())
        root = scratch / "shadow" / (PurePosixPath(path).name or "root")
        try:
            found = files_below(system, path)
        except FileNotFoundError:
            found = {}
        if not found and not is_dest:
            raise DataError(f"{url}: no such file or folder")
        for name, about in found.items():
            file = root / name
            file.parent.mkdir(parents=True, exist_ok=True)
            if is_dest and "/" not in name and name.startswith("manifest"):
                system.get_file(f"{path}/{name}", str(file))
                continue
            with file.open("wb") as empty:
                empty.truncate(about["size"])
            when = int(changed_s(about) * 1e9)
            os.utime(file, ns=(when, when))
            if is_dest:
                self._tokens[name] = token(about)
        if not found:
            root.mkdir(parents=True)
        self._urls[root] = url.rstrip("/")
        return root

    def digest(self, path: Path) -> str:
        """Return the digest that the manifest tells of an output, if it is what was put there."""
        if not path.is_relative_to(self.dest):
            return ""  # a source that looks different has changed
        name = path.relative_to(self.dest).as_posix()
        for record in read_records(self.dest).values():
            above = PurePosixPath(record.get("output", "")).parent
            digests = {record.get("output"): record.get("sha256")}
            digests |= {str(above / key): value for key, value in record.get("beside", {}).items()}
            if name not in digests:
                continue
            put_there = {str(above / key): value for key, value in record.get("remote", {}).items()}
            if _part(put_there, name) == _part(self._tokens, name) != {}:
                return digests[name] or ""
        return ""

    def engine(self, base: Engine | None, manifest: Path) -> Engine:
        """Return an engine that hands the jobs with their URLs to another one."""

        def run(jobs: Iterable[Job | None], count: int) -> Iterator[tuple[Job, dict[str, Any]]]:
            given = {job.name: job for job in jobs if job is not None}
            sent = [
                replace(job, source=self._url(job.source), output=self._url(job.output))
                for job in given.values()
            ]
            self._copy(manifest)
            copied = time.monotonic()
            try:
                for job, found in (base or processes.run)(sent, count):
                    yield given[job.name], found
                    if time.monotonic() > copied + COPY_S:
                        self._copy(manifest)
                        copied = time.monotonic()
            finally:
                self._copy(manifest)

        return run

    def _url(self, path: str) -> str:
        for root, url in self._urls.items():
            if Path(path) == root:
                return url
            if Path(path).is_relative_to(root):
                return f"{url}/{Path(path).relative_to(root).as_posix()}"
        return path

    def _copy(self, manifest: Path) -> None:
        if self._dest_url:
            with reaching(self._dest_url):
                system, path = open_url(self._dest_url)
                put(system, manifest, f"{path}/{manifest.name}")


def _part(files: dict[str, str], name: str) -> dict[str, str]:
    """Return the file of a name, or all files below it."""
    return {key: value for key, value in files.items() if key == name or key.startswith(f"{name}/")}

"""One picture or film on its way to its final name."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

from adv2e.errors import OutputError
from adv2e.files.staging import Staging, writing


class NotWritten(OutputError):
    """A picture or film could not be written; says how, and leaves out where."""


@contextmanager
def replacing(path: Path, overwrite: bool, staging: Staging | None = None) -> Iterator[Path]:
    """Give the body a temporary name with the suffix of `path`; rename when it ends well.

    If the body raises, what it wrote is removed and `path` stays as it was.  `staging` takes the
    file together with others, and says whether what exists is replaced.

    Raises
    ------
    OutputError
        `path` exists and `overwrite` is false, or it cannot be a file, or cannot be written.
    """
    with Staging(overwrite) if staging is None else nullcontext(staging) as files:
        part = files.file(path)
        try:
            with writing(path):
                files.prepare()
                yield part
        except NotWritten as error:
            raise OutputError(f"{path}: {error}") from error

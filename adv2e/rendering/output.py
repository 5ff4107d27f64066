"""One picture or film on its way to its final name."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from adv2e.sinks.staging import Staging


@contextmanager
def replacing(path: Path, overwrite: bool) -> Iterator[Path]:
    """Give the body a temporary name with the suffix of `path`; rename when it ends well.

    If the body raises, what it wrote is removed and `path` stays as it was.

    Raises
    ------
    OutputError
        `path` exists and `overwrite` is false, or it cannot be a file.
    """
    staging = Staging(overwrite)
    part = staging.file(path)
    try:
        staging.prepare()
        yield part
        staging.commit()
    except BaseException:
        staging.discard()
        raise

"""Processes that do not outlive the test that started them."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def running_python(
    script: str, *arguments: object, **options: object
) -> Iterator[subprocess.Popen]:
    """Run `script` in a Python of its own; what the body leaves running is killed.

    Without that, a process that hangs would not fail its test but stop all of them for good.
    """
    with subprocess.Popen(
        [sys.executable, "-c", script, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        **options,
    ) as process:
        try:
            yield process
        finally:
            process.kill()

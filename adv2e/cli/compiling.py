"""What is said while functions are compiled: that it happens once, and how far it is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from adv2e import compiled


@contextmanager
def compilation_told(log: Callable[[str], None] | None, progress: bool) -> Iterator[None]:
    """Say when compiling begins, if it does, and show its progress on stderr.

    Parameters
    ----------
    log : callable, optional
        Takes a line for people.
    progress : bool
        Show a bar: functions that are compiled, of those that the ones called so far consist of.
    """
    known: set[Callable[..., Any]] = set()
    bar: Any = None

    def told(function: Callable[..., Any]) -> None:
        nonlocal bar
        if not known and log is not None:
            lost = compiled.code_cache().why_not
            when = f"in every run, as it cannot be kept: {lost}" if lost else "once"
            log(f"compiling the pixel's kernel ({when}; about a minute)")
        if progress and bar is None:
            from tqdm import tqdm

            bar = tqdm(desc="compiling", unit="function", leave=False)
        known.update(compiled.parts_of(function))
        if bar is not None:
            bar.total = len(known)
            bar.update()

    with compiled.watched(told):
        try:
            yield
        finally:
            if bar is not None:
                bar.close()

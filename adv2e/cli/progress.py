"""Progress of compilation: a notice that the kernel is compiled once, and a bar."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from adv2e import compiled
from adv2e.process import bars

_MANY = 20
"""Functions that take long enough to be worth a line: a solver has twice as many and more."""


@contextmanager
def compilation_told(log: Callable[[str], None] | None, progress: bool) -> Iterator[None]:
    """Log the start of compilation, if there is any, and show its progress on stderr.

    Parameters
    ----------
    log : callable, optional
        Takes a line for people.
    progress : bool
        Show a bar: functions that are compiled, of those that the ones called so far consist of.
    """
    known: set[Callable[..., Any]] = set()
    done: set[Callable[..., Any]] = set()
    bar: Any = None
    is_said = log is None

    def told(function: Callable[..., Any]) -> None:
        nonlocal bar, is_said
        parts = compiled.parts_of(function)
        if not is_said and log is not None and len(parts) >= _MANY:
            is_said = True
            lost = compiled.code_cache().why_not
            when = f"in every run, as it cannot be kept: {lost}" if lost else "once"
            log(f"compiling the pixel's kernel ({when}; about a minute)")
        if progress and bar is None:
            bar = bars.bar(desc="compiling", unit="function")
        known.update(parts)
        if bar is not None:
            done.add(function)
            bar.total, bar.n = len(known), len(done)
            bar.refresh()

    with compiled.watched(told):
        try:
            yield
        finally:
            if bar is not None:
                bar.close()

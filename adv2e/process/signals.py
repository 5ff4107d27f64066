"""Signals that end the program: they remove unfinished files, and end it where it is.

See :mod:`adv2e.process.cleanup` for why.  Where files cannot be removed like that, a signal arrives
as an exception, and they are as for any error.

This is imported before all else, so that a signal that comes meanwhile is met: it imports little.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType

from adv2e.process import cleanup as unfinished
from adv2e.process.standard_error import errors_descriptor


class Terminated(BaseException):
    """A signal told the program to stop."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.exit_status = 128 + number


def stop_on_signals(*, silent: bool = False) -> list[int]:
    """Let SIGINT, SIGTERM and SIGHUP end the program from now on; return those that do.

    Ignored ones stay ignored, and nothing changes where the caller has handlers of its own, or is
    not the main thread.  `silent`: nothing is said of it, as the program that began this one does.
    """
    if threading.current_thread() is not threading.main_thread():
        return []
    caught = [number for number, handler in _usual().items() if signal.getsignal(number) is handler]

    def stop(number: int, frame: FrameType | None) -> None:
        for other in caught:
            signal.signal(other, signal.SIG_IGN)  # a second one must not stop the tidying up
        ending = KeyboardInterrupt() if number == signal.SIGINT else Terminated(number)
        if not unfinished.remove_all():
            raise ending
        if not silent:
            _say_at_once(last_words(ending))
        os._exit(128 + number)

    for number in caught:
        signal.signal(number, stop)
    return caught


@contextmanager
def stopping_on_signals() -> Iterator[None]:
    """Do what :func:`stop_on_signals` does, in the body only."""
    caught = stop_on_signals()
    try:
        yield
    finally:
        for number in caught:
            signal.signal(number, _usual()[number])


def _usual() -> dict[int, Callable[[int, FrameType | None], object] | signal.Handlers]:
    """Return the signals, and what Python does on them by itself."""
    names: dict[str, Callable[[int, FrameType | None], object] | signal.Handlers] = {
        "SIGINT": signal.default_int_handler,
        "SIGTERM": signal.SIG_DFL,
        "SIGHUP": signal.SIG_DFL,
    }
    return {getattr(signal, name): what for name, what in names.items() if hasattr(signal, name)}


def last_words(ending: BaseException) -> str:
    """Return what is said of an ending by a signal."""
    return f"stopped by {ending}" if isinstance(ending, Terminated) else "interrupted"


def _say_at_once(text: str) -> None:
    """Write one line to stderr past its buffer, which the main thread may be in the midst of."""
    with suppress(OSError):
        # over a progress bar, if there is one
        errors = errors_descriptor()
        start = "\r\x1b[K" if os.isatty(errors) else ""
        os.write(errors, f"{start}adv2e: {text}\n".encode())

"""Signals that end the program: they remove unfinished files, and end it where it is.

See :mod:`adv2e.process.signals` for why.  Where files cannot be removed like that, a signal arrives
as an exception, and they are as for any error.

Who takes what others send for as long as they please, such as frames of a camera, can have the
first SIGINT as the end of that: see :func:`first_interrupt`.

This is imported before all else, so that a signal that comes meanwhile is met: it imports little.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType

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
    stop = _Stop(caught, silent)
    for number in caught:
        signal.signal(number, stop)
    return caught


class _Stop:
    """Handler that ends the program."""

    def __init__(self, caught: list[int], silent: bool) -> None:
        self._caught, self._silent = caught, silent

    def __call__(self, number: int, frame: FrameType | None) -> None:
        for other in self._caught:
            signal.signal(other, signal.SIG_IGN)  # a second one must not stop the tidying up
        ending = KeyboardInterrupt() if number == signal.SIGINT else Terminated(number)
        if not remove_all():
            raise ending
        if not self._silent:
            _say_at_once(last_words(ending))
        os._exit(128 + number)


@contextmanager
def stopping_on_signals() -> Iterator[None]:
    """Install the handlers of :func:`stop_on_signals` for the body only."""
    caught = stop_on_signals()
    say_at_end(str)
    try:
        yield
    finally:
        for number in caught:
            signal.signal(number, _usual()[number])


class Interrupt:
    """The first SIGINT, which ends nothing by itself; see :func:`first_interrupt`."""

    def __init__(self, wakes: int) -> None:
        self.came = False
        self._wakes = wakes

    def comes_before(self, *descriptors: int, within_s: float | None = None) -> bool:
        """Wait for it, until a descriptor can be read or the time is over; tell if it came."""
        while not self.came:
            ready, _, _ = select.select([self._wakes, *descriptors], [], [], within_s)
            if self._wakes in ready and signal.SIGINT in os.read(self._wakes, 512):
                self.came = True
            if ready != [self._wakes]:  # else it was another signal
                break
        return self.came


@contextmanager
def first_interrupt(told: str) -> Iterator[Interrupt | None]:
    """Within the context, let the first SIGINT do no more than say `told`; the second one ends.

    Nothing changes, and None is given, where SIGINT would not end the program, as in Python, which
    has a handler of its own, and on Windows, where nobody can wait for it and for a pipe at once.
    """
    if not _can_wait():
        yield None
        return
    stop = signal.getsignal(signal.SIGINT)
    with _woken() as wakes:
        interrupt = Interrupt(wakes)

        def hear(number: int, frame: FrameType | None) -> None:
            signal.signal(signal.SIGINT, stop)
            interrupt.came = True
            if told:
                _say_at_once(told)

        signal.signal(signal.SIGINT, hear)
        try:
            yield interrupt
        finally:
            if signal.getsignal(signal.SIGINT) is hear:
                signal.signal(signal.SIGINT, stop)


def wait_for(descriptor: int) -> None:
    """Wait until a descriptor can be read; a signal that comes just before is not missed."""
    # as a rule something is there, and nothing has to be set up: a line is read byte by byte
    if not _can_wait() or select.select([descriptor], [], [], 0)[0]:
        return
    with _woken() as wakes:
        ready: list[int] = []
        while descriptor not in ready:
            ready, _, _ = select.select([wakes, descriptor], [], [])
            if wakes in ready:
                os.read(wakes, 512)


def _can_wait() -> bool:
    """Tell whether signals end the program here, and one can be waited for beside a pipe."""
    in_main = threading.current_thread() is threading.main_thread()
    ends = isinstance(signal.getsignal(signal.SIGINT), _Stop)
    return sys.platform != "win32" and in_main and ends


@contextmanager
def _woken() -> Iterator[int]:
    """Give a descriptor that can be read once a signal came.

    Handlers run between two steps of Python only, too late for a call that has just begun to wait;
    but the number of the signal is written at once, whichever thread of the process gets it.
    """
    wakes, woken = os.pipe()
    os.set_blocking(woken, False)
    before = signal.set_wakeup_fd(woken, warn_on_full_buffer=False)
    try:
        yield wakes
    finally:
        signal.set_wakeup_fd(before)
        os.close(wakes)
        os.close(woken)


def _usual() -> dict[int, Callable[[int, FrameType | None], object] | signal.Handlers]:
    names: dict[str, Callable[[int, FrameType | None], object] | signal.Handlers] = {
        "SIGINT": signal.default_int_handler,
        "SIGTERM": signal.SIG_DFL,
        "SIGHUP": signal.SIG_DFL,
    }
    return {getattr(signal, name): what for name, what in names.items() if hasattr(signal, name)}


_also: list[Callable[[], str]] = [str]


def say_at_end(more: Callable[[], str]) -> None:
    """Have the last words go on with what a function returns then, which is to take no lock."""
    _also[0] = more


def last_words(ending: BaseException) -> str:
    ended = f"stopped by {ending}" if isinstance(ending, Terminated) else "interrupted"
    return ended + _also[0]()


def _say_at_once(text: str) -> None:
    """Write one line to stderr past its buffer, which the main thread may be in the midst of."""
    with suppress(OSError):
        # over a progress bar, if there is one
        errors = errors_descriptor()
        start = "\r\x1b[K" if os.isatty(errors) else ""
        os.write(errors, f"{start}adv2e: {text}\n".encode())


# ---- Removal of unfinished files and folders when a signal ends the program.
#
# A signal can come at any instruction of the main thread, one that just took a lock among them. An
# exception raised there leaves the lock taken, and a thread that waits for it waits for ever. So a
# signal ends the program where it is, as it does Git: the files listed here are removed, which
# takes no lock, and the process exits.


class Unfinished:
    """Files or folders that nobody is to find when the program has ended."""

    def remove_now(self) -> bool:
        """Remove them, also while they are written; tell whether all are gone."""
        raise NotImplementedError


_listed: dict[int, Unfinished] = {}


def add(thing: Unfinished) -> None:
    _listed[id(thing)] = thing


def drop(thing: Unfinished) -> None:
    _listed.pop(id(thing), None)


def remove_all() -> bool:
    """Remove everything listed; tell whether all is gone.

    For signal handlers: takes no locks and raises nothing.
    """
    gone = True
    for thing in list(_listed.values()):
        removed = False
        with suppress(OSError):
            removed = thing.remove_now()
        gone = gone and removed
    return gone

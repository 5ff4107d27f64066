"""Removal of unfinished files and folders when a signal ends the program.

A signal can come at any instruction of the main thread, one that just took a lock among them.  An
exception raised there leaves the lock taken, and a thread that waits for it waits for ever.
So a signal ends the program where it is, as it does Git: the files listed here are removed, which
takes no lock, and the process exits.
"""

from __future__ import annotations

from contextlib import suppress


class Unfinished:
    """Files or folders that nobody is to find when the program has ended."""

    def remove_now(self) -> bool:
        """Remove them, also while they are written; tell whether all are gone."""
        raise NotImplementedError


_listed: dict[int, Unfinished] = {}


def add(thing: Unfinished) -> None:
    """Have `thing` removed if a signal comes."""
    _listed[id(thing)] = thing


def drop(thing: Unfinished) -> None:
    """Forget `thing`, if it is known at all."""
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

"""Errors, and which one to raise when.

``Adv2eError``
    Anything a user can mend that needed a file looked at: a missing input, bad YAML, bad data, an
    output that exists.  The command line shows its text as one line and exits with status 1.
``ConfigError``
    A configuration file or value is wrong; the text begins with the path of the key.
``DataError``
    An input or recording is wrong; the text begins with the file (and line, where there is one).
``UsageError``
    The command line alone is wrong (exit status 2), found below the layer that knows Click.
``MissingExtraError``
    An optional package is needed and absent; the text says which extra to install.

``Adv2eWarning``
    No error: a warning of ours, as against those of libraries, which the command line leaves out.

Every text is one line that names the file, key or line and says what would be right.
Programming errors (wrong types from our own code) stay ordinary Python exceptions.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path


class Adv2eError(Exception):
    """A mistake that the user can mend; shown as one line, exit status 1."""

    exit_status = 1


class Adv2eWarning(UserWarning):
    """Something that the user may look at; the command line shows it as one line."""


def is_for_users(warning: Warning | str, filename: str) -> bool:
    """Tell whether a warning is ours, or about a file of the user's own: not about our code."""
    places = Path(__file__).parent, Path(sys.prefix), Path(sys.base_prefix)
    return isinstance(warning, Adv2eWarning) or not any(
        place in Path(filename).parents for place in places
    )


class ConfigError(Adv2eError):
    """A configuration key, value or file is wrong."""


class DataError(Adv2eError):
    """An input, recording or event file is missing or wrong."""


class OutputError(Adv2eError):
    """An output exists already or cannot be written."""


class UsageError(Adv2eError):
    """The command line alone is wrong."""

    exit_status = 2


def one_line(error: BaseException) -> str:
    """Return the message of an exception in one line."""
    return " ".join(str(error).split())


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return ``did you mean 'x'?``, or ""; x: the nearest name, or what a mapping has for it."""
    import difflib  # noqa: PLC0415 - where a name is wrong

    for near in difflib.get_close_matches(name, list(known), n=1):
        return f"did you mean '{known[near] if isinstance(known, Mapping) else near}'?"
    return ""


def warn(text: str) -> None:
    """Warn of a doubt, in the name of the line outside adv2e that led to it."""
    import inspect  # noqa: PLC0415 - warnings are few

    frame, level = inspect.currentframe(), 0
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] == "adv2e":
        frame, level = frame.f_back, level + 1
    warnings.warn(text, Adv2eWarning, stacklevel=level + 1)


class MissingExtraError(Adv2eError):
    """An optional package is not installed."""

    def __init__(self, what: str, extra: str) -> None:
        super().__init__(f"{what} needs an optional package: pip install 'adv2e[{extra}]'")

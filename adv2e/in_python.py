"""Public functions for Python users: their messages name arguments, not options.

Errors and doubts are worded for the command line, below which most of them arise.  The names in
``adv2e.__all__`` lead to functions that reword them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from functools import wraps
from inspect import isgenerator
from typing import Any, TypeVar

from adv2e.errors import Adv2eError
from adv2e.label import Line

Function = TypeVar("Function", bound=Callable[..., Any])

_OTHER_NAMES = {
    **{"start": "start_s", "stop": "stop_s", "from": "take", "set": "sets", "at": "at_s"},
    **{"extent": "extent_px", "duration": "duration_s", "effect": "effects"},
}
_FLAGS = ("overwrite", "allow_damaged", "rotate180", "with_frames", "causes", "crop_events")
# a command that is quoted stays as it is typed in a shell
_OPTION = re.compile(
    r"'adv2e [^']*'|(?<![\w-])--([a-z][a-z0-9-]*)"
    r"(?: ([A-Z]+\b|zero\b|frames\b(?!\.)|events\b|\d+\b))?"
    r"|(?<![\w-])-o OUT\b"
)


def in_python(text: str, names: Mapping[str, str] | None = None) -> str:
    """Return a message with arguments in the place of options: ``--fps F`` becomes ``fps=F``.

    `names` are the arguments of a function by its options, where both differ: ``window`` is
    ``window_s`` or ``window_us``.
    """
    names = {**_OTHER_NAMES, **(names or {})}

    def argument(found: re.Match[str]) -> str:
        if found[1] is None:
            return "output" if found[0] == "-o OUT" else found[0]
        name = names.get(found[1], found[1].replace("-", "_"))
        value = "True" if name in _FLAGS else found[2]
        if value is None:
            return name
        return f"{name}={value!r}" if value.islower() else f"{name}={value}"

    made = _OPTION.sub(argument, text)
    return text.like(made) if isinstance(text, Line) else made


def reworded(function: Function) -> Function:
    """Return a function whose errors, and problems of what it returns, name arguments."""
    names = getattr(function, "names", None)

    @wraps(function)
    def call(*arguments: Any, **named: Any) -> Any:
        try:
            found = function(*arguments, **named)
        except Adv2eError as error:
            error.args = (in_python(str(error), names),)
            raise
        problems = getattr(found, "problems", None)
        if isinstance(problems, list):
            problems[:] = map(in_python, problems)
        return _generated(found) if isgenerator(found) else found

    made: Any = call
    made.__module__ = "adv2e"  # where pickle finds it
    return made  # type: ignore[no-any-return]


def _generated(found: Iterator[Any]) -> Iterator[Any]:
    """Yield from a generator whose errors name arguments."""
    try:
        yield from found
    except Adv2eError as error:
        error.args = (in_python(str(error)),)
        raise

"""Options that several studies take."""

from __future__ import annotations

import click


class Names(click.ParamType):
    """Names out of a list, with commas between them."""

    name = "names"

    def __init__(self, known: tuple[str, ...]) -> None:
        self.known = known

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, ...]:
        """Return the names, in the order of the list."""
        if isinstance(value, tuple):
            return value
        names = str(value).split(",")
        for name in names:
            if name not in self.known:
                self.fail(f"{name!r}: none of {', '.join(self.known)}", param, ctx)
        return tuple(name for name in self.known if name in names)

"""Options that several studies take."""

from __future__ import annotations

from typing import Any

import click

_STEPS = 8
"""Pictures that are made up between two frames, where they move."""


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


def sampling(interpolation: str) -> dict[str, Any]:
    """Return what is declared of the pictures between frames that are blended, or moved."""
    return {"interpolation": interpolation, "L": 1 if interpolation == "linear" else _STEPS}

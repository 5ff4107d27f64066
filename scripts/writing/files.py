"""Text on standard output, or in a file."""

from __future__ import annotations

from pathlib import Path

import click

from adv2e.errors import OutputError


def write(text: str, out: Path | None) -> None:
    """Write a text to a file, or to standard output where there is none.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    if out is None:
        click.echo(text)
        return
    try:
        out.write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{out}: cannot be written: {error.strerror}") from None

"""Output of scripts: tables, reports with their numbers, figures, errors in one line."""

from __future__ import annotations

import importlib
import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from adv2e.errors import Adv2eError, MissingExtraError

threads_option = click.option("--threads", type=click.IntRange(min=1), help="[default: all cores]")
output_option = click.option(
    "-o", "--output", type=click.Path(dir_okay=False, path_type=Path), metavar="FILE.md",
    help="Write the report here too; numbers and figure, if any, beside it.",
)  # fmt: skip


@contextmanager
def one_line_errors() -> Iterator[None]:
    """Tell errors that a user can mend in one line; also a decorator."""
    try:
        yield
    except Adv2eError as error:
        raise click.ClickException(str(error)) from None
    except OSError as error:
        raise click.ClickException(f"{error.filename}: {error.strerror}") from None


def as_written(text: str | None) -> str:
    """Return a text for help whose lines click leaves as they are."""
    return "\n\n".join(f"\b\n{part}" for part in (text or "").strip().split("\n\n"))


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table in Markdown; all columns but the first are numbers."""
    ruler = ["---", *(["---:"] * (len(head) - 1))]
    lines = [head, ruler, *(list(map(str, row)) for row in rows)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def write_report(text: str, output: Path | None, numbers: object = None) -> None:
    """Print a report; with `output` store it there, and its numbers beside it as JSON."""
    click.echo(text)
    if output is None:
        return
    output.parent.mkdir(parents=True, exist_ok=True)
    output.write_text(text + "\n", encoding="utf-8")
    if numbers is not None:
        raw = json.dumps(numbers, indent=1, allow_nan=False)
        output.with_suffix(".json").write_text(raw + "\n", encoding="utf-8")


def load_pyplot() -> Any:
    """Return Matplotlib's pyplot, drawing to files only."""
    try:
        importlib.import_module("matplotlib").use("Agg")
        return importlib.import_module("matplotlib.pyplot")
    except ImportError as error:
        raise MissingExtraError("a figure", "studies") from error


def save_figure(figure: Any, path: Path) -> None:
    """Write a figure as PNG, and forget it."""
    figure.savefig(path, dpi=130)
    load_pyplot().close(figure)

"""What the commands that train have in common."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click
from writing import one_line_errors, output_option

from experiments.simulators.clip import Simulator
from experiments.simulators.named import named, sets_option, sources_option

SMALL = "ideal,adv2e,v2e,vid2e"
"""Simulators of the small trainings."""
report_option = click.option(
    "-o", "--report", "to", type=click.Path(dir_okay=False, path_type=Path), metavar="FILE.md",
    help="Write the report here too; numbers beside it.",
)  # fmt: skip


def anew(names: str, sets: Sequence[str], v2e_sources: Path | None) -> list[Simulator]:
    """Return the simulators of a list of names, each on one thread."""
    chosen = [name for name in names.split(",") if name]
    return list(named(chosen, sets=sets, v2e_sources=v2e_sources, threads=1))


def simulators_option(default: str) -> Any:
    """Return the options that choose simulators which make events of new clips."""

    def add(command: Callable[..., None]) -> Callable[..., None]:
        names = click.option("--simulators", "names", default=default, show_default=True)
        return names(sets_option(sources_option(command)))

    return add


def counted(name: str, default: int, text: str | None = None, least: int = 1) -> Any:
    """Return an option that is a number of things."""
    return click.option(
        name, type=click.IntRange(min=least), default=default, show_default=True, help=text
    )


def rate_option(default: float, text: str = "Of Adam.") -> Any:
    """Return the option for the rate of learning."""
    return click.option(
        "--rate", type=click.FloatRange(min=0, min_open=True), default=default, show_default=True,
        help=text,
    )  # fmt: skip


def report_command(tell: Callable[[Path, Path | None], None]) -> click.Command:
    """Return the command that tells again, by `tell`, what came of the trainings in a folder."""

    @click.command()
    @click.argument(
        "folder", type=click.Path(exists=True, file_okay=False, path_type=Path), metavar="FOLDER"
    )
    @output_option
    @one_line_errors()
    def report(folder: Path, output: Path | None) -> None:
        """Tell what came of the trainings of small in FOLDER, seed by seed, and what it carries."""
        tell(folder, output)

    return report

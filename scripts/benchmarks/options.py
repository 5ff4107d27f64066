"""Options that the benchmarks share."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial, wraps
from pathlib import Path
from typing import Any

import click
from writing import one_line_errors, threads_option

from benchmarks.clips import default_folder
from benchmarks.processes import Log
from benchmarks.settings import Plan


def of_a_plan(rounds: int, quick_rounds: int) -> Callable[[Callable[..., None]], Any]:
    """Return a decorator that adds the options of a :class:`Plan`.

    The command is given `plan` and a `log`; what failed is told at its end.
    """

    def decorate(command: Callable[..., None]) -> Any:
        @click.option("--quick", is_flag=True, help="Short clips, fewer points and rounds; rough.")
        @click.option(
            "--rounds", type=click.IntRange(min=1), metavar="N",
            help=f"[default: {rounds}, with --quick {quick_rounds}]",
        )  # fmt: skip
        @threads_option
        @click.option(
            "--clips", "folder", type=click.Path(file_okay=False, path_type=Path),
            help="Folder that keeps the clips.  [default: adv2e-benchmarks in the user's cache]",
        )  # fmt: skip
        @wraps(command)
        def made(
            quick: bool, rounds: int | None, threads: int | None, folder: Path | None, **rest: Any
        ) -> None:
            log = Log(partial(click.echo, err=True))
            count = rounds or (quick_rounds if quick else usual_rounds)
            plan = Plan(folder or default_folder(), quick, threads, count)
            with one_line_errors():
                command(plan=plan, log=log, **rest)
            if log.failures:
                raise click.ClickException("; ".join(log.failures))

        return made

    usual_rounds = rounds
    return decorate

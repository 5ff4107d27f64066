"""Simulators by name, and the options that choose them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from pathlib import Path
from typing import Any

import click
from writing import one_line_errors, table, threads_option

from adv2e.config import load_config
from adv2e.errors import ConfigError
from experiments.simulators.by_file import FIRST_FRAME, ByFile
from experiments.simulators.clip import Simulator
from experiments.simulators.eventcv import QUIET, EventCV
from experiments.simulators.pixel import OF_A_TOOL, OWN, Pixel
from experiments.simulators.v2e import V2e
from experiments.simulators.voltmeter import Voltmeter

NAMES = "ideal,adv2e,paper,v2e,vid2e,dvs-voltmeter,eventcv,eventcv-quiet"
_OF_TOOLS = ("v2e", "vid2e")
"""Configurations with another tool's parameters."""


def named(
    names: Sequence[str],
    files: Sequence[ByFile] = (),
    *,
    sets: Sequence[str] = (),
    v2e_sources: Path | None = None,
    threads: int | None = None,
) -> list[Simulator]:
    """Return simulators in this order, those by file last.

    Parameters
    ----------
    names : sequence of str
        ``dvs-voltmeter``, ``eventcv``, ``eventcv-quiet``, or what :func:`adv2e.load_config` takes.
    files : sequence of ByFile
    sets : sequence of str
        ``KEY=VALUE`` for all configurations of adv2e.
    v2e_sources : Path, optional
        With it ``v2e`` is the tool itself.
    threads : int, optional

    Raises
    ------
    ConfigError
        A name is unknown, or stands twice.
    MissingExtraError
        A tool is not installed.
    """
    asked = [Path(name).stem for name in names] + [one.name for one in files]
    for name in asked:
        if asked.count(name) > 1:
            raise ConfigError(f"{name}: is asked for twice; give each simulator a name of its own")

    def one(name: str) -> Simulator:
        if name == "v2e" and v2e_sources is not None:
            return V2e(v2e_sources)
        if name in _OTHERS:
            return _OTHERS[name]()
        nature = OF_A_TOOL if name in _OF_TOOLS else OWN
        return Pixel(Path(name).stem, nature, load_config([name], sets), threads)

    return [*map(one, names), *files]


_OTHERS: dict[str, Callable[[], Simulator]] = {
    "dvs-voltmeter": Voltmeter,
    "eventcv": EventCV,
    "eventcv-quiet": lambda: EventCV("eventcv-quiet", dict(QUIET)),
}


def natures(simulators: Sequence[Simulator]) -> str:
    """Return what each is, as a table."""
    rows = [[one.name, one.nature] for one in simulators]
    return table(["simulator", "what it is"], rows).replace("---:", "---")


class EventsOf(click.ParamType):
    """``NAME=FILE``, ``NAME=FILE@SECONDS`` or ``NAME=FILE@start``."""

    name = "NAME=FILE"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> ByFile:
        """Return the simulator."""
        if isinstance(value, ByFile):
            return value
        name, _, path = str(value).partition("=")
        if not name or not path:
            self.fail(f"{value!r}: must be NAME=FILE, such as v2ce=events.npz", param, ctx)
        file, at, clock = path.rpartition("@")
        if not at:
            return ByFile(name, Path(path))
        if clock == FIRST_FRAME:
            return ByFile(name, Path(file), None)
        try:
            return ByFile(name, Path(file), float(clock))
        except ValueError:  # a name with @ in it
            return ByFile(name, Path(path))


sources_option = click.option(
    "--v2e-sources", type=click.Path(file_okay=False, path_type=Path), metavar="FOLDER",
    help="A clone of github.com/SensorsINI/v2e: v2e is the tool itself then. Needs PyTorch.",
)  # fmt: skip
sets_option = click.option(
    "--set", "sets", multiple=True, metavar="KEY=VALUE",
    help="For all configurations of adv2e. Repeatable.",
)  # fmt: skip


def simulator_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add options that choose simulators; the command is given them as `simulators`."""

    @click.option(
        "--simulators", "names", default=NAMES, show_default=True,
        help="Also other shipped names and YAML files.",
    )  # fmt: skip
    @click.option(
        "--events", "files", type=EventsOf(), multiple=True, metavar="NAME=FILE",
        help="Events that another simulator wrote, on the recording's clock; with @start after"
        " FILE they begin with the first frame, @SECONDS adds so many. Repeatable.",
    )  # fmt: skip
    @sources_option
    @sets_option
    @threads_option
    @wraps(command)
    def made(
        names: str, files: tuple[ByFile, ...], v2e_sources: Path | None,
        sets: tuple[str, ...], threads: int | None, **rest: Any,
    ) -> None:  # fmt: skip
        with one_line_errors():
            simulators = named(
                [name for name in names.split(",") if name], files,
                sets=sets, v2e_sources=v2e_sources, threads=threads,
            )  # fmt: skip
            command(simulators=simulators, **rest)

    return made

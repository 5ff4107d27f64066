"""Options that commands share: one decorator each, and what they check.

Each decorator hands the command ready values: ``config`` (a Config), ``output``, ``overwrite``,
``threads``, ``progress`` (a bool) and ``log`` (a :class:`Log`).
"""

from __future__ import annotations

import functools
import math
import re
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from adv2e.cli import completion
from adv2e.cli.exit_status import VERBOSITY
from adv2e.cli.progress import compilation_told
from adv2e.files.names import shown
from adv2e.geometry import parse_rectangle, parse_size

if TYPE_CHECKING:
    from adv2e.config import Config
    from adv2e.effects.hooks import Hooks
    from adv2e.geometry import Size

Body = TypeVar("Body", bound=Callable[..., Any])


class WholeNumber(click.IntRange):
    """A whole number in a range, called so in errors."""

    name = "whole number"


# adv2e.kernel.rng.LARGEST_SEED, without the time that importing it takes
SEED = WholeNumber(0, (1 << 64) - 1)


@dataclass(frozen=True)
class Log:
    """Tells the user something on stderr, if it was asked for."""

    level: int = 0
    """-1: quiet, 0: as usual, 1: -v, 2: -vv."""

    def __call__(self, text: str, level: int = 0) -> None:
        """Write `text`; `level` 1 only with -v, 2 only with -vv."""
        if self.level >= level:
            with suppress(OSError):  # what is said is not what was asked for
                click.echo(shown(text), err=True)


class FiniteNumber(click.FloatRange):
    """A number that is neither infinite nor NaN, in a range."""

    name = "number"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return `value` as a float; raise BadParameter with the offending text."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number", param, ctx)
        return number


class Parsed(click.ParamType):  # type: ignore[type-arg] # not generic in all versions
    """Parameter type by a function that parses text; its ValueError names the right form."""

    def __init__(self, name: str, parse: Callable[[str], Any]) -> None:
        self.name, self._parse = name, parse

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the parsed `value`; raise BadParameter."""
        try:
            return self._parse(value)
        except ValueError as error:
            self.fail(str(error), param, ctx)


_UNITS = {"s": 1e6, "ms": 1e3, "us": 1.0}


def _microseconds(text: str) -> int:
    """Return the time that a text with its unit says [us]; ValueError if there is none."""
    found = re.fullmatch(r"(\d+(?:\.\d*)?|\.\d+)\s*(s|ms|us)", text)
    length = round(float(found[1]) * _UNITS[found[2]]) if found else 0
    if length < 1:
        raise ValueError(f"must be a time with its unit, such as 33ms, got {text!r}")
    return length


TIME = Parsed("time", _microseconds)
# adv2e.sources.wanted.PATTERNS, without the time that importing it takes
BAYER = ("RGGB", "BGGR", "GRBG", "GBRG")
# adv2e.sources.pipes.raw.PIXEL_FORMATS, likewise
PIXEL_FORMATS = (
    *("gray", "gray10le", "gray12le", "gray14le", "gray16le", "rgb24", "bgr24", "rgb48le"),
)
SIZE = Parsed("size", parse_size)
RECTANGLE = Parsed("rectangle", parse_rectangle)


def crop_option(text: str) -> Callable[[Body], Body]:
    """Return a decorator that adds --crop, with the help `text`; passes ``crop``, or None."""
    return click.option("--crop", type=RECTANGLE, metavar="X,Y,W,H", help=text)


def rate(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
    """Return a rate as it was written; raise BadParameter if it is none."""
    from adv2e.sources.times.rates import parse_rate

    try:
        if value is not None:
            parse_rate(value)
    except ValueError as error:
        raise click.BadParameter(str(error), ctx, param) from error
    return value


def effect_option(body: Body) -> Body:
    """Add --effect; the command gets ``effect_files``, a tuple, for :func:`own_effects`."""
    return click.option(
        "--effect",
        "effect_files",
        metavar="FILE.py",
        shell_complete=completion.files,
        multiple=True,
        help="Add effects of your own. Their parameters are user.NAME in the configuration."
        " Repeatable.",
    )(body)


def own_effects(files: tuple[str, ...]) -> list[type[Hooks]]:
    """Return the effects that files hold."""
    if not files:
        return []
    from adv2e.config.user_effects import load_effects

    return [effect for name in files for effect in load_effects(name)]


def files_given() -> list[str | Path]:
    """Return the configurations and effects that the command line names."""
    from adv2e.config.files import find

    given = click.get_current_context().params
    return [*map(find, given["config_files"]), *given.get("effect_files", ())]


def files_option(text: str) -> Callable[[Body], Body]:
    """Return a decorator that adds -c, with the help `text`; passes ``config_files``, a tuple."""
    return click.option(
        "-c",
        "--config",
        "config_files",
        metavar="FILE",
        multiple=True,
        shell_complete=completion.configurations,
        help=text,
    )


def sets_option(text: str) -> Callable[[Body], Body]:
    """Return a decorator that adds --set, with the help `text`; passes ``sets``, a tuple."""
    return click.option(
        "--set",
        "sets",
        metavar="KEY=VALUE",
        multiple=True,
        shell_complete=completion.keys,
        help=text,
    )


def config_parts(body: Body) -> Body:
    """Add -c, --set, --seed and --effect; the command gets config_files, sets, seed, effect_files.

    See :func:`config_options`.
    """
    for decorator in (
        effect_option,
        click.option(
            "--seed",
            type=SEED,
            metavar="N",
            help="Seed of all random numbers. The same seed gives the same events.",
        ),
        sets_option(
            "Set one key, such as pixel.low_pass.cutoff_hz=100. null switches an effect off:"
            " pixel.leak=null. Repeatable."
        ),
        files_option(
            "Configuration: a YAML file or a shipped name, such as davis346 (see 'adv2e config"
            " --help'). Repeatable: a later one wins, key by key."
        ),
    ):
        body = decorator(body)
    return body


def check_sets(sets: tuple[str, ...], seed: int | None, size: Size | None) -> None:
    """Raise UsageError if --set says what --seed or --size says, too."""
    from adv2e.config import written_keys

    keys = {"--seed": ("seed",), "--size": ("sensor.width", "sensor.height")}
    given = {"--seed": seed, "--size": size}
    for key in written_keys((), sets):
        for option in (name for name in given if given[name] is not None and key in keys[name]):
            raise click.UsageError(f"--set {key} and {option} both say it: keep one")


def config_options(body: Body) -> Body:
    """Add those of :func:`config_parts`; the command gets ``config``, a function.

    It returns the Config, for a sensor of a size if it is given one.  A command that has other
    things to begin with calls it after those: configurations know of all effects, and importing
    these takes its time.
    """

    @config_parts
    @functools.wraps(body)
    def with_config(
        *args: Any,
        config_files: tuple[str, ...],
        sets: tuple[str, ...],
        seed: int | None,
        effect_files: tuple[str, ...],
        **kw: Any,
    ) -> Any:
        def config(size: Size | None = None) -> Config:
            from adv2e.config import load_config

            check_sets(sets, seed, size)
            return load_config(config_files, sets, seed, own_effects(effect_files), size=size)

        return body(*args, config=config, **kw)

    return with_config  # type: ignore[return-value]


SECONDS = FiniteNumber(min=0)
POSITIVE = FiniteNumber(min=0, min_open=True)


def check_part(start: float | None, stop: float | None) -> None:
    """Raise UsageError if --stop is not after --start."""
    if start is not None and stop is not None and stop <= start:
        raise click.UsageError(f"--stop {stop:g} must be after --start {start:g}")


def source_options(body: Body) -> Body:
    """Add what says how to read an input with frames.

    The command gets ``given``, these by the names that :func:`adv2e.sources.open_source` has for
    them: fps, as it was written, timestamps, time_unit, allow_damaged, bayer, pixel_format,
    rotate180 and track.
    """

    @click.option(
        "--fps",
        metavar="F",
        callback=rate,
        help="Take the frames at F a second, such as 240 or 30000/1001, whatever the input says.",
    )
    @click.option(
        "--timestamps",
        type=click.Path(path_type=Path),
        metavar="FILE",
        help="Read the times of the frames from FILE, one a line.",
    )
    @time_unit_option
    @click.option(
        "--allow-damaged",
        is_flag=True,
        help="Take what can be decoded of a damaged video, and say what is missing.",
    )
    @click.option(
        "--bayer",
        type=click.Choice(BAYER, case_sensitive=False),
        help="Frames are raw mosaics, with these colours in the first two rows: make them colour.",
    )
    @click.option(
        "--pixel-format",
        type=click.Choice(PIXEL_FORMATS),
        help="Raw video comes through standard input (INPUT is -), in frames of the --size given.",
    )
    @rotate_option()
    @track_option()
    @functools.wraps(body)
    def with_given(*args: Any, **kw: Any) -> Any:
        names = (
            "fps",
            "timestamps",
            "time_unit",
            "allow_damaged",
            "bayer",
            "pixel_format",
            "rotate180",
            "track",
        )
        return body(*args, given={name: kw.pop(name) for name in names}, **kw)

    return with_given  # type: ignore[return-value]


# adv2e.formats.clock.SET_BACK, without the time that importing it takes
SET_BACK = ("continue", "sort")


def events_options(body: Body) -> Body:
    """Add what says which events are taken; the command gets ``reading``, a dict.

    It holds these by the names that :func:`adv2e.read_events` has for them.
    """

    @click.option(
        "--set-back",
        type=click.Choice(SET_BACK),
        help="Where times of events go back by more than 0.1 s. continue: from the time before, as"
        " where a clock was reset. sort: by time.  [default: an error]",
    )
    @click.option(
        "--crop-events",
        is_flag=True,
        help="Leave out events outside the sensor, however many.  [default: more than 1 % are an"
        " error]",
    )
    @functools.wraps(body)
    def with_reading(*args: Any, set_back: str | None, crop_events: bool, **kw: Any) -> Any:
        return body(*args, reading={"set_back": set_back, "crop_events": crop_events}, **kw)

    return with_reading  # type: ignore[return-value]


def rotate_option(what: str = "") -> Callable[[Body], Body]:
    """Return a decorator that adds --rotate180 (turns `what`); passes ``rotate180``, a bool."""
    return click.option(
        "--rotate180",
        is_flag=True,
        help=f"Turn frames and events{what} by 180 degrees, first of all: the camera was mounted"
        " upside down, as for DDD17 and DDD20.",
    )


def track_option(what: str = "INPUT") -> Callable[[Body], Body]:
    """Return a decorator that adds --track (one of the tracks in `what`); passes ``track``."""
    return click.option(
        "--track",
        "--stream",
        "--topic",
        "track",
        metavar="N|NAME",
        callback=_not_empty,
        help=f"Which one to read of several video tracks, streams or topics in {what}: its number"
        " from 0, or its name.  [default: the usual one of them, and a line that tells all]",
    )


def time_unit_option(body: Body) -> Body:
    """Add --time-unit; the command gets ``time_unit``, a name or None."""
    return click.option(
        "--time-unit",
        type=click.Choice(["s", "ms", "us", "ns"]),
        help="Unit of the times in lists and event files.  [default: what the file says; else a"
        " guess, and a line that tells it]",
    )(body)


def output_options(body: Body) -> Body:
    """Add -o and --overwrite; the command gets ``output`` (or None) and ``overwrite``."""
    body = click.option("--overwrite", is_flag=True, help="Replace an output that exists.")(body)
    return click.option(
        "-o",
        "--output",
        metavar="OUT",
        shell_complete=completion.files,
        callback=_not_empty,
        help="File or folder to write.",
    )(body)


def _not_empty(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
    """Refuse an empty name: a variable of a shell that is not set would mean the default."""
    if value == "":
        raise click.BadParameter("is empty: give a name, or leave the option out", ctx, param)
    return value


def threads_option(body: Body) -> Body:
    """Add --threads; the command gets ``threads``, None standing for every core it may use."""
    return click.option(
        "--threads",
        type=WholeNumber(min=1),
        metavar="N",
        help="Compute with N threads. The result is the same for any N.  [default: all cores that"
        " this process may use]",
    )(body)


def reporting_options(body: Body) -> Body:
    """Add -q, -v and --progress; the command gets ``log`` and ``progress``, off by default with -q.

    While it runs, it is told that functions are compiled.
    """

    def remember(ctx: click.Context, param: click.Parameter, count: int) -> int:
        ctx.meta[VERBOSITY] = count
        return count

    @click.option(
        "--progress/--no-progress",
        default=None,
        help="Show a progress bar.  [default: on a terminal]",
    )
    @click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
    @click.option(
        "-v",
        "--verbose",
        count=True,
        is_eager=True,
        callback=remember,
        help="Print more. -vv also prints tracebacks.",
    )
    @functools.wraps(body)
    def reporting(*args: Any, progress: bool | None, quiet: bool, verbose: int, **kw: Any) -> Any:
        if quiet and verbose:
            raise click.UsageError("-q and -v say the opposite: keep one")
        log = Log(-1 if quiet else verbose)
        if progress is None:
            progress = not quiet and sys.stderr is not None and sys.stderr.isatty()
        with compilation_told(log, progress):
            return body(*args, log=log, progress=progress, **kw)

    return reporting  # type: ignore[return-value]


def run_options(body: Body) -> Body:
    """Add those of any work: the command gets output, overwrite, threads, progress and log."""
    for decorator in (reporting_options, threads_option, output_options):
        body = decorator(body)
    return body

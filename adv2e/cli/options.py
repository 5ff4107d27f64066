"""Options that commands share: one decorator each, and what they check.

Each decorator hands the command ready values: ``config`` (a Config), ``output``, ``overwrite``,
``threads``, ``progress`` (a bool) and ``log`` (a :class:`Log`).
"""

from __future__ import annotations

import functools
import math
import re
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from adv2e.cli import completion
from adv2e.cli.exit_status import VERBOSITY
from adv2e.cli.progress import compilation_told
from adv2e.files.regular import shown
from adv2e.geometry import parse_rectangle, parse_size
from adv2e.options import BAYER, MOST_SHARE, Option, OutputOptions, Run, declared

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


def rate(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
    """Return a rate as it was written; raise BadParameter if it is none."""
    from adv2e.sources.times.rates import parse_rate

    try:
        if value is not None:
            parse_rate(value)
    except ValueError as error:
        raise click.BadParameter(str(error), ctx, param) from error
    return value


@dataclass(frozen=True)
class Layers:
    """What -c, --set, --seed and --effect say of a configuration.

    Configurations know of all effects, and importing these takes its time: what is to be said
    before that comes before the methods.
    """

    config_files: tuple[str, ...]
    sets: tuple[str, ...]
    seed: int | None
    effect_files: tuple[str, ...]

    @property
    def first_given(self) -> str:
        """The first of these options that was given, or ""."""
        flags = {"--config": self.config_files, "--set": self.sets, "--seed": self.seed}
        flags["--effect"] = self.effect_files
        return next((flag for flag, value in flags.items() if value not in ((), None)), "")

    def files(self) -> list[str | Path]:
        """Return the configurations and effects that the command line names."""
        from adv2e.config.files import find

        return [*map(find, self.config_files), *self.effect_files]

    def effects(self) -> list[type[Hooks]]:
        """Return the effects that the files of --effect hold."""
        if not self.effect_files:
            return []
        from adv2e.config.user_effects import load_effects

        return [effect for name in self.effect_files for effect in load_effects(name)]

    def check(self, size: Size | None = None) -> None:
        """Raise UsageError if --set says what --seed or --size says, too."""
        from adv2e.config import written_keys

        keys = {"--seed": ("seed",), "--size": ("sensor.width", "sensor.height")}
        given = {"--seed": self.seed, "--size": size}
        for key in written_keys((), self.sets):
            for option in (name for name in given if given[name] is not None and key in keys[name]):
                raise click.UsageError(f"--set {key} and {option} both say it: keep one")

    def config(self, size: Size | None = None) -> Config:
        """Return the configuration, for a sensor of a size if one is given."""
        from adv2e.config import load_config

        self.check(size)
        return load_config(self.config_files, self.sets, self.seed, self.effects(), size=size)


def config_options(
    files: str = "Configuration: a YAML file or a shipped name, such as davis346 (see 'adv2e config"
    " --help'). Repeatable: a later one wins, key by key.",
    sets: str = "Set one key, such as pixel.low_pass.cutoff_hz=100. null switches an effect off:"
    " pixel.leak=null. Repeatable.",
    seed: str = "Seed of all random numbers. The same seed gives the same events.",
    *,
    usual_seed: int | None = None,
    takes_effects: bool = True,
) -> Callable[[Body], Body]:
    """Return a decorator that adds -c, --set, --seed, with such help, and --effect.

    The command gets ``layers``, :class:`Layers`.
    """
    added = [
        click.option(
            "-c",
            "--config",
            "config_files",
            metavar="FILE",
            multiple=True,
            shell_complete=completion.configurations,
            help=files,
        ),
        click.option(
            "--set",
            "sets",
            metavar="KEY=VALUE",
            multiple=True,
            shell_complete=completion.keys,
            help=sets,
        ),
        click.option("--seed", type=SEED, default=usual_seed, metavar="N", help=seed),
        click.option(
            "--effect",
            "effect_files",
            metavar="FILE.py",
            shell_complete=completion.files,
            multiple=True,
            help="Add effects of your own. Their parameters are user.NAME in the configuration."
            " Repeatable.",
        ),
    ]

    def decorate(body: Body) -> Body:
        @functools.wraps(body)
        def with_layers(
            *args: Any,
            config_files: tuple[str, ...],
            sets: tuple[str, ...],
            seed: int | None,
            effect_files: tuple[str, ...] = (),
            **kw: Any,
        ) -> Any:
            return body(*args, layers=Layers(config_files, sets, seed, effect_files), **kw)

        made: Any = with_layers
        for option in reversed(added if takes_effects else added[:-1]):
            made = option(made)
        return made  # type: ignore[no-any-return]

    return decorate


POSITIVE = FiniteNumber(min=0, min_open=True)

_TYPES: dict[str, Any] = {
    "path": click.Path(path_type=Path),
    "size": Parsed("size", parse_size),
    "rectangle": Parsed("rectangle", parse_rectangle),
    "seconds": FiniteNumber(min=0),
    "share": FiniteNumber(0, MOST_SHARE),
    "time": Parsed("time", _microseconds),
}
"""Types of Click by kind of option; the others are text."""


def declared_options(*groups: Any, help: Mapping[str, str] | None = None) -> Callable[[Body], Body]:
    """Return a decorator that adds the options of groups (:mod:`adv2e.options`).

    The command gets them as ``given``, a dict by their names in Python.  Those of
    :func:`reporting_options` and :func:`output_options` are left out; `help` says more of some.
    """
    apart = ("progress", "overwrite")
    wanted = {name: one for name, one in declared(*groups).items() if name not in apart}

    def decorate(body: Body) -> Body:
        @functools.wraps(body)
        def with_given(*args: Any, **kw: Any) -> Any:
            return body(*args, given={name: kw.pop(name) for name in wanted}, **kw)

        made: Any = with_given
        for name, option in reversed(wanted.items()):
            made = _click_option(name, option, (help or {}).get(name, ""))(made)
        return made  # type: ignore[no-any-return]

    return decorate


def _click_option(name: str, option: Option, help: str = "") -> Callable[[Body], Body]:
    about: dict[str, Any] = {"default": option.default, "metavar": option.shown}
    text = f"{option.help} {help}".rstrip()
    if option.default == ():
        about["multiple"], text = True, f"{text} Repeatable."
    elif option.default not in (None, False):
        about["show_default"] = True
    if option.default is False:
        about = {"is_flag": True}
    elif option.choices:
        about["type"] = click.Choice(option.choices, case_sensitive=option.choices != BAYER)
    elif option.kind == "count":
        about["type"] = WholeNumber(1, option.most)
    elif option.kind == "positive":
        about["type"] = FiniteNumber(0, option.most, min_open=True)
    elif option.kind in _TYPES:
        about["type"] = _TYPES[option.kind]
    elif option.kind == "rate":
        about["callback"] = rate
    elif option.default is None:
        about["callback"] = _not_empty
    if option.completes:
        about["shell_complete"] = getattr(completion, option.completes)
    if option.usual:
        text += f"  [default: {option.usual}]"
    return click.option(*option.flags or (option.flag_of(name),), name, help=text, **about)


def output_options(body: Body) -> Body:
    """Add -o and --overwrite; the command gets ``output`` (or None) and ``overwrite``."""
    body = _click_option("overwrite", declared(OutputOptions)["overwrite"])(body)
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
    return _click_option("threads", declared(Run)["threads"])(body)


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

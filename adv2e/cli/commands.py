"""A command that says what to do instead where it is given one argument too many."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

import click
from click.core import ParameterSource

from adv2e.errors import UsageError

_GROUPS = {
    "Input": (
        *("fps", "timestamps", "time_unit", "track", "start", "stop", "start_s", "stop_s", "crop"),
        *("rotate180", "bayer", "pixel_format", "allow_damaged", "take"),
        *("set_back", "crop_events"),
        "light",
    ),
    "Sensor and pixel": (
        *("config_files", "sets", "seed", "effect_files", "size", "motion", "extent_px"),
        *("duration_s", "fit_thresholds", "without"),
    ),
    "Output": (
        *("output", "overwrite", "format", "layout", "t0", "with_frames", "preview", "causes"),
        *("export", "no_events", "window_us", "bins"),
        "as_json",
    ),
    "Running": ("threads", "recipe", "jobs", "shard", "scheduler", "dry_run", "progress", "quiet"),
}
"""Options by what they are about, where a command has many; the others stand before or after."""

_LAST, _MANY = ("verbose", "help"), 14


class Command(click.Command):
    """A command whose extra arguments become a hint: an output without -o, or further inputs.

    Its help shows many options in groups.
    """

    allow_extra_args = True

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, those of a group together."""
        records = {
            "help" if "--help" in item.opts else item.name: record
            for item in self.get_params(ctx)
            if isinstance(item, click.Option)
            if (record := item.get_help_record(ctx)) is not None
        }
        if len(records) < _MANY:
            super().format_options(ctx, formatter)
            return
        # of `compare`; that of `render` is a flag of its output
        takes_frames = any(item.name == "frames" and item.metavar for item in self.params)
        groups = {**_GROUPS, "Input": (*_GROUPS["Input"], *["frames"] * takes_frames)}
        grouped = {name for names in groups.values() for name in names} | {*_LAST}
        others = tuple(str(name) for name in records if name not in grouped)
        groups = {"Options": others, **groups}
        groups["Running"] = (*_GROUPS["Running"], *_LAST)
        for title, names in groups.items():
            if rows := [records[name] for name in names if name in records]:
                with formatter.section(title):
                    formatter.write_dl(rows)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments; raise UsageError, with what to type instead, if some are left."""
        given = list(args)
        extra = super().parse_args(ctx, args)
        if not ctx.params.get("film"):  # with it, a diagnosis takes several recordings
            extra = [*extra, *ctx.params.get("recordings", ())[1:]]
        if extra and not ctx.resilient_parsing:
            raise UsageError(_hint(ctx, given, extra))
        return extra


def _hint(ctx: click.Context, given: Sequence[str], extra: Sequence[str]) -> str:
    """Return a hint for the arguments `given`, of which `extra` are too many: a line to type."""
    arguments = [item for item in ctx.command.params if isinstance(item, click.Argument)]
    typed, _, _ = ctx.command.make_parser(ctx).parse_args(list(given))
    values = [typed[item.name] for item in arguments]
    # of an argument that may be repeated, the first
    taken = [value[0] if isinstance(value, tuple) else value for value in values if value]
    has_output = ctx.get_parameter_source("output") is ParameterSource.COMMANDLINE
    is_output = len(extra) == 1 and "output" in ctx.params and not has_output
    if is_output and not (taken and _is_another(extra[0], taken[0])):
        at = _last(given, extra[0])
        whole = [*ctx.command_path.split(), *given[:at], "-o", *given[at:]]
        return f"put -o before the output: {shlex.join(whole)}"
    if len(arguments) == 1:
        options = [] if has_output else _without(given, [*taken, *extra])
        if ctx.info_name == "render" and not has_output:  # it makes nothing without
            options.append('-o "$f.mp4"')
        body = " ".join([ctx.command_path, '"$f"', *options])
        loop = f"for f in {_pattern([*taken, *extra])}; do {body}; done"
        return f"{ctx.info_name} takes one {_name(arguments[0])} at a time; for several: {loop}"
    return f"unexpected argument '{extra[0]}': {' '.join(ctx.command.get_usage(ctx).split()[1:])}"


def _name(argument: click.Argument) -> str:
    return str(argument.metavar).removesuffix("...")


def _is_another(path: str, first: str) -> bool:
    """Tell whether `path` is one more input like the first, rather than an output."""
    from adv2e.sources import VIDEO_SUFFIXES

    kinds = Path(path).suffix.lower(), Path(first).suffix.lower()
    alike = kinds[0] == kinds[1] and Path(path).exists()
    return alike or all(kind in VIDEO_SUFFIXES for kind in kinds)


def _pattern(paths: Sequence[str]) -> str:
    """Return a shell pattern for paths with one suffix in one folder; else the quoted paths."""
    kinds = {(str(Path(path).parent), Path(path).suffix) for path in paths}
    folder, suffix = kinds.pop()
    if kinds or not suffix:
        return shlex.join(paths)
    return f"*{suffix}" if folder == "." else f"{shlex.quote(folder)}/*{suffix}"


def _without(given: Sequence[str], left_out: Sequence[str]) -> list[str]:
    rest = list(given)
    for text in left_out:
        del rest[_last(rest, text)]
    return [shlex.quote(text) for text in rest]


def _last(given: Sequence[str], text: str) -> int:
    return len(given) - 1 - given[::-1].index(text)

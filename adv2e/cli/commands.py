"""A command that says what it takes where it is given one argument too many."""

from __future__ import annotations

import click

from adv2e.errors import UsageError

_GROUPS = {
    "Input": (
        *("fps", "timestamps", "time_unit", "track", "start", "stop", "start_s", "stop_s", "crop"),
        *("rotate180", "bayer", "pixel_format", "network", "allow_damaged", "take"),
        *("set_back", "crop_events", "side", "strict"),
        "light",
    ),
    "Sensor and pixel": (
        *("config_files", "sets", "seed", "effect_files", "size", "motion", "extent_px"),
        *("duration_s", "fit_thresholds", "without"),
    ),
    "Output": (
        *("output", "overwrite", "format", "layout", "t0", "with_frames", "preview", "causes"),
        "blurred_frames",
        *("export", "no_events", "window_us", "bins"),
        "as_json",
    ),
    "Running": ("threads", "recipe", "jobs", "shard", "scheduler", "dry_run", "progress", "quiet"),
}
"""Options by what they are about, where a command has many; the others stand before or after."""

_LAST, _MANY = ("verbose", "help"), 14


class Command(click.Command):
    """A command that says what it takes, and shows many options in groups."""

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
        """Parse the arguments; raise UsageError, with what the command takes, if some are left."""
        extra = super().parse_args(ctx, args)
        if extra and not ctx.resilient_parsing:
            _, *usage = ctx.command.get_usage(ctx).split()
            hint = "; an output is put behind -o" if "output" in ctx.params else ""
            if ctx.info_name == "convert":
                hint += ", and 'adv2e batch' takes a folder of inputs"
            raise UsageError(f"unexpected argument '{extra[0]}': {' '.join(usage)}{hint}")
        return extra

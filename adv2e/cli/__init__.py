"""The command line: ``adv2e COMMAND``.  One command a module, imported when it is run."""

from __future__ import annotations

import difflib
import importlib
import os
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from adv2e import __version__
from adv2e.cli.exit_status import flush_stdout, print_any_character, reporting, warnings_for_people
from adv2e.process.machine import return_large_blocks
from adv2e.process.signals import stopping_on_signals

COMMANDS = {
    "convert": "Turn a video or frames into events.",
    "batch": "Convert all videos or sequences below a folder.",
    "info": "Show what a video, a recording or an event file holds.",
    "render": "Make pictures and films of events.",
    "view": "Make a page on which to play events in a browser.",
    "compare": "Measure how much two event streams differ.",
    "export": "Make training sets and representations of events.",
    "diagnose": "Find what a recording holds that its simulation lacks.",
    "sensor": "Measure what a configured sensor does, on one page.",
    "characterise": "Name the effect that tables of latency or noise ask for.",
    "protocol": "Print what to record with an LED to know a camera.",
    "config": "Show or check a configuration, and explain its keys.",
    "effects": "List the effects, or explain one with its equation.",
    "demo": "Make a sample clip, convert it and render the events.",
}
"""Name of each command, which is also its module's, and what it does in one line."""


class Program(click.Group):
    """A group that imports a command only when it is run, and reports errors in one line."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the commands."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return the command `cmd_name`, from the module of that name."""
        if cmd_name not in COMMANDS:
            return None
        # BLAS, which has little to do here, would start threads that wait busily, beside ours
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        module = importlib.import_module(f"adv2e.cli.{cmd_name}")
        found = (item for item in vars(module).values() if isinstance(item, click.Command))
        return next(command for command in found if command.name == cmd_name)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command that `args` begin with; a mistyped one is told the nearest."""
        name = args[0]
        if name == "help":  # as of git and others
            args = [*args[1:], "--help"] if len(args) > 1 else ["--help"]
            if len(args) == 1:
                click.echo(ctx.get_help())
                ctx.exit()
            name = args[0]
        if name not in COMMANDS and not name.startswith("-") and not ctx.resilient_parsing:
            near = difflib.get_close_matches(name, COMMANDS, n=1)
            meant = near[0] if near else f"adv2e convert {name}" if Path(name).exists() else ""
            hint = f", did you mean '{meant}'?" if meant else ""
            raise click.UsageError(f"no such command '{name}'{hint}", ctx)
        return super().resolve_command(ctx, args)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Offer the commands, without importing them, and the options."""
        found = [
            CompletionItem(name, help=line)
            for name, line in COMMANDS.items()
            if name.startswith(incomplete)
        ]
        return [*found, *click.Command.shell_complete(self, ctx, incomplete)]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the table of commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Show the help, as an error, where there are no arguments."""
        if not args and not ctx.resilient_parsing:
            click.echo(ctx.get_help(), err=True)
            ctx.exit(2)
        return super().parse_args(ctx, args)

    def make_context(self, *args: Any, **kwargs: Any) -> click.Context:
        """Parse the arguments before the command."""
        with reporting():
            return super().make_context(*args, **kwargs)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command."""
        with reporting(ctx):
            return super().invoke(ctx)

    def main(self, *args: Any, **kwargs: Any) -> Any:
        """Run the program; always ends with SystemExit."""
        if len(args) < 2:
            kwargs["prog_name"] = kwargs.get("prog_name") or "adv2e"
        print_any_character()
        return_large_blocks()
        with stopping_on_signals(), warnings_for_people():
            try:
                return super().main(*args, **kwargs)
            except SystemExit as end:
                flush_stdout(quiet=bool(end.code))
                raise


@click.group(
    cls=Program, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
)
@click.version_option(__version__, "-V", "--version", message="%(prog)s %(version)s")
def main() -> None:
    """Turn a video or a sequence of images into the events of an event camera (DVS).

    \b
    First steps:
      adv2e demo                                    makes a clip and converts it
      adv2e convert clip.mp4                        converts a video of yours
      adv2e render clip.events.h5 -o events.mp4     shows its events as a film
      adv2e convert --help                          explains one command

    Tab completion in bash: eval "$(_ADV2E_COMPLETE=bash_source adv2e)"
    """

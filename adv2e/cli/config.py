"""``adv2e config``: show and check configurations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click
from click.shell_completion import CompletionItem

from adv2e import __version__
from adv2e.cli import completion, options
from adv2e.cli.commands import Command

if TYPE_CHECKING:
    from adv2e.cli.options import Layers
    from adv2e.config import Family


class _ShowByDefault(click.Group):
    """A group whose options without a command belong to ``show``."""

    command_class = Command

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Put ``show`` in front where no command is named; a shell asks which there are."""
        none = not args and not ctx.resilient_parsing
        if none or (args and args[0].startswith("-") and args[0] not in ctx.help_option_names):
            args = ["show", *args]
        return super().parse_args(ctx, args)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Offer the commands, or the options of ``show``."""
        if incomplete.startswith("-"):
            return show.shell_complete(ctx, incomplete)
        return super().shell_complete(ctx, incomplete)


@click.group("config", cls=_ShowByDefault)
def group() -> None:
    """Show or check a configuration, and explain its keys.

    \b
    Examples:
      adv2e config list
      adv2e config show v2e --set pixel.leak=null > mine.yaml
      adv2e config check mine.yaml
      adv2e convert clip.mp4 -c mine.yaml

    'adv2e config template davis346' begins one for 'adv2e diagnose'.

    A configuration is a YAML file. Keys that it leaves out keep their defaults. The value null
    switches an effect off. 'adv2e config' alone is 'adv2e config show'.

    These are shipped, and used by name: adv2e (the defaults), paper, v2e, vid2e, ideal, davis240c,
    davis346, gen4, atis. Over these, 'adv2e batch' may lay one with numbers to draw: train-e2vid,
    train-ecnn, train-v2e, train-v2e-dark.
    """


_files_argument = click.argument(
    "files", metavar="[FILE]...", nargs=-1, shell_complete=completion.configurations
)
"""FILE..., which is the same as -c FILE."""


def _family_of(files: tuple[str, ...], layers: Layers) -> Family:
    from adv2e.config import load_family

    return load_family((*files, *layers.config_files), layers.sets, layers.seed, layers.effects())


@group.command("list")
def list_shipped() -> None:
    """List the shipped configurations, which -c takes by name."""
    from adv2e.config.files import shipped, title

    for name in shipped():
        click.echo(f"{name:<16} {title(name)}")


@group.command()
@click.argument("name", metavar="CAMERA", shell_complete=completion.configurations)
def template(name: str) -> None:
    """Print a declared.yaml for 'adv2e diagnose', to write into it what is known of a camera.

    It holds what the maker of CAMERA, a shipped configuration, states for each one that he sells.
    All else depends on biases, light and the single chip, and is commented out.
    """
    from adv2e.config.files import template as template_of

    click.echo(template_of(name), nl=False)


@group.command()
@_files_argument
@options.config_options()
def show(files: tuple[str, ...], layers: Layers) -> None:
    """Print the configuration that FILE (or -c) and --set make, each key explained."""
    _print(_family_of(files, layers), "resolved configuration")


@group.command()
def defaults() -> None:
    """Print the default configuration, each key explained."""
    from adv2e.config import load_family

    _print(load_family(), "defaults")


@group.command()
@_files_argument
@options.config_options()
def check(files: tuple[str, ...], layers: Layers) -> None:
    """Check what FILE (or -c) and --set make. The exit status is 0 if it is right, 1 if not."""
    named = (*files, *layers.config_files)
    if not named and not layers.sets:
        raise click.UsageError("FILE is missing: name a configuration to check")
    _family_of(files, layers)
    click.echo(f"{', '.join(named) or 'defaults'}: ok")


def _print(family: Family, what: str) -> None:
    from adv2e.config import to_annotated_yaml

    drawn = ".  'adv2e batch' draws what is in braces" if family.forms else ""
    click.echo(f"# adv2e {__version__}: {what}{drawn}.  [unit] meaning; null: off")
    click.echo(to_annotated_yaml(family.config, family.forms), nl=False)

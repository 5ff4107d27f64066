"""``adv2e effects``: what is simulated, with equations, parameters and sources."""

from __future__ import annotations

import difflib
import textwrap
from dataclasses import MISSING
from typing import TYPE_CHECKING

import click

from adv2e.cli import completion
from adv2e.cli.commands import Command

if TYPE_CHECKING:
    from adv2e.config import Key
    from adv2e.effects import Effect

_WIDTH = 100


@click.command("effects", cls=Command)
@click.argument("name", metavar="NAME", required=False, shell_complete=completion.effects)
def command(name: str | None) -> None:
    """List the effects, or explain one with its equation.

    Without NAME, this lists all effects in the order in which they act on the signal, with their
    keys in the configuration. With NAME, it explains one effect: its equation, each parameter with
    unit, default, range and source, and the literature.

    \b
    Examples:
      adv2e effects
      adv2e effects low_pass
    """
    if name is None:
        _list()
        return
    from adv2e.effects import named

    known = named()
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"there are {', '.join(known)}"
        raise click.UsageError(f"no effect '{name}', {hint}")
    _page(known[name])


def _list() -> None:
    from adv2e.effects import EFFECTS, STAGES

    for stage, meaning in STAGES.items():
        effects = [effect for effect in EFFECTS if effect.stage == stage]
        if effects:
            click.echo(f"{stage}: {meaning}")
        for effect in effects:
            parts = f" (in a diagnosis also: {', '.join(effect.told_as)})"
            _wrapped(f"{effect.name:<20} ", f"{effect.summary()}{parts * bool(effect.told_as)}")
            _wrapped(" " * 21, ", ".join(key.path for key in _keys(effect)))


def _wrapped(begin: str, text: str) -> None:
    """Print `text` behind `begin`, both indented, in lines that fit a terminal."""
    indent = " " * (2 + len(begin))
    lines = textwrap.wrap(
        text, _WIDTH, initial_indent=f"  {begin}", subsequent_indent=indent, break_on_hyphens=False
    )
    click.echo("\n".join(lines))


def _keys(effect: Effect) -> list[Key]:
    """Return the keys of `effect`, sections left out."""
    from adv2e.config import all_keys

    return [
        key
        for key in all_keys()
        if not key.is_section
        and any(key.path == path or key.path.startswith(f"{path}.") for path in effect.paths)
    ]


def _page(effect: Effect) -> None:
    from adv2e.config import all_keys

    text, heading, references = effect.text().partition("References\n")
    click.echo(f"{text}Parameters\n----------")
    for key in _keys(effect):
        _parameter(key)
    for key in all_keys():
        if key.path in effect.paths and key.is_section and key.optional:
            state = "off" if key.default is None else "on"
            click.echo(f"\nBy default the effect is {state}; {key.path}: null switches it off.")
    click.echo(f"\n{heading}{references}")


def _parameter(key: Key) -> None:
    """Print a key with its unit, default, range, meaning and source."""
    from adv2e.config.yaml12 import scalar_text

    unit = f" [{key.about.unit}]" if key.about.unit not in ("", "-") else ""
    default = "no default" if key.default is MISSING else f"default {scalar_text(key.default)}"
    click.echo(f"{key.path}{unit}")
    _wrapped("  ", key.about.meaning)
    _wrapped("  ", ", ".join(filter(None, (default, *_range(key)))))
    if key.about.source:
        _wrapped("  ", f"source: {key.about.source}")


def _range(key: Key) -> list[str]:
    about = key.about
    if about.choices is not None:
        return [f"one of {' | '.join(about.choices)}"]
    limits = (
        ("above", about.above),
        ("at least", about.at_least),
        ("at most", about.at_most),
    )
    return [f"{word} {limit:g}" for word, limit in limits if limit is not None]

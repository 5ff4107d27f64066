"""``adv2e effects``: what is simulated, with equations, parameters and sources."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import MISSING
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from adv2e.config import Key
    from adv2e.effects import Effect


@click.command("effects")
@click.argument("name", required=False)
def command(name: str | None) -> None:
    """List the effects, their equations, parameters and sources.

    Without NAME: all of them, by stage in signal order. With NAME: physics, equation, references,
    and each parameter with unit, default, range and source.
    """
    if name is None:
        _list()
        return
    from adv2e.effects import EFFECTS

    named = {name: effect for effect in EFFECTS for name in (effect.name, *effect.told_as)}
    if name not in named:
        near = difflib.get_close_matches(name, named, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"there are {', '.join(named)}"
        raise click.UsageError(f"no effect '{name}', {hint}")
    _page(named[name])


def _list() -> None:
    from adv2e.effects import EFFECTS, STAGES

    for stage, meaning in STAGES.items():
        effects = [effect for effect in EFFECTS if effect.stage == stage]
        if effects:
            click.echo(f"{stage}: {meaning}")
        for effect in effects:
            paths = ", ".join(key.path for key in _keys(effect))
            parts = f" (a diagnosis also tells {', '.join(effect.told_as)})"
            click.echo(f"  {effect.name:<20} {effect.summary()}{parts * bool(effect.told_as)}")
            click.echo(f"  {'':<20} {paths}")


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
    from adv2e.config.yaml12 import scalar_text

    click.echo(effect.text())
    click.echo("\nParameters\n----------")
    rows = [("key", "unit", "default", "range", "source")]
    keys = _keys(effect)
    for key in keys:
        default = "must be given" if key.default is MISSING else scalar_text(key.default)
        source = key.about.source or "-"
        rows.append((key.path, key.about.unit or "-", default, _range(key), source))
    widths = [max(len(row[n]) for row in rows) for n in range(4)]
    for number, row in enumerate(rows):
        click.echo(_line(row, widths))
        if number:
            click.echo(f"    {keys[number - 1].about.meaning}")
    for key in all_keys():
        if key.path in effect.paths and key.is_section and key.optional:
            state = "off" if key.default is None else "on"
            click.echo(f"\nBy default the effect is {state}; {key.path}: null switches it off.")


def _line(row: Sequence[str], widths: Sequence[int]) -> str:
    cells = [f"{cell:<{width}}" for cell, width in zip(row, widths, strict=False)]
    return "  ".join([*cells, row[-1]]).rstrip()


def _range(key: Key) -> str:
    about = key.about
    if about.choices is not None:
        return " | ".join(about.choices)
    limits = (
        ("above", about.above),
        ("at least", about.at_least),
        ("at most", about.at_most),
    )
    return ", ".join(f"{word} {limit:g}" for word, limit in limits if limit is not None) or "-"

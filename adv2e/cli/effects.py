"""``adv2e effects``: what is simulated, with equations, parameters and sources."""

from __future__ import annotations

from dataclasses import MISSING
from textwrap import fill
from typing import TYPE_CHECKING

import click

from adv2e.cli import completion
from adv2e.cli.commands import Command
from adv2e.errors import did_you_mean

if TYPE_CHECKING:
    from adv2e.config import Key
    from adv2e.effects import Effect

_WIDTH = 100


@click.command("effects", cls=Command)
@click.argument("name", metavar="NAME", required=False, shell_complete=completion.effects)
@click.option("--all", "every", is_flag=True, help="Explain all effects, as one page of Markdown.")
def command(name: str | None, every: bool) -> None:
    """List the effects, or explain one with its equation.

    Without NAME, this lists all effects in the order in which they act on the signal, with their
    keys in the configuration. With NAME, it explains one effect: its equation, each parameter with
    unit, default, range and source, what tells it from other effects, where it acts and is tested,
    and the literature.

    \b
    Examples:
      adv2e effects
      adv2e effects low_pass
    """
    from adv2e.effects import EFFECTS, named

    known = named()
    if every and name is None:
        head = f"# The effects, as `adv2e effects --all` prints them\n\n```text\n{_list()}\n```\n"
        pages = (f"## {effect.name}\n\n```text\n{_page(effect)}\n```\n" for effect in EFFECTS)
        click.echo("\n".join([head, *pages]), nl=False)
    elif every:
        raise click.UsageError("NAME and --all: give one of them")
    elif name is None:
        click.echo(_list())
    elif name in known:
        click.echo(_page(known[name]))
    else:
        hint = did_you_mean(name, [*known]) or f"there are {', '.join(known)}"
        raise click.UsageError(f"no effect '{name}', {hint}")


def _list() -> str:
    from adv2e.effects import EFFECTS, STAGES

    lines = []
    for stage, meaning in STAGES.items():
        lines.append(f"{stage}: {meaning}")
        for effect in (effect for effect in EFFECTS if effect.stage == stage):
            parts = f" (in a diagnosis also: {', '.join(effect.told_as)})" * bool(effect.told_as)
            keys = ", ".join(key.path for key in _keys(effect) if not key.is_section)
            lines.append(_wrapped(f"{effect.name:<20} ", effect.summary() + parts))
            lines.append(_wrapped(" " * 21, keys))
    return "\n".join(lines)


def _wrapped(begin: str, text: str) -> str:
    indent = " " * (2 + len(begin))
    return fill(f"  {begin}{text}", _WIDTH, subsequent_indent=indent, break_on_hyphens=False)


def _keys(effect: Effect) -> list[Key]:
    from adv2e.config import all_keys

    below = tuple(f"{path}." for path in effect.paths)
    return [key for key in all_keys() if f"{key.path}.".startswith(below)]


def _page(effect: Effect) -> str:
    from adv2e.config.user_effects import METHODS
    from adv2e.effects import label_of, separated_by
    from adv2e.effects.hooks import Hooks

    text, *references = effect.text().partition("References\n")
    keys = _keys(effect)
    lines = [f"{text}Parameters\n----------", *(_parameter(k) for k in keys if not k.is_section)]
    for key in (key for key in keys if key.is_section and key.optional):
        state = "off" if key.default is None else "on"
        lines.append(f"\nBy default the effect is {state}; {key.path}: null switches it off.")
    lines.append("\nIn a diagnosis\n--------------")
    for name in (effect.name, *effect.told_as):
        texts = label_of(name), f"told apart by {separated_by(name)}" * bool(separated_by(name))
        lines += [name, *(_wrapped("  ", one) for one in texts if one)]
    path = effect.module.__name__.replace(".", "/")
    own = [c for c in vars(effect.module).values() if isinstance(c, type) and c is not Hooks]
    acting = {name for c in own if issubclass(c, Hooks) for name in vars(c)}
    hooks = ", ".join(name for name in METHODS if name in acting)
    lines.append(f"\nCode\n----\n{path}.py" + f" (hooks: {hooks})" * bool(hooks))
    test = f"tests/effects/test_{path.split('/')[-1]}.py\n"
    return "\n".join([*lines, test, "".join(references)])


def _parameter(key: Key) -> str:
    """Return a key with its unit, default, range, meaning, source and name in a sentence."""
    from adv2e.config.yaml12 import scalar_text

    about = key.about
    unit = f" [{about.unit}]" if about.unit not in ("", "-") else ""
    default = "no default" if key.default is MISSING else f"default {scalar_text(key.default)}"
    limits = {"above": about.above, "at least": about.at_least, "at most": about.at_most}
    span = [f"{word} {limit:g}" for word, limit in limits.items() if limit is not None]
    if about.choices is not None:
        span = [f"one of {' | '.join(about.choices)}"]
    more = {"source": about.source, "called": about.label}
    texts = [about.meaning, ", ".join([default, *span])]
    texts += [f"{word}: {text}" for word, text in more.items() if text]
    return "\n".join([f"{key.path}{unit}", *(_wrapped("  ", text) for text in texts)])

"""Pages of the commands, the keys of the configuration and the Python functions."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

import adv2e
from adv2e.causes import CAUSES
from adv2e.cli import COMMANDS, main
from adv2e.config import Key, all_keys
from adv2e.config.files import shipped, title
from adv2e.effects import EFFECTS
from adv2e.side.boxes import PROPHESEE
from website.effects import escaped, row


def write_pages(folder: Path) -> list[str]:
    """Write the pages; return their names."""
    pages = {
        **{name: _command_page(name) for name in COMMANDS},
        "commands": _commands(),
        "configuration": _configuration(),
        "python": _python(),
    }
    for name, text in pages.items():
        (folder / f"{name}.md").write_text(text, "utf-8")
    return ["commands", "configuration", "python"]


class _Recorder(click.HelpFormatter):
    """Takes down help as Markdown."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []

    def write_usage(self, prog: str, args: str = "", prefix: str | None = None) -> None:
        self.lines += ["```text", f"{prog} {args}".strip(), "```\n"]

    def write_text(self, text: str) -> None:
        for part in re.split(r"\n\s*\n", text.strip()):
            if part.startswith("\b"):
                self.lines += ["```text", part.strip("\b\n"), "```\n"]
            else:
                self.lines.append(f"{escaped(part)}\n")

    def write_dl(self, rows: Sequence[tuple[str, str]], *_: Any, **__: Any) -> None:
        for name, text in rows:
            self.lines.append(f"`{name}`\n: {' '.join(escaped(text).split()) or '-'}\n")

    @contextmanager
    def section(self, name: str) -> Iterator[None]:
        self.lines.append(f"**{name}**\n")
        yield


def _help(command: click.Command, *names: str) -> Iterator[str]:
    context = click.Context(main, info_name=names[0])
    for name in names[1:]:
        context = click.Context(command, info_name=name, parent=context)
    recorder = _Recorder()
    command.format_help(context, recorder)
    yield from recorder.lines
    for name, inner in getattr(command, "commands", {}).items():
        yield f"\n## {' '.join((*names, name))}\n"
        yield from _help(inner, *names, name)


def _command_page(name: str) -> str:
    command = main.get_command(click.Context(main), name)
    assert command is not None
    return "\n".join([f"# adv2e {name}\n", *_help(command, "adv2e", name)])


def _commands() -> str:
    lines = [
        "# Commands\n",
        "`adv2e COMMAND --help` prints what stands on these pages.\n",
        "| command | what it does |\n|---|---|",
        *(f"| [adv2e {name}]({name}.md) | {text} |" for name, text in COMMANDS.items()),
        "\n```{toctree}\n:hidden:\n",
        *COMMANDS,
        "```\n",
    ]
    return "\n".join(lines)


def _configuration() -> str:
    pages = {path: effect.name for effect in EFFECTS for path in effect.paths}
    lines = [
        "# Keys of the configuration\n",
        "`adv2e config defaults` prints these, too, and `adv2e config show` those of one of your"
        " own. [Which configuration for what](../which_preset.md)\n",
        "## Shipped configurations\n",
        "| name | what it is |\n|---|---|",
        *(f"| `{name}` | {escaped(title(name))} |" for name in shipped()),
        "\n## General\n",
        "| key | unit | default | range | meaning |\n|---|---|---|---|---|",
    ]
    keys = [*all_keys()]
    lines += [row(key) for key in keys if "." not in key.path and not key.is_section]
    for section in (key for key in keys if key.is_section):
        own = [key for key in keys if _is_own(key, section)]
        if own:
            found = pages.get(section.path)
            about = f"[What it does](../effects/{found}.md). " if found else ""
            lines += [f"\n## {section.path}\n", about + escaped(section.about.meaning) + "\n"]
            lines += ["| key | unit | default | range | meaning |\n|---|---|---|---|---|"]
            lines += map(row, own)
    return "\n".join(lines) + "\n"


def _is_own(key: Key, section: Key) -> bool:
    return not key.is_section and key.path.rpartition(".")[0] == section.path


def _python() -> str:
    lines = [
        "# Python\n",
        "```{eval-rst}",
        ".. automodule:: adv2e\n   :no-members:\n",
    ]
    names = [name for name in adv2e.__all__ if not name.startswith("__")]
    for title_, chosen in (
        ("Functions", [name for name in names if name[0].islower()]),
        ("Classes", [n for n in names if n[0].isupper() and isinstance(_of(n), type)]),
    ):
        lines += [f".. rubric:: {title_}\n"]
        for name in chosen:
            kind = "autofunction" if name[0].islower() else "autoclass"
            if isinstance(_of(name), type) and issubclass(_of(name), Exception | Warning):
                kind = "autoexception"
            lines += [f".. {kind}:: adv2e.{name}", "   :members:\n" * (kind == "autoclass")]
    lines += [
        ".. py:data:: adv2e.EVENT_DTYPE\n",
        "   The record of an event: ``t`` [us], ``x``, ``y``, ``p`` (1 ON, 0 OFF).\n",
        ".. rubric:: PyTorch\n",
        ".. autoclass:: adv2e.torch.EventDataset\n   :members:\n",
        ".. rubric:: What made an event, and what networks are to find\n",
        ".. py:data:: adv2e.causes.CAUSES\n",
        f"   Names of the causes; the place of each is its number: {', '.join(CAUSES)}.\n",
        ".. automodule:: adv2e.exporting.targets\n   :members: Targets\n",
        ".. py:currentmodule:: adv2e.exporting.targets\n",
        ".. py:data:: adv2e.side.boxes.PROPHESEE\n",
        f"   A box: {', '.join(PROPHESEE.names)}; the time in us on the clock of the events.\n",
        ".. rubric:: Effects of your own\n",
        ".. autoclass:: adv2e.effects.hooks.Hooks\n   :members:\n   :exclude-members: Parameters\n",
        ".. autoclass:: adv2e.effects.hooks.View\n   :members:\n",
        ".. autoclass:: adv2e.effects.reorder_buffer.InOrder\n   :members:\n",
        "```\n",
    ]
    return "\n".join(lines)


def _of(name: str) -> Any:
    return getattr(adv2e, name)

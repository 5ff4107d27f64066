"""Options that any text names, in documents, YAML, docstrings, help and messages, exist."""

from __future__ import annotations

import re

import pytest

from adv2e.cli import COMMANDS, main
from documentation.documents import ROOT

TEXTS = sorted(
    path
    for folder, pattern in (
        *(("", "*.md"), ("docs", "*.md")),
        *(("adv2e", "*.py"), ("adv2e", "*.md"), ("configs", "*")),
    )
    for path in ((ROOT / folder).rglob(pattern) if folder else ROOT.glob(pattern))
)
NAMED = re.compile(rf"adv2e ({'|'.join(COMMANDS)})\b([^'`\n]*)")


@pytest.fixture(scope="module")
def known():
    """Every option of every command."""
    commands = {name: main.get_command(None, name) for name in COMMANDS}
    return {name: options_of(command) for name, command in commands.items()}


def options_of(command):
    of_groups = (options_of(one) for one in getattr(command, "commands", {}).values())
    own = {name for item in command.params for name in (*item.opts, *item.secondary_opts)}
    return own.union({"--help"}, *of_groups)


def test_options_that_texts_name_exist(known):
    seen, wrong = 0, []
    for path in TEXTS:
        if path.name == "CHANGELOG.md":  # it tells of what was
            continue
        for command, rest in NAMED.findall(path.read_text("utf-8")):
            for option in re.findall(r"(?<![\w-])--[a-z][a-z0-9-]*", rest.partition(" # ")[0]):
                seen += 1
                if option not in known[command]:
                    wrong.append(f"{path.relative_to(ROOT)}: adv2e {command} {option}")
    assert wrong == []
    assert seen > 100

"""The configuration written out as YAML, plain or with unit and meaning of each key."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from dataclasses import MISSING
from typing import Any

from adv2e.config.build import Key, keys_of
from adv2e.config.model import Config
from adv2e.config.yaml12 import scalar_text
from adv2e.parameters import Section

_WIDTH = 100


def to_dict(config: Section) -> dict[str, Any]:
    """Return the configuration as nested dictionaries of numbers, texts, lists and None."""
    return {key.name: _plain(value) for key, value in _entries(config, "")}


def _plain(value: Any) -> Any:
    if isinstance(value, Section):
        return to_dict(value)
    return list(value) if isinstance(value, tuple) else value


def to_yaml(config: Config) -> str:
    """Return the configuration as YAML that reads back as an equal one."""
    return "".join(f"{line}\n" for line, _ in _lines(config, "", 0) if not _is_comment(line))


def to_annotated_yaml(config: Config) -> str:
    """Return the configuration as YAML with a comment at each key: its unit and meaning.

    Short comments stand behind the value, long ones above it; the keys of a section that is off
    are comments altogether.
    """
    lines = list(_lines(config, "", 0))
    column = max(len(line) for line, _ in lines) + 2
    written = []
    for line, note in lines:
        if column + len(note) + 2 <= _WIDTH:
            written.append(f"{line:<{column}}# {note}")
            continue
        indent = line[: len(line) - len(line.lstrip())] + "# "
        written += textwrap.wrap(
            note, _WIDTH, initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False
        )
        written.append(line)
    return "".join(f"{line}\n" for line in written)


def _entries(section: Section, path: str) -> Iterator[tuple[Key, Any]]:
    for key in keys_of(type(section), path):
        yield key, getattr(section, key.name)


def _lines(section: Section, path: str, depth: int) -> Iterator[tuple[str, str]]:
    """Yield each line of YAML and its comment; the keys of sections that are off as comments."""
    indent = "  " * depth
    for key, value in _entries(section, path):
        if isinstance(value, Section) and keys_of(type(value)):
            yield f"{indent}{scalar_text(key.name)}:", _note(key)
            yield from _lines(value, key.path, depth + 1)
        elif isinstance(value, Section):
            yield f"{indent}{scalar_text(key.name)}: {{}}", _note(key)
        elif key.is_section:
            yield f"{indent}{scalar_text(key.name)}: null", f"{_note(key)}; off"
            yield from _lines_off(key, indent + "  # ")
        else:
            yield f"{indent}{scalar_text(key.name)}: {scalar_text(value)}", _note(key)


def _lines_off(section: Key, indent: str) -> Iterator[tuple[str, str]]:
    """Yield the keys of a section that is off, and of those in it."""
    for key in keys_of(section.kind):
        if key.is_section:
            yield f"{indent}{scalar_text(key.name)}: null", f"{_note(key)}; off"
            yield from _lines_off(key, indent + "  ")
        else:
            default = "" if key.default is MISSING else f" {scalar_text(key.default)}"
            yield f"{indent}{scalar_text(key.name)}:{default}", _note(key)


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith("#")


def _note(key: Key) -> str:
    unit = f"[{key.about.unit}] " if key.about.unit not in ("", "-") else ""
    note = f"{unit}{key.about.meaning}"
    if key.about.choices and not all(choice in note for choice in key.about.choices):
        note += f" ({' | '.join(key.about.choices)})"
    return note

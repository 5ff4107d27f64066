"""The configuration written out as YAML, plain or with unit and meaning of each key."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import MISSING
from typing import Any

from adv2e.config.build import Key, keys_of, parts_of
from adv2e.config.model import Config
from adv2e.config.yaml12 import scalar_text
from adv2e.parameters import Section

_WIDTH = 100


def to_dict(config: Section) -> dict[str, Any]:
    """Return the configuration as nested dictionaries of numbers, texts, lists and None."""
    return {key.name: _plain(getattr(config, key.name)) for key in keys_of(type(config))}


def _plain(value: Any) -> Any:
    if isinstance(value, Section):
        return to_dict(value)
    return list(value) if isinstance(value, tuple) else value


def to_yaml(config: Config) -> str:
    """Return the configuration as YAML that reads back as an equal one."""
    return "".join(
        f"{line}\n" for line, _ in _lines(type(config), config, "", "", {}) if not _is_comment(line)
    )


def to_annotated_yaml(config: Config, forms: Mapping[str, str] | None = None) -> str:
    """Return the configuration as YAML with a comment at each key: its unit and meaning.

    Short comments stand behind the value, long ones above it; the keys of a section that is off
    are comments altogether.  `forms`: what is written for the numbers at some keys.
    """
    lines = list(_lines(type(config), config, "", "", forms or {}))
    # distributions may reach further, those of others need not
    column = max(len(line) for line, _ in _lines(type(config), config, "", "", {})) + 2
    written = []
    for line, note in lines:
        if max(column, len(line) + 2) + len(note) + 2 <= _WIDTH:
            written.append(f"{f'{line}  ':<{column}}# {note}")
            continue
        indent = line[: len(line) - len(line.lstrip())] + "# "
        written += textwrap.wrap(
            note, _WIDTH, initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False
        )
        written.append(line)
    return "".join(f"{line}\n" for line in written)


def _lines(
    section: type[Section],
    values: Section | None,
    indent: str,
    path: str,
    forms: Mapping[str, str],
) -> Iterator[tuple[str, str]]:
    """Yield each line of YAML and its comment; without `values`, those of a section that is off."""
    for key in keys_of(section, path):
        name = f"{indent}{scalar_text(key.name)}"
        value = key.default if values is None else getattr(values, key.name)
        if not key.is_section:
            text = "" if value is MISSING else f" {_text(key, value, forms)}"
            yield f"{name}:{text}", _note(key)
        elif values is None or value is None:
            yield f"{name}: null", f"{_note(key)}; off"
            inside = indent + ("  " if values is None else "  # ")
            yield from _lines(key.kind, None, inside, key.path, {})
        elif keys_of(key.kind):
            yield f"{name}:", _note(key)
            yield from _lines(key.kind, value, indent + "  ", key.path, forms)
        else:
            yield f"{name}: {{}}", _note(key)


def _text(key: Key, value: Any, forms: Mapping[str, str]) -> str:
    if key.parts:
        parts = zip(parts_of(key), value, strict=True)
        return f"[{', '.join(_text(part, number, forms) for part, number in parts)}]"
    return forms.get(key.path) or scalar_text(value)


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith("#")


def _note(key: Key) -> str:
    unit = f"[{key.about.unit}] " if key.about.unit not in ("", "-") else ""
    note = f"{unit}{key.about.meaning}"
    if key.about.choices and not all(choice in note for choice in key.about.choices):
        note += f" ({' | '.join(key.about.choices)})"
    return note

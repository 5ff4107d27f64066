"""YAML 1.2 core schema on top of PyYAML, with the place of every value.

PyYAML follows YAML 1.1, where ``on`` and ``no`` are booleans (even as keys), ``12:30:00`` is a
number and ``1e3`` is text.  Here the rules are those of the 1.2 core schema: only ``true`` and
``false`` are booleans, ``null``, ``~`` and nothing are none, ``1e3``, ``.inf`` and ``0o17`` are
numbers.  Keys must be text, and giving one twice is an error.

Programs that follow YAML 1.1 read a key ``on`` that is not quoted as true, and write it back as
``true``.  So the keys ``true`` and ``false`` are read as ``on`` and ``off``, and what is written
here is quoted where the two versions differ.

References
----------
.. [1] YAML Ain't Markup Language, version 1.2.2, section 10.3 (core schema), https://yaml.org/spec.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import yaml

from adv2e.errors import Adv2eError, ConfigError, UsageError

Scalar = None | bool | int | float | str

_TAG = "tag:yaml.org,2002:"


@dataclass(frozen=True)
class Origin:
    """Origin of a value: file and line, or option of the command line."""

    name: str = ""
    """File name, or the option of the command line."""
    line: int | None = None
    on_command_line: bool = False

    def at(self, line: int | None) -> Origin:
        """Return a line of this file; a command line has none."""
        return self if self.on_command_line else Origin(self.name, line)

    def complaint(self, path: str, text: str) -> Adv2eError:
        """Return the exception that says `text` of the key at `path` and names the place."""
        if self.on_command_line:
            where = self.name if self.name.lstrip("-") == path else f"{self.name} {path}"
            return UsageError(f"{where}: {text}")
        place = self.name if self.line is None else f"{self.name}:{self.line}"
        return ConfigError(": ".join(part for part in (place, path, text) if part))


@dataclass(frozen=True)
class Value:
    """A value and its place: a scalar, a list, or a mapping of keys to values."""

    content: Scalar | list[Value] | dict[str, Value]
    origin: Origin = field(default_factory=Origin)
    text: str = ""
    """A scalar as it was written."""

    def __str__(self) -> str:
        if isinstance(self.content, dict):
            shown = "{" + ", ".join(f"{key}: {item}" for key, item in self.content.items()) + "}"
        elif isinstance(self.content, list):
            shown = "[" + ", ".join(str(item) for item in self.content) + "]"
        elif isinstance(self.content, str):
            shown = repr(self.content)
        else:
            shown = self.text or scalar_text(self.content)
        return shown if len(shown) <= 60 else shown[:57] + "..."


class _Loader(yaml.SafeLoader):
    """PyYAML's reader with the tags of the core schema."""


_Loader.yaml_implicit_resolvers = {}
_NUMBER_START = list("-+.0123456789")
for _tag, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("int", r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+", _NUMBER_START),
    (
        "float",
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?"
        r"|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        _NUMBER_START,
    ),
):
    _Loader.add_implicit_resolver(_TAG + _tag, re.compile(f"^(?:{_pattern})$"), _first)


def _integer(text: str) -> int:
    base = {"0o": 8, "0x": 16}.get(text[:2], 10)
    return int(text[2:] if base != 10 else text, base)


def _number(text: str) -> float:
    return float(text.replace(".", "") if text.lower().endswith(("inf", "nan")) else text)


_KEYS_OF_1_1 = {"true": "on", "false": "off"}


def key_text(key: bool | str) -> str:
    """Return the name of the key that was read as `key`; true and false stand for on and off."""
    return _KEYS_OF_1_1[str(key).lower()] if isinstance(key, bool) else key


_SCALARS: dict[str, Callable[[str], Scalar]] = {
    _TAG + "null": lambda text: None,
    _TAG + "bool": lambda text: text.lower() == "true",
    _TAG + "int": _integer,
    _TAG + "float": _number,
    _TAG + "str": str,
}


_MOST = 100_000
"""Values of one document."""


class _Builder:
    """Turns YAML nodes into :class:`Value` trees."""

    def __init__(self, origin: Origin) -> None:
        self.origin = origin
        self.count = 0  # of values, those of aliases counted where they stand
        self.open: set[int] = set()

    def place(self, node: yaml.Node) -> Origin:
        return self.origin.at(node.start_mark.line + 1)

    def build(self, node: yaml.Node, path: str) -> Value:
        self.count += 1
        if self.count > _MOST:
            raise self.place(node).complaint(
                path, f"over {_MOST:,} values, aliases (*) counted where they stand: write fewer"
            )
        if id(node) in self.open:
            raise self.place(node).complaint(path, "an alias (*) must not contain itself")
        self.open.add(id(node))
        content: Any
        if isinstance(node, yaml.MappingNode) and node.tag == _TAG + "map":
            content = self.mapping(node, path)
        elif isinstance(node, yaml.SequenceNode) and node.tag == _TAG + "seq":
            content = [self.build(item, f"{path}[{n}]") for n, item in enumerate(node.value)]
        else:
            content = self.scalar(node, path)
        self.open.discard(id(node))
        text = node.value if isinstance(node, yaml.ScalarNode) else ""
        return Value(content, self.place(node), text)

    def scalar(self, node: yaml.Node, path: str) -> Scalar:
        convert = _SCALARS.get(node.tag)
        if convert is None or not isinstance(node, yaml.ScalarNode):
            tag = node.tag.replace(_TAG, "!!")
            raise self.place(node).complaint(path, f"unknown tag {tag}: write the value without it")
        try:
            return convert(node.value)
        except ValueError:
            raise self.place(node).complaint(
                path, f"{node.value[:40]!r} is not a value of {node.tag.replace(_TAG, '!!')}"
            ) from None

    def mapping(self, node: yaml.MappingNode, path: str) -> dict[str, Value]:
        content: dict[str, Value] = {}
        lines: dict[str, Origin] = {}
        for key_node, value_node in node.value:
            place = self.place(key_node)
            if key_node.tag not in (_TAG + "str", _TAG + "bool"):
                written = key_node.value if isinstance(key_node, yaml.ScalarNode) else "a mapping"
                nothing = isinstance(value_node, yaml.ScalarNode) and not value_node.value
                comma = nothing and key_node.tag == _TAG + "int" and content
                hint = ": numbers have a decimal point, not a comma" if comma else ""
                raise place.complaint(path, f"a key must be text, got {written}{hint}")
            name = self.scalar(key_node, path)
            assert isinstance(name, (str, bool))
            key = key_text(name)
            full = f"{path}.{key}" if path else key
            if key in content:
                first = lines[key].line
                where = f" (first on line {first})" if first is not None else ""
                also = f" (a key {key_node.value} is {key})" if isinstance(name, bool) else ""
                raise place.complaint(full, f"given twice{where}{also}: keep one")
            # the line of the key says more than that of a section's first entry
            content[key] = replace(self.build(value_node, full), origin=place)
            lines[key] = place
        return content


def parse(text: str, origin: Origin, path: str = "") -> Value:
    """Return the one YAML document in `text`.

    Parameters
    ----------
    text : str
        YAML; nothing at all is none.
    origin : Origin
        What errors name: the file, or the option of the command line.
    path : str
        Key at which the document stands, for errors.

    Raises
    ------
    ConfigError, UsageError
        Not YAML, a key given twice, a key that is not text; the kind depends on `origin`.
    """
    try:
        node = yaml.compose(text, Loader=_Loader)
        return Value(None, origin) if node is None else _Builder(origin).build(node, path)
    except yaml.reader.ReaderError as error:
        at = origin.at(text[: error.position].count("\n") + 1)
        why = f"the character {chr(error.character)!r} is not allowed"
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        at = origin.at(mark.line + 1 if mark else None)
        why = ", ".join(part for part in (error.context, error.problem) if part)
    except RecursionError:
        at, why = origin, "nested too deeply"
    raise at.complaint(path, f"not YAML: {why}")


_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_.:/+-]*[A-Za-z0-9_]|[A-Za-z_]")
_WORDS_OF_1_1 = {"y", "n", "yes", "no", "on", "off", "true", "false", "null"}


def scalar_text(value: Any) -> str:
    """Return `value` as YAML that reads back as the same value, under YAML 1.1 and 1.2 alike.

    Floats are the shortest decimal that reads back as the same number, with a point.  Tuples and
    lists are flow sequences, dictionaries flow mappings.
    """
    if isinstance(value, dict):
        items = (f"{scalar_text(key)}: {scalar_text(item)}" for key, item in value.items())
        return f"{{{', '.join(items)}}}"
    if isinstance(value, (tuple, list)):
        return f"[{', '.join(map(scalar_text, value))}]"
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        text = repr(value)
        if text.lstrip("-") in ("inf", "nan"):
            return text.replace("inf", ".inf").replace("nan", ".nan")
        mantissa, _, exponent = text.partition("e")
        if exponent and "." not in mantissa:
            text = f"{mantissa}.0e{exponent}"
        return text
    if isinstance(value, int):
        return str(value)
    assert isinstance(value, str)
    if _PLAIN.fullmatch(value) and value.lower() not in _WORDS_OF_1_1:
        return value
    quoted = yaml.dump(value, default_style='"', width=float("inf"), allow_unicode=True)
    return str(quoted).rstrip("\n")

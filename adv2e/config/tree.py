"""Trees of values: dotted keys (``pixel.leak.rate_hz``), merging, and syntax of drawn numbers."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from adv2e.config.yaml12 import Origin, Value, parse, scalar_text
from adv2e.errors import UsageError

# ---- Dotted keys in nested mappings: ``pixel.leak.rate_hz``.


def set_key(values: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted `key` in nested mappings; a section that is null becomes one."""
    *above, last = key.split(".")
    for name in above:
        if not isinstance(values.get(name), dict):
            values[name] = {}
        values = values[name]
    values[last] = value


def get_key(values: Mapping[str, Any], key: str) -> Any:
    """Return the value of a dotted `key`, None if it or its section is absent or null."""
    found: Any = values
    for name in key.split("."):
        if not isinstance(found, Mapping):
            return None
        found = found.get(name)
    return found


def flat(values: Mapping[str, Any], above: str = "") -> list[tuple[str, Any]]:
    result: list[tuple[str, Any]] = []
    for name, value in values.items():
        if isinstance(value, Mapping):
            result += flat(value, f"{above}{name}.")
        else:
            result.append((f"{above}{name}", value))
    return result


# ---- Merging configurations: files one over the other, then ``--set`` values, then the seed.


_PATH = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*")


def merge(under: Value, over: Value) -> Value:
    """Return `under` with the keys of `over` on top, section by section.

    Everything but two mappings is replaced: ``null`` over a section switches it off, a section
    over ``null`` switches it on.  So is a distribution, which is written like a section.
    """
    sections = isinstance(under.content, dict) and isinstance(over.content, dict)
    if not sections or is_form(under) or is_form(over):
        return over
    assert isinstance(under.content, dict)
    assert isinstance(over.content, dict)
    content = dict(under.content)
    for key, value in over.content.items():
        content[key] = merge(content[key], value) if key in content else value
    return Value(content, under.origin)


def parse_set(text: str) -> Value:
    """Return the tree of one ``--set`` argument, ``KEY=VALUE`` with VALUE in YAML.

    Raises
    ------
    UsageError
        No ``=``, a key that is not a path of names, a value that is not YAML.
    """
    path, equals, written = text.partition("=")
    path = path.strip()
    if not equals or not _PATH.fullmatch(path):
        raise UsageError(
            f"--set {text}: must be KEY=VALUE, such as --set pixel.low_pass.cutoff_hz=100"
        )
    origin = Origin("--set", on_command_line=True)
    value = parse(written, origin, path)
    for key in reversed(path.split(".")):
        value = Value({key: value}, origin)
    return value


# ---- Syntax of distributions in place of numbers; see :mod:`adv2e.config.distributions`.


LAWS = ("uniform", "log_uniform", "normal", "choice")
TIE = "same_as"


def is_form(value: Value) -> bool:
    """Tell whether a value looks like a distribution, rather than like a section."""
    return isinstance(value.content, dict) and bool({*LAWS, TIE} & value.content.keys())


def form_text(value: Value) -> str:
    if isinstance(value.content, dict):
        items = (f"{key}: {form_text(item)}" for key, item in value.content.items())
        return f"{{{', '.join(items)}}}"
    if isinstance(value.content, list):
        return f"[{', '.join(map(form_text, value.content))}]"
    return scalar_text(value.content)

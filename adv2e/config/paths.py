"""Dotted keys in nested mappings: ``pixel.leak.rate_hz``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


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
    """Return nested mappings as dotted keys."""
    result: list[tuple[str, Any]] = []
    for name, value in values.items():
        if isinstance(value, Mapping):
            result += flat(value, f"{above}{name}.")
        else:
            result.append((f"{above}{name}", value))
    return result

"""Merging configurations: files one over the other, then ``--set`` values, then the seed."""

from __future__ import annotations

import re

from adv2e.config.forms import is_form
from adv2e.config.yaml12 import Origin, Value, parse
from adv2e.errors import UsageError

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

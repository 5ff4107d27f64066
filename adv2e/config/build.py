"""From a tree of values to the frozen dataclasses, strictly.

The declarations in :mod:`adv2e.config.model` are the schema: names, types, ranges and defaults.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import MISSING
from typing import Any, TypeVar

from adv2e.config.model import Config
from adv2e.config.tree import form_text, is_form
from adv2e.config.yaml12 import Value, scalar_text
from adv2e.errors import Adv2eError, ConfigError, did_you_mean
from adv2e.parameters import Parameter, Section, kinds_of

AnySection = TypeVar("AnySection", bound=Section)

_NAMES = {int: "a whole number", float: "a number", str: "text", bool: "true or false"}


@dataclasses.dataclass(frozen=True)
class Key:
    """One key of the configuration, as declared."""

    path: str
    about: Parameter
    kind: type
    """int, float, str, bool, tuple or the class of a section."""
    optional: bool
    """True if the value may be null."""
    default: Any
    """The value where the key is absent; MISSING: it must be given."""
    parts: tuple[type, ...] = ()
    """Of a tuple: the kind of each part."""

    @property
    def name(self) -> str:
        return self.path.rpartition(".")[2]

    @property
    def is_section(self) -> bool:
        return issubclass(self.kind, Section)


def keys_of(section: type[Section], path: str = "") -> tuple[Key, ...]:
    """Return the keys that the class `section`, which stands at `path`, declares itself."""
    kinds = kinds_of(section)  # type: ignore[arg-type] # takes it for an object of it
    keys = []
    for item in dataclasses.fields(section):
        of = kinds[item.name]
        default = item.default
        if item.default_factory is not MISSING:
            default = item.default_factory()
        full = f"{path}.{item.name}" if path else item.name
        keys.append(Key(full, item.metadata["parameter"], of.kind, of.optional, default, of.parts))
    return tuple(keys)


def all_keys(section: type[Section] = Config, path: str = "") -> Iterator[Key]:
    """Yield every key below `section`, sections before what they hold, in the order declared."""
    for key in keys_of(section, path):
        yield key
        if key.is_section:
            yield from all_keys(key.kind, key.path)


def build(section: type[AnySection], tree: Value, path: str = "") -> AnySection:
    """Return the `section` that `tree` describes; keys that are absent keep their defaults.

    Raises
    ------
    ConfigError, UsageError
        Unknown key, wrong type, impossible value, key without default left out.  The text names
        file and line, the path of the key, the value, and what would be right; the kind depends on
        where the value was written.
    """
    keys = {key.name: key for key in keys_of(section, path)}
    given = tree.content
    if not isinstance(given, dict):
        raise tree.origin.complaint(path, f"must be {_keys_text(section)}, got {tree}")
    values: dict[str, Any] = {}
    for name, value in given.items():
        if name not in keys:
            raise _unknown(name, value, keys, path)
        values[name] = _value(keys[name], value)
    for key in keys.values():
        if key.default is not MISSING or key.name in values:
            continue
        if key.is_section:  # which of its keys must be given is said there
            values[key.name] = build(key.kind, Value({}, tree.origin), key.path)
        else:
            unit = f" [{key.about.unit}]" if key.about.unit not in ("", "-") else ""
            raise tree.origin.complaint(
                key.path, f"must be given, it has no default: {key.about.meaning}{unit}"
            )
    try:
        return section(**values)
    except ConfigError as error:
        raise _placed(error, tree, path) from None


def _value(key: Key, value: Value) -> Any:
    if value.content is None and key.optional:
        return None
    if key.is_section:
        if value.content is None:
            raise value.origin.complaint(
                key.path, f"cannot be null, it must be {_keys_text(key.kind)}"
            )
        if key.optional and not isinstance(value.content, dict):
            raise value.origin.complaint(
                key.path, f"must be {_keys_text(key.kind)}, or null, got {value}"
            )
        return build(key.kind, value, key.path)
    return _tuple(key, value) if key.parts else _scalar(key, value)


def _tuple(key: Key, value: Value) -> tuple[Any, ...]:
    if not isinstance(value.content, list) or len(value.content) != len(key.parts):
        raise value.origin.complaint(
            key.path, f"must be a list of {len(key.parts)} values such as"
            f" {scalar_text(key.default)}, got {value}"
        )  # fmt: skip
    return tuple(map(_scalar, parts_of(key), value.content))


def parts_of(key: Key) -> tuple[Key, ...]:
    return tuple(
        dataclasses.replace(key, path=f"{key.path}[{n}]", kind=kind, parts=())
        for n, kind in enumerate(key.parts)
    )


def _scalar(key: Key, value: Value) -> Any:
    content = value.content
    if type(content) is key.kind or (key.kind is float and type(content) is int):
        return content
    if key.kind in (int, float) and is_form(value):
        raise value.origin.complaint(
            key.path,
            f"{form_text(value)} is a distribution, from which 'adv2e batch' draws a number for"
            " each sequence: write a number here",
        )
    wanted = _NAMES[key.kind]
    if key.about.choices is not None:
        wanted = f"one of {', '.join(key.about.choices)}"
    if key.about.unit not in ("", "-"):
        wanted += f" [{key.about.unit}]"
    if key.optional:
        wanted += " or null"
    hint = ""
    if key.kind is int and isinstance(content, float) and content.is_integer():
        hint = f", which is a floating-point number: write {int(content)}"
    elif isinstance(content, str) and key.kind is not str and _reads_as(content, key.kind):
        hint = ": leave out the " + ("underscores" if "_" in content else "quotes")
    raise value.origin.complaint(key.path, f"must be {wanted}, got {value}{hint}")


def _reads_as(text: str, kind: type) -> bool:
    try:
        kind(text)
    except ValueError:
        return False
    return kind is not bool


def _keys_text(section: type[Section]) -> str:
    names = ", ".join(item.name for item in dataclasses.fields(section))
    return f"a mapping with the keys {names}" if names else "an empty mapping, {}"


def _unknown(name: str, value: Value, keys: dict[str, Key], path: str) -> Adv2eError:
    full = f"{path}.{name}" if path else name
    if full == "user":
        return value.origin.complaint(full, "effects of your own need their file: --effect FILE.py")
    return value.origin.complaint(full, f"unknown key (value {value}), {_nearest(name, keys)}")


def _nearest(name: str, keys: dict[str, Key]) -> str:
    bare = name.partition(":")[0]
    if bare in keys and bare != name:
        return f"did you mean '{bare}: {name.partition(':')[2]}' with a space after the colon?"
    *above, last = name.split(".")
    if above and name in {key.path for key in all_keys()}:
        nested = "".join(f"{part}: {{" for part in above)
        return f"each part by itself: {nested}{last}: ...{'}' * len(above)}"
    elsewhere = {key.name: key.path for key in reversed(list(all_keys()))}
    near = did_you_mean(name, [*keys]) or did_you_mean(name, elsewhere)
    return near or (f"known here: {', '.join(keys)}" if keys else "this section has no keys")


def _placed(error: ConfigError, tree: Value, path: str) -> Adv2eError:
    """Return `error`, whose text begins with a key below `path`, with the place of that key."""
    inner, _, text = str(error).partition(": ")
    value = tree
    for name in inner.split("."):
        if not (isinstance(value.content, dict) and name in value.content):
            break
        value = value.content[name]
    return value.origin.complaint(f"{path}.{inner}" if path else inner, text)

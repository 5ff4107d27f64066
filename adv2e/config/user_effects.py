"""Effects of the user's own: their sections in a configuration, and classes loaded from a file.

A configuration that knows them is of a class made for them: that of all configurations with one
more section, ``user``, and in it a section for each effect, named after it.
"""

from __future__ import annotations

import dataclasses
import hashlib
import inspect
import re
import sys
import traceback
from collections.abc import Mapping
from dataclasses import MISSING
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

from adv2e.config.build import Key, keys_of
from adv2e.config.model import Config
from adv2e.effects import STAGES
from adv2e.effects.hooks import Hooks
from adv2e.errors import ConfigError, one_line
from adv2e.files.regular import read_text_bytes, reading, shown
from adv2e.parameters import Section, subsection


@lru_cache(maxsize=64)
def config_class(effects: tuple[type[Hooks], ...]) -> type[Config]:
    """Return the class of configurations with a section ``user.<name>`` for each of `effects`.

    An effect is on, with the defaults of its parameters, unless the configuration says otherwise.

    Raises
    ------
    ConfigError
        Two of them have the same name.
    """
    if not effects:
        return Config
    by_name: dict[str, type[Hooks]] = {}
    for effect in effects:
        if effect.name in by_name:
            raise ConfigError(f"user.{effect.name}: two effects have this name: rename one")
        by_name[effect.name] = effect
    fields = [
        (name, effect.Parameters | None, _declared(effect)) for name, effect in by_name.items()
    ]
    user = dataclasses.make_dataclass(
        "User", fields, bases=(Section,), frozen=True, kw_only=True, namespace={"effects": by_name}
    )
    needed = any(field.default_factory is MISSING for _, _, field in fields)
    declared = subsection(MISSING if needed else user, meaning="effects of your own")
    return dataclasses.make_dataclass(
        "Config", [("user", user, declared)], bases=(Config,), frozen=True, kw_only=True
    )


def _declared(effect: type[Hooks]) -> Any:
    section = effect.Parameters
    needed = any(
        item.default is MISSING and item.default_factory is MISSING
        for item in dataclasses.fields(section)
    )
    meaning = (inspect.getdoc(effect) or effect.name).partition("\n")[0]
    return subsection(MISSING if needed else section, meaning=meaning)


def user_effects(config: Config) -> Mapping[str, type[Hooks]]:
    """Return the effects of the user's own that a configuration has sections for, by name."""
    user = getattr(config, "user", None)
    return {} if user is None else type(user).effects


# ---- Effects of the user's own: classes loaded from a file.


METHODS = (
    *("light", "light_now", "gain", "drive", "signal", "thresholds", "inject"),
    *("events", "events_now"),
)
"""The methods of which an effect overrides one at least."""


def load_effects(path: str | Path) -> list[type[Hooks]]:
    """Return the effects that the Python file at `path` defines, in the order written.

    Raises
    ------
    ConfigError
        The file is missing, is not Python, fails when it runs, or what it defines is no effect;
        the text names the file and, where there is one, the line.
    """
    path = Path(path)
    with reading(path, ConfigError):
        source = read_text_bytes(path, ConfigError)
    digest = hashlib.sha256(source).hexdigest()
    module = _run(path, source, f"adv2e_effect_{digest[:16]}")
    found = [
        item
        for item in vars(module).values()
        if isinstance(item, type) and issubclass(item, Hooks) and item.__module__ == module.__name__
    ]
    if not found:
        raise ConfigError(
            f"{path}: defines no effect, which is a class derived from adv2e.effects.hooks.Hooks"
        )
    for effect in found:
        wrong = _complaint(effect)
        if wrong:
            raise ConfigError(f"{path}:{_line(effect, source)}: class {effect.__name__}: {wrong}")
        effect.source = {"name": effect.name, "file": shown(path.name), "sha256": digest}
    return found


def _run(path: Path, source: bytes, name: str) -> ModuleType:
    module = ModuleType(name)
    module.__file__ = str(path)
    # annotations of dataclasses are looked up there
    sys.modules[name] = module
    try:
        exec(compile(source, str(path), "exec"), vars(module))
    except SyntaxError as error:
        raise ConfigError(f"{path}:{error.lineno or 1}: not Python: {error.msg}") from None
    except Exception as error:
        frames = traceback.extract_tb(error.__traceback__)
        lines = [frame.lineno for frame in frames if frame.filename == str(path)]
        raise ConfigError(
            f"{path}:{lines[-1] if lines else 1}: {type(error).__name__}: {one_line(error)}"
        ) from error
    return module


def _line(effect: type[Hooks], source: bytes) -> int:
    found = re.search(rf"^class\s+{effect.__name__}\b".encode(), source, re.MULTILINE)
    return source[: found.start()].count(b"\n") + 1 if found else 1


def _complaint(effect: type[Hooks]) -> str | None:
    if not re.fullmatch(r"[a-z]\w*", effect.name):
        return f"name: must be lower-case letters, digits and underscores, got {effect.name!r}"
    if effect.stage not in STAGES:
        return f"stage: must be one of {', '.join(STAGES)}, got {effect.stage!r}"
    if not any(getattr(effect, name) is not getattr(Hooks, name) for name in METHODS):
        return f"changes nothing: it must define one of {', '.join(METHODS)}"
    section: Any = effect.Parameters  # whatever the file says
    if not (isinstance(section, type) and issubclass(section, Section)):
        return "Parameters: must be a class derived from adv2e.parameters.Section"
    if "__dataclass_fields__" not in vars(section):
        return f"Parameters: {section.__name__} must be a dataclass(frozen=True, kw_only=True)"
    for item in dataclasses.fields(section):
        if "parameter" not in item.metadata:
            return f"Parameters: {item.name} must be declared with parameter(unit=, meaning=)"
    try:
        keys = keys_of(section)
    except (NameError, TypeError, ValueError) as error:
        return f"Parameters: {error}"
    return next(filter(None, map(_key_complaint, keys)), None)


_KINDS = (float, int, bool, str)


def _key_complaint(key: Key) -> str | None:
    kinds = key.parts or (key.kind,)
    if not set(kinds) <= set(_KINDS):
        wanted = ", ".join(kind.__name__ for kind in _KINDS)
        return f"Parameters: {key.name}: its type must be one of {wanted} or a tuple of them"
    wrong = None if key.default is MISSING else key.about.complaint(key.default)
    if wrong:
        return f"Parameters: {key.name}: default: {wrong}"
    fit = key.about.fit
    if fit is None:
        return None
    if set(kinds) != {float}:
        return f"Parameters: {key.name}: fit: only float, and tuples of it, can be fitted"
    wrong = key.about.complaint(fit.low) or key.about.complaint(fit.high)
    return f"Parameters: {key.name}: fit: {wrong}" if wrong else None

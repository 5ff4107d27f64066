"""Configuration files: found, read, written out as YAML; shipped ones go by their name."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import MISSING
from itertools import takewhile
from pathlib import Path
from typing import Any

from adv2e.config.build import Key, keys_of, parts_of
from adv2e.config.model import Config
from adv2e.config.yaml12 import Origin, Value, parse, scalar_text
from adv2e.errors import ConfigError, did_you_mean
from adv2e.files.regular import read_text
from adv2e.parameters import Section


def shipped_folder() -> Path:
    """Return the folder of the shipped configurations.

    Inside the package where it was installed; beside it in a source checkout.
    """
    package = Path(__file__).resolve().parents[1]
    inside = package / "configs"
    return inside if inside.is_dir() else package.parent / "configs"


def shipped() -> list[str]:
    return sorted(path.stem for path in shipped_folder().glob("*.yaml"))


def title(name: str) -> str:
    """Return the title of a shipped configuration: the first sentence of its comment."""
    text = (shipped_folder() / f"{name}.yaml").read_text("utf-8")
    comment = takewhile(lambda line: line.startswith("#"), text.splitlines())
    told = re.sub(r"\s*\([^)]*\)", "", " ".join(line.lstrip("# ") for line in comment))
    # a sentence, without the authors that follow a colon
    return re.split(r"\.\s|:\s(?=[A-Z]\.)", told, maxsplit=1)[0]


_TEMPLATE = """\
# What is known of a camera, for 'adv2e diagnose RECORDING -c declared.yaml'.  Every key that is
# written here counts as known: if the data need another value, that is the finding.  The maker
# knows the sensor alone.  The rest is commented out, as {name} has it: thresholds, bandwidth and
# noise depend on biases, light and the single chip.  Take the '#' away from keys, and the sections
# that they are in, where you have measured your own.

"""


def template(name: str) -> str:
    """Return the text of a shipped configuration of which but the sensor is commented out.

    Raises
    ------
    ConfigError
        No configuration of that name is shipped, or it has no sensor.
    """
    texts = {one: find(one).read_text("utf-8").splitlines() for one in shipped()}
    cameras = [one for one, text in texts.items() if "sensor:" in text]
    if name not in cameras:
        raise ConfigError(f"{name}: no camera that is shipped, must be one of {', '.join(cameras)}")
    written, is_known = [_TEMPLATE.format(name=name)], False
    for line in texts[name]:
        if line and not line[0].isspace() and not line.startswith("#"):
            is_known = line == "sensor:"
        keep = is_known or not line or line.startswith("#")
        written.append(f"{line}\n" if keep else f"# {line}\n")
    return "".join(written)


def find(name: str | Path) -> Path:
    """Return the path of the configuration `name`: a file, or the name of a shipped one.

    Raises
    ------
    ConfigError
        There is no such file and no such name; the text lists the names there are.
    """
    path = Path(name)
    if path.exists() and not path.is_dir():
        return path
    if path.name == str(name) and path.name in shipped():
        return shipped_folder() / f"{path.name}.yaml"
    if path.is_dir():
        raise ConfigError(f"{name}: is a folder, must be a YAML file")
    if path.suffix:
        known = path.suffix in (".yaml", ".yml") and path.stem in shipped()
        hint = f" (the shipped one: -c {path.stem})" if known else ""
        raise ConfigError(f"{name}: no such file{hint}")
    near = did_you_mean(path.name.lower(), shipped())
    what = ", ".join(filter(None, ["no such file or shipped configuration", near]))
    raise ConfigError(f"{name}: {what} (shipped: {', '.join(shipped())})")


def read(name: str | Path) -> Value:
    """Return the tree of the configuration file or shipped configuration `name`.

    Raises
    ------
    ConfigError
        The file is missing, cannot be read, is not YAML, or is not a mapping of keys.
    """
    path = find(name)
    tree = parse(read_text(path, ConfigError), Origin(str(path)))
    if tree.content is None:  # nothing but comments
        return Value({}, tree.origin)
    if not isinstance(tree.content, dict):
        raise ConfigError(f"{path}: must hold keys such as 'pixel:', got {tree}")
    return tree


# ---- The configuration written out as YAML, plain or with unit and meaning of each key.


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
    lines = (line for line, _ in _lines(type(config), config, "", "", {}))
    return "".join(f"{line}\n" for line in lines if not line.lstrip().startswith("#"))


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
    section: type[Section], values: Section | None, indent: str, path: str, forms: Mapping[str, str]
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


def _note(key: Key) -> str:
    unit = f"[{key.about.unit}] " if key.about.unit not in ("", "-") else ""
    note = f"{unit}{key.about.meaning}"
    if key.about.choices and not all(choice in note for choice in key.about.choices):
        note += f" ({' | '.join(key.about.choices)})"
    return note

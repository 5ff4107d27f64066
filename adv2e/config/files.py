"""Finding and reading configuration files; those that are shipped go by their name."""

from __future__ import annotations

import difflib
import re
from itertools import takewhile
from pathlib import Path

from adv2e.config.yaml12 import Origin, Value, parse
from adv2e.errors import ConfigError
from adv2e.files.regular import read_text_bytes


def shipped_folder() -> Path:
    """Return the folder of the shipped configurations.

    Inside the package where it was installed; beside it in a source checkout.
    """
    package = Path(__file__).resolve().parents[1]
    inside = package / "configs"
    return inside if inside.is_dir() else package.parent / "configs"


def shipped() -> list[str]:
    """Return the names of the shipped configurations, sorted."""
    return sorted(path.stem for path in shipped_folder().glob("*.yaml"))


def title(name: str) -> str:
    """Return what a shipped configuration says of itself first, in one sentence."""
    text = (shipped_folder() / f"{name}.yaml").read_text("utf-8")
    comment = takewhile(lambda line: line.startswith("#"), text.splitlines())
    told = re.sub(r"\s*\([^)]*\)", "", " ".join(line.lstrip("# ") for line in comment))
    # a sentence, without the authors that follow a colon
    return re.split(r"\.\s|:\s(?=[A-Z]\.)", told, maxsplit=1)[0]


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
    near = difflib.get_close_matches(path.name.lower(), shipped(), n=1)
    hint = f", did you mean '{near[0]}'?" if near else ""
    raise ConfigError(
        f"{name}: no such file or shipped configuration{hint} (shipped: {', '.join(shipped())})"
    )


def read(name: str | Path) -> Value:
    """Return the tree of the configuration file or shipped configuration `name`.

    Raises
    ------
    ConfigError
        The file is missing, cannot be read, is not YAML, or is not a mapping of keys.
    """
    path = find(name)
    try:
        text = read_text_bytes(path, ConfigError).decode("utf-8-sig")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: byte {error.start} is not UTF-8 text") from None
    tree = parse(text, Origin(str(path)))
    if tree.content is None:  # nothing but comments
        return Value({}, tree.origin)
    if not isinstance(tree.content, dict):
        raise ConfigError(f"{path}: must hold keys such as 'pixel:', got {tree}")
    return tree

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
        raise ConfigError(f"{name}: no camera that is shipped, must be {' or '.join(cameras)}")
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

"""Configuration: YAML files and ``--set`` values to frozen dataclasses, strictly."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import TYPE_CHECKING, Any

from adv2e.config.build import Key, all_keys, build, keys_of
from adv2e.config.files import read, shipped
from adv2e.config.merge import merge, parse_set
from adv2e.config.model import Config
from adv2e.config.text import to_annotated_yaml, to_dict, to_yaml
from adv2e.config.user_effects import config_class
from adv2e.config.yaml12 import Origin, Value, key_text
from adv2e.files.names import shown

if TYPE_CHECKING:
    from adv2e.effects.hooks import Hooks

__all__ = [
    "Config",
    "Key",
    "all_keys",
    "from_dict",
    "keys_of",
    "load_config",
    "names_of",
    "shipped",
    "to_annotated_yaml",
    "to_dict",
    "to_yaml",
    "written_keys",
]


def load_config(
    files: Sequence[str | Path] = (),
    sets: Sequence[str] = (),
    seed: int | None = None,
    effects: Sequence[type[Hooks]] = (),
) -> Config:
    """Return the defaults with `files`, then `sets`, then `seed` on top; later ones win.

    Parameters
    ----------
    files : sequence of str or Path
        YAML files or names of shipped configurations (:func:`shipped`).
    sets : sequence of str
        Single values, as in ``pixel.low_pass.cutoff_hz=100``.
    seed : int, optional
        Seed of all random numbers.
    effects : sequence of classes, optional
        Effects of your own (:class:`adv2e.effects.hooks.Hooks`); each is on, and has a section
        ``user.<name>``.

    Raises
    ------
    ConfigError
        A file is missing or wrong; the text names file, line, key and what would be right.
    UsageError
        One of `sets` is wrong.
    """
    return build(config_class(effects), _merged(files, sets, seed))


def _merged(files: Sequence[str | Path], sets: Sequence[str], seed: int | None = None) -> Value:
    """Return what `files`, `sets` and `seed` say, later ones on top."""
    over = [parse_set(text) for text in sets]  # what is wrong on the command line comes first
    if seed is not None:
        origin = Origin("--seed", on_command_line=True)
        over.append(Value({"seed": Value(seed, origin)}, origin))
    return reduce(merge, [*map(read, files), *over], Value({}))


def names_of(files: Sequence[str | Path] = (), sets: Sequence[str] = ()) -> str:
    """Return what a configuration was made from, for people: names without folders, and keys."""
    return shown(", ".join([*(Path(name).name for name in files), *sets]))


def written_keys(files: Sequence[str | Path] = (), sets: Sequence[str] = ()) -> dict[str, Any]:
    """Return the keys that `files` and `sets` write, by path, with what they say; no lists.

    A section without keys is one itself.

    Raises
    ------
    ConfigError, UsageError
        As :func:`load_config`.
    """
    return dict(_scalars(_merged(files, sets), ""))


def _scalars(tree: Value, path: str) -> Iterator[tuple[str, Any]]:
    if isinstance(tree.content, dict) and tree.content:
        for key, value in tree.content.items():
            yield from _scalars(value, f"{path}.{key}" if path else key)
    elif not isinstance(tree.content, list):
        yield path, tree.content


def from_dict(
    values: Mapping[str, Any], name: str = "", effects: Sequence[type[Hooks]] = ()
) -> Config:
    """Return the configuration that :func:`to_dict` gave `values` for, as strictly as a file.

    `effects`: see :func:`load_config`.

    Raises
    ------
    ConfigError
        As for a file; the text begins with `name`.
    """
    return build(config_class(effects), _tree(values, Origin(name)))


def _name(key: Any) -> str:
    return key_text(key if isinstance(key, bool) else str(key))


def _tree(values: Any, origin: Origin) -> Value:
    if isinstance(values, Mapping):
        content = {_name(key): _tree(item, origin) for key, item in values.items()}
        if len(content) < len(values):
            raise origin.complaint("", "two keys have the same name: true is on, false is off")
        return Value(content, origin)
    if isinstance(values, (list, tuple)):
        return Value([_tree(item, origin) for item in values], origin)
    return Value(values, origin)

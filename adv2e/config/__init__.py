"""Configuration: YAML files and ``--set`` values to frozen dataclasses, strictly."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from adv2e.config.build import Key, all_keys, build, keys_of
from adv2e.config.distributions import Distributions, Number, replaced
from adv2e.config.files import find, read, shipped, to_annotated_yaml, to_dict, to_yaml
from adv2e.config.model import Config
from adv2e.config.tree import form_text, merge, parse_set
from adv2e.config.user_effects import config_class, user_effects
from adv2e.config.yaml12 import Origin, Value, key_text
from adv2e.errors import ConfigError, UsageError
from adv2e.files.regular import shown
from adv2e.geometry import parse_size

if TYPE_CHECKING:
    from adv2e.effects.hooks import Hooks

__all__ = [
    "Config",
    "Family",
    "Key",
    "all_keys",
    "files_among",
    "from_dict",
    "keys_of",
    "load_config",
    "load_family",
    "names_of",
    "shipped",
    "to_annotated_yaml",
    "to_dict",
    "to_yaml",
    "written_keys",
]


Written: TypeAlias = "str | Path | Mapping[str, Any] | Config"
"""Source of a configuration: YAML file, name of a shipped one, mapping of keys, or a Config."""


def load_config(
    files: Written | Sequence[Written] | None = (),
    sets: str | Sequence[str] = (),
    seed: int | None = None,
    effects: Sequence[type[Hooks]] = (),
    *,
    size: tuple[int, int] | None = None,
) -> Config:
    """Return the defaults with `files`, `sets`, and `seed` and `size` on top; later ones win.

    Parameters
    ----------
    files : str, Path, mapping, Config, or a sequence of them, optional
        YAML files, names of shipped configurations (``adv2e config list``), mappings of the same
        keys, and configurations, which say all keys.
    sets : str or sequence of str
        Single values, as in ``pixel.low_pass.cutoff_hz=100``.
    seed : int, optional
        Seed of all random numbers.
    effects : sequence of classes, optional
        Effects of your own (:class:`adv2e.effects.hooks.Hooks`); each is on, and has a section
        ``user.<name>``.  Those of a configuration among `files` come before them.
    size : (int, int), or str as "346x260", optional
        Width and height of the sensor.

    Raises
    ------
    ConfigError
        A file is missing or wrong; the text names file, line, key and what would be right.
    UsageError
        One of `sets` is wrong, or `size` is none.

    Examples
    --------
    >>> from adv2e import load_config
    >>> config = load_config("davis346")
    >>> quiet = load_config(config, "pixel.shot_noise=null")
    >>> quiet.pixel.shot_noise is None
    True
    >>> load_config({"pixel": {"thresholds": {"on": 0.3}}}).pixel.thresholds.on
    0.3
    """
    return build(*_written(files, sets, seed, effects, size))


def load_family(
    files: Written | Sequence[Written] | None = (),
    sets: str | Sequence[str] = (),
    seed: int | None = None,
    effects: Sequence[type[Hooks]] = (),
) -> Family:
    """Return a family of configurations, as :func:`load_config`, with distributions as numbers.

    Raises
    ------
    ConfigError, UsageError
        As :func:`load_config`; or a distribution is wrong.
    """
    return Family(*_written(files, sets, seed, effects, None))


def _written(
    files: Written | Sequence[Written] | None,
    sets: str | Sequence[str],
    seed: int | None,
    effects: Sequence[type[Hooks]],
    size: tuple[int, int] | None,
) -> tuple[type[Config], Value]:
    layers = _listed(files)
    configs = (layer for layer in layers if isinstance(layer, Config))
    own = {effect: None for config in configs for effect in user_effects(config).values()}
    added = [effect for effect in effects if effect not in own]
    return config_class((*own, *added)), _merged(layers, _texts(sets), seed, size)


class Family:
    """A configuration for every seed, with numbers that are drawn from it.

    Attributes
    ----------
    config : Config
        That of the seed that is written.
    forms : dict of str
        The distributions, as they were written, by the path of the key.

    Raises
    ------
    ConfigError, UsageError
        A distribution is wrong, or what is drawn cannot be.
    """

    def __init__(self, section: type[Config], tree: Value) -> None:
        self._section, self._tree = section, tree
        self._distributions = Distributions(section, tree)
        self.forms = {path: form_text(form) for path, form in self._distributions.forms.items()}
        self.config = build(section, self._filled(0)[0])

    def of(self, seed: int) -> tuple[Config, dict[str, Number]]:
        """Return the configuration of a seed, and what was drawn, by the path of the key.

        Raises
        ------
        ConfigError, UsageError
            What was drawn cannot be.
        """
        tree, numbers = self._filled(seed)
        return build(self._section, merge(tree, _tree({"seed": seed}, Origin("--seed")))), numbers

    def written(self) -> dict[str, Any]:
        whole = replaced(_tree(to_dict(self.config), Origin()), self._distributions.forms)
        plain: dict[str, Any] = _plain(whole)
        return plain

    def _filled(self, seed: int) -> tuple[Value, dict[str, Number]]:
        numbers = self._distributions.draw(seed)
        forms = self._distributions.forms
        values = {path: Value(number, forms[path].origin) for path, number in numbers.items()}
        return replaced(self._tree, values), numbers


def _plain(value: Value) -> Any:
    if isinstance(value.content, dict):
        return {key: _plain(item) for key, item in value.content.items()}
    if isinstance(value.content, list):
        return [_plain(item) for item in value.content]
    return value.content


def _texts(sets: str | Sequence[str]) -> Sequence[str]:
    return [sets] if isinstance(sets, str) else sets


def _listed(files: Written | Sequence[Written] | None) -> Sequence[Written]:
    if files is None:
        return ()
    if isinstance(files, Sequence) and not isinstance(files, str):
        return files
    return [files]


def files_among(files: Written | Sequence[Written] | None) -> list[Path]:
    """Return the files that :func:`load_config` reads for `files`."""
    return [find(one) for one in _listed(files) if isinstance(one, (str, Path))]


def _layer(written: Written) -> Value:
    """Return the tree of what says a configuration.

    Raises
    ------
    ConfigError
        As :func:`adv2e.config.files.read`, or it is something else.
    """
    if isinstance(written, Config):
        return _tree(to_dict(written), Origin())
    if isinstance(written, Mapping):
        return _tree(written, Origin())
    if isinstance(written, (str, Path)):
        return read(written)
    raise ConfigError(
        "a configuration is a file, the name of a shipped one, a mapping or a Config, got"
        f" {type(written).__name__}"
    )


def _merged(
    files: Sequence[Written],
    sets: Sequence[str],
    seed: int | None = None,
    size: tuple[int, int] | None = None,
) -> Value:
    over = [parse_set(text) for text in sets]  # what is wrong on the command line comes first
    if seed is not None:
        over.append(_tree({"seed": seed}, Origin("--seed", on_command_line=True)))
    if size is not None:
        try:
            sensor = parse_size(size)._asdict()
        except ValueError as error:
            raise UsageError(f"size: {error}") from None
        over.append(_tree({"sensor": sensor}, Origin("--size", on_command_line=True)))
    return reduce(merge, [*map(_layer, files), *over], Value({}))


def names_of(files: Written | Sequence[Written] | None = (), sets: str | Sequence[str] = ()) -> str:
    """Return the sources of a configuration, for people: names without folders, and keys."""
    names = (
        Path(one).name if isinstance(one, (str, Path)) else f"a {type(one).__name__}"
        for one in _listed(files)
    )
    return shown(", ".join([*names, *_texts(sets)]))


def written_keys(
    files: Written | Sequence[Written] | None = (), sets: str | Sequence[str] = ()
) -> dict[str, Any]:
    """Return the keys that `files` and `sets` write, by path, with what they say; no lists.

    A section without keys is one itself.

    Raises
    ------
    ConfigError, UsageError
        As :func:`load_config`.
    """
    return dict(_scalars(_merged(_listed(files), _texts(sets)), ""))


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
    return build(config_class(tuple(effects)), _tree(values, Origin(name)))


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

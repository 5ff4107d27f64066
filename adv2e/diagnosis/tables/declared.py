"""The declared model: a configuration, and which of its keys were written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from adv2e.config import Config, load_config, names_of, written_keys


@dataclass(frozen=True)
class Declared:
    """What is known of the camera.

    Attributes
    ----------
    name : str
        Names of the files, for reports.
    config : Config
        The written keys on top of the defaults.
    written : mapping of str to value
        The keys that were written, by path; they are held.
    """

    name: str
    config: Config
    written: Mapping[str, Any]

    def switched_off(self, section: str) -> bool:
        """Tell whether it was written that an effect is not there."""
        return section in self.written and self.written[section] is None

    def held(self, path: str, neutral: float | None) -> float | None:
        """Return the number written for a key; `neutral` where none is, or its section is off.

        Defaults of this program are no knowledge of a camera, so that a key which is not written
        stands for the effect being absent.
        """
        value = self.written.get(path)
        return neutral if value is None else float(value)

    def value(self, fitted: Mapping[str, float], path: str, neutral: float | None) -> float | None:
        """Return what was fitted for a key, else what is :meth:`held`."""
        return fitted[path] if path in fitted else self.held(path, neutral)


def read_declared(
    files: Sequence[str | Path] = (), sets: Sequence[str] = (), seed: int | None = None
) -> Declared:
    """Return the declared model of configuration files and ``--set`` values.

    Raises
    ------
    ConfigError, UsageError
        As :func:`adv2e.config.load_config`.
    """
    config = load_config(files, sets, seed)
    return Declared(names_of(files, sets) or "nothing", config, written_keys(files, sets))

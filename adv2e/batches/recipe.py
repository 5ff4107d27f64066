"""Recipe of a batch, ``recipe.json``: what its set needs to be made again, byte for byte.

============ ====================================================================================
key          meaning
============ ====================================================================================
adv2e        version; no other makes the same files
versions     of packages, which files name
config, seed the configuration, with distributions as such, and the seed of the batch
options      of :class:`adv2e.options.BatchOptions`, those that were given
settings     SHA-256 of all of these and of effects and networks of the user's own
sequences    by name: SHA-256 of ``source``, ``output``, files beside it, and ``export``
============ ====================================================================================
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from adv2e import __version__
from adv2e.batches.plan import Wanted
from adv2e.batches.sequences import Sequence as Found
from adv2e.errors import DataError, UsageError
from adv2e.files.regular import read_text_bytes, shown
from adv2e.files.staging import Staging, writing
from adv2e.files.states import digest_of
from adv2e.options import BatchOptions, Run, declared

NAME = "recipe.json"

_OF_A_RUN = {"jobs", "shard", "scheduler", "overwrite", "recipe", *declared(Run)}
"""Options that change nothing of what is made."""


@dataclass(frozen=True)
class Recipe:
    """See the keys above."""

    adv2e: str
    versions: dict[str, Any]
    config: dict[str, Any]
    seed: int
    options: dict[str, Any]
    settings: str
    sequences: dict[str, dict[str, str]]

    @classmethod
    def read(cls, path: Path) -> Recipe:
        """Read a recipe; DataError if it is none, or of another version."""
        try:
            recipe = cls(**json.loads(read_text_bytes(path, DataError)))
            mappings = (recipe.versions, recipe.config, recipe.options, recipe.sequences)
            if not all(isinstance(one, dict) for one in (*mappings, *mappings[3].values())):
                raise TypeError
        except OSError as error:
            raise DataError(f"{path}: cannot be read: {error.strerror}") from None
        except (ValueError, TypeError, RecursionError):
            raise DataError(f"{path}: is no recipe of a batch") from None
        if recipe.adv2e != __version__:
            made = f"made by adv2e {recipe.adv2e}, and no other makes the same files"
            raise DataError(f"{path}: {made}: this is {__version__}")
        return recipe

    def asked(self, path: Path, given: Mapping[str, Any], others: bool) -> dict[str, Any]:
        """Return the options of the batch; UsageError if `given` ones or `others` say more."""
        known = declared(BatchOptions)
        more = [name for name in known if given[name] != known[name].default]
        for name in (name for name in more if name not in _OF_A_RUN):
            raise UsageError(f"--recipe {path} says all: leave out {known[name].flag_of(name)}")
        if others:
            raise UsageError(f"--recipe {path} says all: leave out --config, --set and --seed")
        if strange := [name for name in self.options if name not in known]:
            raise DataError(f"{path}: options.{strange[0]}: is no option of a batch")
        told = {
            name: known[name].checked(name, tuple(value) if isinstance(value, list) else value)
            for name, value in self.options.items()
        }
        return {**given, **told, "recipe": None}

    def chosen(self, sequences: Sequence[Found]) -> list[Found]:
        """Return the sequences of the recipe; DataError if one is missing or another one."""
        found = {one.name: one for one in sequences}
        if missing := [name for name in self.sequences if name not in found]:
            more = f", and {len(missing) - 1:,} more" if len(missing) > 1 else ""
            raise DataError(f"{shown(missing[0])}: is not there, and the recipe needs it{more}")
        for name, told in self.sequences.items():
            if digest_of(found[name].source) != told.get("source"):
                raise DataError(f"{found[name].source}: is not the source that the recipe names")
        return [one for one in sequences if one.name in self.sequences]

    def complaint(self, record: Mapping[str, Any], wanted: Wanted) -> str:
        """Return how what was made of a sequence differs from the recipe, or ""."""
        made, told = _digests(record, wanted), self.sequences[record["name"]]
        if wrong := [name for name in told if made.get(name) != told[name]]:
            here = _versions()
            apart = [
                f"{k} {v}, here {here.get(k)}" for k, v in self.versions.items() if here.get(k) != v
            ]
            why = f": it was made with {'; '.join(apart)}" if apart else ""
            return f"its {' and '.join(wrong)} is not that of the recipe{why}"
        return ""


def _versions() -> dict[str, Any]:
    from adv2e.conversion.pipeline import versions  # noqa: PLC0415 - numba takes its time

    return versions(("av", "deflate", "h5py"))


def _digests(record: Mapping[str, Any], wanted: Wanted) -> dict[str, str]:
    """Return the digests of source and output of a sequence, and of its export."""
    found = {"source": record["source_sha256"], "output": record["sha256"]}
    found |= record.get("beside", {})
    if wanted.export is not None and "export" in record:
        found["export"] = record["export"]["sha256"]
        if wanted.export.kind == "e2vid":  # its lists name DEST
            place = wanted.dest / wanted.export.place(record["name"]) / "sequences"
            found["export"] = digest_of(place)
    return found


def write_recipe(
    wanted: Wanted,
    config: dict[str, Any],
    options: Mapping[str, Any],
    records: Mapping[str, Mapping[str, Any]],
    is_ours: Callable[[str], bool],
) -> None:
    """Write the recipe of what is done in DEST, of all shards."""
    known = declared(BatchOptions)
    told = {
        name: str(value) if isinstance(value, Fraction) else value
        for name, value in options.items()
        # the size is in the configuration
        if name not in {*_OF_A_RUN, "size"} and value != known[name].default
    }
    done = {
        name: _digests(record, wanted)
        for name, record in sorted(records.items())
        if is_ours(name) and record["status"] == "done" and record["settings"] == wanted.settings
        if "export_error" not in record
    }
    recipe = Recipe(*(__version__, _versions(), config, wanted.seed, told, wanted.settings, done))
    text = json.dumps(asdict(recipe), indent=1, sort_keys=True, ensure_ascii=True) + "\n"
    with Staging(overwrite=True) as staging, writing(wanted.dest):
        place = staging.file(wanted.dest / NAME)
        staging.prepare()
        place.write_text(text, "ascii", newline="\n")

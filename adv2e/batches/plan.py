"""Decide per sequence: convert, re-export or keep (by manifest and digests)."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from adv2e import __version__
from adv2e.batches.sequences import Sequence as Found
from adv2e.batches.work import Export, side_of
from adv2e.errors import UsageError
from adv2e.files.states import State, digest_of


@dataclass(frozen=True)
class Task:
    """Task for one sequence: convert, re-export or keep, with the reason.

    Attributes
    ----------
    state : State
        Of its source.
    why : str
        Why something is made; empty: all is kept.
    record : mapping, optional
        What the manifest says of its file of events, which is kept and only exported.
    """

    sequence: Found
    state: State
    output: Path
    seed: int
    why: str
    record: Mapping[str, Any] | None = None

    @property
    def only_export(self) -> bool:
        """True if the file of events is kept, and only exported."""
        return self.record is not None


@dataclass(frozen=True)
class Wanted:
    """Settings that all files of a batch share: folder, suffix, seed, digest, export.

    Attributes
    ----------
    suffix : str
        Of the files; empty: folders.
    seed : int
        From which those of the sequences come.
    settings : str
        Digest of the configuration and all options, less the seed.
    export : Export, optional
        What is made of the events.
    """

    dest: Path
    suffix: str
    seed: int
    settings: str
    export: Export | None = None

    def output(self, sequence: Found) -> Path:
        """Return the file of a sequence: the tree below DEST is that below SOURCE."""
        return self.dest / (sequence.name + self.suffix)

    def export_folder(self, sequence: Found) -> Path | None:
        """Return the folder for the export of a sequence; None without an export."""
        if self.export is None:
            return None
        return self.dest / self.export.place(sequence.name)


def seed_of(seed: int, name: str) -> int:
    """Return the seed of a sequence, 0..2^48 - 1: from that of the batch and its name alone."""
    digest = hashlib.sha256(f"{seed}\n{name}".encode("utf-8", "surrogateescape")).digest()
    return int.from_bytes(digest[:6], "big")


def parse_shard(text: str) -> tuple[int, int]:
    """Return (I, N) of ``I/N``, I from 1 to N; raise UsageError."""
    number, slash, count = text.partition("/")
    if slash and number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count):
        return int(number), int(count)
    raise UsageError(f"--shard {text}: must be I/N with I from 1 to N, such as 2/8")


def shard_of(states: Mapping[str, State], number: int, count: int) -> set[str]:
    """Return the names of a shard: the largest first, each to the shard with the fewest bytes."""
    held = [0] * count
    mine = set()
    for name in sorted(states, key=lambda one: (-states[one].bytes, one)):
        least = min(range(count), key=lambda k: (held[k], k))
        held[least] += max(1, states[name].bytes)
        if least == number - 1:
            mine.add(name)
    return mine


def plan(
    sequences: Iterable[Found],
    states: Mapping[str, State],
    records: Mapping[str, Mapping[str, Any]],
    wanted: Wanted,
    *,
    overwrite: bool = False,
) -> list[Task]:
    """Return a task for each sequence; files that may be kept are read for their digests."""
    tasks = []
    for sequence in sequences:
        seed = seed_of(wanted.seed, sequence.name)
        output, state = wanted.output(sequence), states[sequence.name]
        record = records.get(sequence.name)
        why = "all are made anew" if overwrite else _why(record, state, sequence, output, wanted)
        kept = None
        if record is not None and not why:
            why = _why_export(record, sequence, wanted)
            kept = record if why else None
        tasks.append(Task(sequence, state, output, seed, why, kept))
    return tasks


def _why(
    record: Mapping[str, Any] | None, state: State, sequence: Found, output: Path, wanted: Wanted
) -> str:
    if record is None:
        return "new"
    if record["status"] != "done":
        return "it failed" if record["status"] == "failed" else "it was not finished"
    if record["adv2e"] != __version__:
        return f"made by adv2e {record['adv2e']}"
    if record["seed"] != seed_of(wanted.seed, sequence.name):
        return "the seed changed"
    if record["settings"] != wanted.settings:
        return "the configuration or an option changed"
    if record["output"] != output.relative_to(wanted.dest).as_posix():
        return "it goes to another file"
    if record["source"] != asdict(state) and digest_of(sequence.source) != record["source_sha256"]:
        return "its source changed"
    if record.get("side") != side_of(sequence.source):
        return "its side data changed"
    if not output.exists():
        return "its file is gone"
    if digest_of(output) != record["sha256"]:
        return "its file changed"
    for name, was in record.get("beside", {}).items():
        path = output.parent / name
        if not path.exists() or digest_of(path) != was:
            return "a file beside its own changed"
    return ""


def _why_export(record: Mapping[str, Any], sequence: Found, wanted: Wanted) -> str:
    folder = wanted.export_folder(sequence)
    if wanted.export is None or folder is None:
        return ""
    made = record.get("export")
    if made is None:
        return "to be exported"
    if any(made.get(key) != value for key, value in wanted.export.described().items()):
        return "an option of the export changed"
    if not folder.exists():
        return "its export is gone"
    return "" if digest_of(folder) == made.get("sha256") else "its export changed"


def outputs(tasks: Iterable[Task], wanted: Wanted) -> Iterator[tuple[str, Path]]:
    """Yield the names of sequences and the outputs that are to be made of them."""
    for one in tasks:
        if one.why:
            made = one.output, wanted.export_folder(one.sequence)
            yield from ((one.sequence.name, path) for path in made if path is not None)

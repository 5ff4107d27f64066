"""Commands of ``adv2e`` in this process, and a short form of what they make."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

MOST = 100
"""Leaves of one key that are kept each; of more, a digest of each child is."""

VERSIONS = {"adv2e", "versions"}
"""Keys of the versions of programs, which change where nothing moved."""

Holds = dict[str, Any]
"""Content of a case: numbers, texts and digests, by the path of their key."""


def sha(*parts: bytes) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.hexdigest()


def run(folder: Path, *words: str) -> tuple[int, str, str]:
    """Run ``adv2e`` in a folder; return its exit status, standard output and standard error."""
    from adv2e.cli import main  # noqa: PLC0415

    out, err, before = io.StringIO(), io.StringIO(), Path.cwd()
    os.chdir(folder)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main(list(words))
    except SystemExit as end:
        return int(end.code or 0), out.getvalue(), err.getvalue()
    finally:
        os.chdir(before)
    raise RuntimeError("a command ends with SystemExit")


def done(folder: Path, *words: str) -> None:
    """Run ``adv2e``, which must not fail."""
    status, _, err = run(folder, *words)
    if status:
        raise RuntimeError(err.strip())


def unversioned(value: Any) -> Any:
    """Return what JSON can hold, without the versions of programs."""
    if isinstance(value, list):
        return [unversioned(child) for child in value]
    if isinstance(value, dict):
        return {key: unversioned(child) for key, child in value.items() if key not in VERSIONS}
    return value


def short(found: Mapping[str, Any]) -> Holds:
    """Return the leaves of what JSON can hold, rounded to six digits; no versions of programs."""
    flat: Holds = {}
    for key, value in unversioned(found).items():
        leaves = dict(_leaves(value, key))
        if len(leaves) > MOST:
            leaves = {
                f"{key}.{name}": sha(json.dumps(dict(_leaves(child, ""))).encode())[:16]
                for name, child in _children(value).items()
            }
        flat |= leaves
    return flat


def _children(value: Any) -> Mapping[str, Any]:
    """Return the children of a node; of a list with names of its own, by these."""
    if isinstance(value, dict):
        return value
    names = [child.get("name") if isinstance(child, dict) else None for child in value]
    named = None not in names and len(set(names)) == len(names)
    return dict(zip(map(str, names if named else range(len(value))), value, strict=True))


def _leaves(value: Any, path: str) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict | list) and value:
        for name, child in _children(value).items():
            yield from _leaves(child, f"{path}.{name}")
    else:  # a p-value below 1e-12 is none
        yield path, float(f"{round(value, 12):.6g}") if isinstance(value, float) else value

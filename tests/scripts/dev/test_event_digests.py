"""The script that compares the events of two commits."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from click.testing import CliRunner
from dev import event_digests


def test_a_case_is_written_and_compared(tmp_path: Path) -> None:
    results = [tmp_path / "a.json", tmp_path / "b.json"]
    for path in results:
        words = ["--out", str(path), "--keep", "--only", "clip odd size*"]
        assert CliRunner().invoke(event_digests.main, words).exit_code == 0
    words = ["--compare", *map(str, results)]
    same = CliRunner().invoke(event_digests.main, words)
    assert (same.exit_code, same.output) == (0, "no differences\n")

    name = "clip odd size, noiseless"
    kept = event_digests.kept(results[1], name)
    events = np.load(kept)["events"]
    events["t"][3] += 7
    np.savez(kept, events=events[:-1])
    found = json.loads(results[1].read_text())
    count = found[name]["events"]
    found[name] |= {"digest": "other", "events": count - 1}
    results[1].write_text(json.dumps(found))
    other = CliRunner().invoke(event_digests.main, words)
    assert other.exit_code == 1
    assert f"{count - 1} the same, 1 of them at other times, at most 7 us apart" in other.output


def test_what_a_commit_lacks_is_told(tmp_path: Path) -> None:
    def run(threads: int, folder: Path) -> tuple[np.ndarray, str]:
        raise ValueError("no such key")

    about, events = event_digests.one("case", run)
    assert about == {"error": "ValueError: no such key"}
    assert not events.size


def test_a_result_that_depends_on_threads_is_told() -> None:
    def run(threads: int, folder: Path) -> tuple[np.ndarray, str]:
        return np.zeros(1, [("p", "u1")]), f"digest of {threads}"

    about, _ = event_digests.one("case", run)
    assert about["two_threads"] == "digest of 2"

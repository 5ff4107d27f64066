"""The benchmark of the first use: the first conversion has an empty cache, the next one that."""

from __future__ import annotations

from pathlib import Path

from benchmarks import first_use, measure
from click.testing import CliRunner


def test_each_round_begins_with_an_empty_cache_which_the_second_conversion_finds(
    tmp_path, monkeypatch
):
    found = []

    def run(job):
        cache = Path(job.options["environment"]["NUMBA_CACHE_DIR"])
        found.append((job.name, cache.exists()))
        cache.mkdir(exist_ok=True)
        wall = 1.0 if found[-1][1] else 60.0
        return measure.Round({"wall_s": wall, "cpu_s": wall}, wall, None)

    monkeypatch.setattr(first_use, "run_job", run)
    words = ["--rounds", "2", "--clips", str(tmp_path)]
    done = CliRunner().invoke(first_use.main, words)
    assert done.exit_code == 0, done.output
    assert found == [("first, empty cache", False), ("second", True)] * 2
    assert "| first, empty cache | 60.0 | 60.0 |" in done.output
    assert "| second | 1.00 | 1.00 |" in done.output

"""The benchmark of the first use: all configurations share a cache that is empty in each round."""

from __future__ import annotations

from pathlib import Path

import pytest
from benchmarks import first_use, measure
from click.testing import CliRunner

from adv2e.config import shipped


@pytest.fixture
def report_of(tmp_path, monkeypatch):
    """Run the script, on processes that take longer without a cache; return report and jobs."""
    found = []

    def run(job):
        cache = Path(job.options["environment"]["NUMBA_CACHE_DIR"])
        wall = 1.0 if cache.exists() else 60.0
        cache.mkdir(exist_ok=True)
        found.append((job.name, wall, job.options["command"]))
        return measure.Round({"wall_s": wall, "cpu_s": 2 * wall}, wall, None)

    monkeypatch.setattr(first_use, "run_job", run)

    def report(*words):
        done = CliRunner().invoke(first_use.main, [*words, "--clips", str(tmp_path)])
        assert done.exit_code == 0, done.output
        return done.output, found

    return report


def test_each_round_begins_with_an_empty_cache_which_all_that_follow_find(report_of):
    text, found = report_of("--rounds", "2", "--config", "ideal", "--config", "davis346")
    order = ["ideal: first", "davis346: first", "ideal: second", "davis346: second"]
    assert [(name, wall) for name, wall, _ in found] == 2 * list(
        zip(order, (60, 1, 1, 1), strict=True)
    )
    assert "| ideal | 60.0 | 120 | 1.00 | 2.00 | - | - |" in text
    assert "| davis346 | 1.00 | 2.00 | 1.00 | 2.00 | - | - |" in text


def test_every_shipped_configuration_is_used_the_default_first(report_of):
    _, found = report_of("--rounds", "1", "--threads", "2")
    names = [name.removesuffix(": first") for name, _, _ in found if name.endswith(": first")]
    assert names[0] == "adv2e"
    assert sorted(names) == shipped()
    by_name = {name: command for name, _, command in found}
    assert "convert" in by_name["paper: second"]
    drawn = by_name["train-v2e: first"]  # a conversion alone refuses its distributions
    assert "batch" in drawn
    assert drawn[-2:] == ["--threads", "2"]

"""scripts/dev/compare_commits.py takes packages out of git and says whether events are the same."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from benchmarks import measure
from dev import compare_commits as script


@pytest.fixture
def repository(tmp_path):
    """A repository with two commits of the package."""
    folder = tmp_path / "repository"
    for part in ("adv2e", "configs"):
        (folder / part).mkdir(parents=True)
        (folder / part / "file.txt").write_text("before")

    def git(*arguments):
        identity = ["-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false"]
        subprocess.run(["git", "-C", str(folder), *identity, *arguments], check=True)

    git("init", "--quiet")
    git("add", ".")
    git("commit", "--quiet", "-m", "before")
    (folder / "adv2e" / "file.txt").write_text("after")
    git("commit", "--quiet", "-a", "-m", "after")
    return folder


def test_each_commit_is_taken_out_and_git_keeps_no_trace(repository, tmp_path):
    before = script.checked_out("HEAD~1", tmp_path / "before", repository)
    after = script.checked_out("HEAD", tmp_path / "after", repository)
    assert (before / "adv2e" / "file.txt").read_text() == "before"
    assert (after / "adv2e" / "file.txt").read_text() == "after"
    listed = subprocess.run(
        ["git", "-C", str(repository), "worktree", "list"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert len(listed.stdout.splitlines()) == 1
    assert script.checked_out(".", tmp_path / "unused", repository) == repository


def test_jobs_run_their_own_package_wherever_one_stands(tmp_path, monkeypatch):
    for name in ("here", "before", "after"):
        (tmp_path / name / "adv2e").mkdir(parents=True)
        code = f"def tell(spec):\n    return {{'package': {name!r}}}\n"
        (tmp_path / name / "adv2e" / "__init__.py").write_text(code)
    monkeypatch.chdir(tmp_path / "here")
    job = script.Job(name="any", action="adv2e:tell")
    for name in ("before", "after"):
        own = replace(job, package=str(tmp_path / name))
        assert measure.run_job(own).report["package"] == name


def test_unknown_commit_is_told_in_one_line(repository, tmp_path):
    with pytest.raises(script.JobError, match=r"^nonsense: fatal: not a valid object name.*$"):
        script.checked_out("nonsense", tmp_path / "nowhere", repository)


def test_other_events_are_shouted():
    def found(name, package, wall, digest):
        job = script.Job(name=name, package=package)
        report = {"wall_s": wall, "cpu_s": wall, "events": 7, "digest": digest, "versions": {}}
        return script.Measured(job, [measure.Round(report, wall, 0.0)])

    every = [
        found("same", "a", 1.0, "x"),
        found("same", "b", 0.5, "x"),
        found("other", "a", 1.0, "x"),
        found("other", "b", 2.0, "y"),
        found("only before", "a", 1.0, "x"),
    ]
    rows = script.report(every, "old", "new").splitlines()[-2:]
    assert rows[0].split("|")[1:-1] == [
        f" {cell} " for cell in ("same", "1.00", "0.50", "0.50", "0.50", "identical")
    ]
    assert "DIFFERENT: 7 / 7" in rows[1]


def test_settings_that_do_not_exist_are_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(measure, "stored", lambda clip, folder: folder)
    plan = script.Plan(tmp_path, True, 1)
    with pytest.raises(script.JobError, match="no setting has such a name"):
        script.pairs_of_jobs(plan, ["nothing"], [tmp_path])
    jobs = script.pairs_of_jobs(plan, script.USUAL, [tmp_path / "a", tmp_path / "b"])
    assert [Path(job.package).name for job in jobs] == ["a", "b", "a", "b"]
    assert len({job.name for job in jobs}) == 2

"""The study of the diagnosis: what is done, resumed and written."""

import json
import subprocess
import zipfile

import numpy as np
import pytest
from camera.catalogue import LIBRARY
from click.testing import CliRunner
from studies import cases, results, scoring
from studies import diagnosis as study
from studies import run as study_run
from study_lines import SETUP, line_of


def test_lines_come_back_and_what_was_cut_off_does_not(tmp_path):
    file = tmp_path / "new" / "1-of-1.jsonl"
    results.append(file, line_of(repeat=0))
    with file.open("a") as stream:
        stream.write('{"key": "cut of')
    results.append(file, line_of(repeat=1))
    results.append(file.with_name("2-of-2.jsonl"), line_of(repeat=2))
    keys = [line["key"] for line in results.read(file.parent)]
    assert keys == [f"library/refractory/middle/{k}" for k in range(3)]


def test_success_counts_over_failure_and_failures_are_done_again():
    good, bad = line_of(), {**line_of(), "failed": "DataError: no"}
    other = {**line_of(repeat=1), "failed": "DataError: no"}
    assert results.latest([bad, good, bad, other]) == [good, other]
    assert results.finished([bad, good, other]) == {results.identity(good)}
    assert results.finished([other]) == set()


@pytest.mark.parametrize(
    "change", [{"commit": "def"}, {"study_seed": 1}, {"setup": {**SETUP, "fps": 250.0}}]
)
def test_another_commit_seed_or_setup_is_other_work(change):
    assert results.identity({**line_of(), **change}) != results.identity(line_of())


def test_changes_that_are_not_committed_are_other_work_each(tmp_path, monkeypatch):
    def git(*arguments):
        identity = ["-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false"]
        subprocess.run(["git", "-C", str(tmp_path), *identity, *arguments], check=True)

    monkeypatch.setattr(study_run, "REPOSITORY", tmp_path)
    inside, beside = tmp_path / "adv2e" / "fit.py", tmp_path / "README.md"
    inside.parent.mkdir()
    inside.write_text("a = 1\n")
    git("init", "--quiet")
    git("add", "-A")
    git("commit", "--quiet", "-m", "first")
    found = [study_run.commit()]
    beside.write_text("not studied")
    assert study_run.commit() == found[0]
    for text in ("a = 2\n", "a = 3\n"):
        inside.write_text(text)
        found.append(study_run.commit())
    inside.with_name("new.py").write_text("b = 1\n")
    found.append(study_run.commit())
    inside.with_name("new.py").write_text("b = 2\n")
    found.append(study_run.commit())
    assert len(set(found)) == 5
    assert all(one.startswith(f"{found[0]}-dirty-") for one in found[1:])


@pytest.fixture
def quick_run(monkeypatch, tmp_path):
    """Run the command with a made-up diagnosis; return the keys of what it went through."""
    seen = []

    def diagnosed(case, setup, study_seed, threads, log):
        seen.append(case.key)
        return {**line_of(setup=vars(setup)), "key": case.key, "study_seed": study_seed}

    monkeypatch.setattr(study_run, "diagnosed", diagnosed)
    monkeypatch.setattr(study_run, "commit", lambda: "abc")

    def run(*arguments):
        seen.clear()
        command = ["run", str(tmp_path), "--kinds", "library", *arguments]
        result = CliRunner().invoke(study.main, command)
        return list(seen) if result.exit_code == 0 else result.output

    return run


def test_a_stopped_study_goes_on_where_it_was(quick_run, monkeypatch):
    first = quick_run("--sizes", "middle", "--most", "5")
    rest = quick_run("--sizes", "middle")
    assert len(first) == 5
    assert len({*first, *rest}) == len(first) + len(rest) == len(LIBRARY)
    assert quick_run("--sizes", "middle") == []
    monkeypatch.setattr(study_run, "commit", lambda: "def")
    assert quick_run("--sizes", "middle", "--most", "1") == first[:1]


def test_shards_of_a_run_never_do_the_same(quick_run):
    done = [quick_run("--shard", f"{number}/4") for number in (1, 2, 3, 4)]
    assert sorted(len(part) for part in done) == sorted([21, 21, 21, 21])
    assert len(set().union(*done)) == 3 * len(LIBRARY)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--shard", "5/4"], "I from 1 to N"),
        (["--sizes", "huge"], "small, middle, large"),
        (["--only", "leek"], "no such effect"),
        (["--size", "48"], "as 48x36"),
    ],
)
def test_wrong_options_are_named(quick_run, arguments, said):
    assert said in quick_run(*arguments)


def test_frames_and_interpolation_are_declared_as_the_setup_says():
    case = cases.Case("library", ("leak",), "middle", 0)
    plain = study_run.Setup(8, 8, 0.1, 50.0).camera_for(case, 0)
    ordinary = study_run.Setup(8, 8, 0.1, 50.0, 8, "flow").camera_for(case, 0)
    assert plain.declared == study_run.settings.BENCH
    assert ordinary.declared["frames"] == {**plain.declared["frames"], "full_scale": 255}
    assert ordinary.declared["sampling"] == {"interpolation": "flow", "L": 8, "K": 10}
    assert ordinary.truth["pixel"]["leak"]["rate_hz"] == 2.0
    kinds = [next(iter(camera.frames())).image.dtype for camera in (plain, ordinary)]
    assert [str(kind) for kind in kinds] == ["uint16", "uint8"]


def test_what_goes_wrong_is_part_of_the_line(monkeypatch):
    def broken(path):
        raise ValueError("no such thing")

    monkeypatch.setattr(study_run, "read_evidence", broken)
    case = cases.Case("library", ("leak",), "middle", 0)
    setup = study_run.Setup(8, 8, 0.1, 50.0)
    line = study_run.diagnosed(case, setup, 0, 1, lambda text: None)
    assert line["failed"].startswith("ValueError: no such thing (test_study_run.py:")
    assert line["hidden"] == {"pixel.leak.rate_hz": 2.0}
    assert scoring.outcome(line) == "failed"
    json.dumps(line)


@pytest.mark.thorough
def test_a_recording_is_kept_as_the_study_makes_it(tmp_path):
    path = tmp_path / "new" / "echo.zip"
    options = ["--seed", "2", "--size", "16x12", "--seconds", "0.1", "--effect-size", "large"]
    outcome = CliRunner().invoke(study.main, ["record", str(path), "echo", *options])
    assert outcome.exit_code == 0, outcome.output
    case = cases.Case("outside", ("echo",), "large", 0)
    assert outcome.output == f"{path}: {case.key}, scene {case.scene(2)}\n"
    same = tmp_path / "same.zip"
    study_run.Setup(width=16, height=12, seconds=0.1).camera_for(case, 2).record(same)
    for kind in (".declared.yaml", ".truth.yaml"):
        assert path.with_suffix(kind).read_text() == same.with_suffix(kind).read_text()
    one, other = zipfile.ZipFile(path), zipfile.ZipFile(same)
    assert one.namelist() == other.namelist()
    assert all(one.read(name) == other.read(name) for name in one.namelist())


@pytest.mark.parametrize(
    ("name", "effects", "message"),
    [
        ("a.h5", [], "must end with .zip"),
        ("a.zip", ["ecco"], "'ecco': none of"),
        ("a.zip", ["leak", "flicker", "echo"], "two at most"),
        ("there.zip", ["leak"], "there.zip: is there already"),
        ("mine.zip", ["leak"], "mine.declared.yaml: is there already"),
    ],
)
def test_a_recording_that_cannot_be_kept_is_told(name, effects, message, tmp_path):
    held = [tmp_path / "mine.declared.yaml", tmp_path / "there.zip"]
    for one in held:
        one.write_bytes(b"mine")
    outcome = CliRunner().invoke(study.main, ["record", str(tmp_path / name), *effects])
    assert outcome.exit_code != 0
    assert message in outcome.output
    assert sorted(tmp_path.iterdir()) == held
    assert all(one.read_bytes() == b"mine" for one in held)


@pytest.mark.thorough
def test_of_a_known_light_the_table_is_what_the_pixels_saw_by_its_clock(tmp_path):
    setup = study_run.Setup(8, 8, 0.5, known_light=True)
    path = tmp_path / "one.zip"
    for name, late_us in (("leak", 0), ("clock_offset", 1500)):
        case = cases.Case("library", (name,), "middle", 0)
        setup.camera_for(case, 0).record(path)
        rows = study_run.stimulus.bench(0.5, case.seed(0))
        evidence = setup.read(path, case, 0)
        leaps = sorted({time for time, _ in rows if [one[0] for one in rows].count(time) == 2})
        told = evidence.stimulus.leaps.times_us[0]
        assert told == pytest.approx(1e6 * np.array(leaps) - late_us, abs=1.0)
        # most events come soon after the light has leapt, whenever that is said to be
        since = evidence.stimulus.leaps.since(evidence.stream)
        assert np.quantile(since[since >= 0], 0.05) == pytest.approx(100 + late_us, abs=150)


def test_effects_on_frames_are_not_studied_where_there_are_none(quick_run):
    done = quick_run("--sizes", "middle", "--known-light")
    assert len(done) == len(LIBRARY) - 6
    assert not any("exposure_blur" in key or "flicker" in key for key in done)

"""``adv2e diagnose``: options, exit status, and whole runs on a tiny recording."""

import dataclasses
import doctest
import json
import math
import re
import shutil
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from camera import Camera, patchwork
from camera.settings import BENCH
from processes import running_python

import adv2e as package
from adv2e import load_config, simulate
from adv2e.cli.options import Log
from adv2e.diagnosis import prepare
from adv2e.diagnosis import recordings as whole
from adv2e.diagnosis.fitting.library import names
from adv2e.diagnosis.outcome import verdict
from adv2e.diagnosis.selection import reference, shortlist
from adv2e.formats.writing import open_sink
from adv2e.geometry import Rectangle
from adv2e.process.signals import last_words, stopping_on_signals
from adv2e.reports import files, summary
from adv2e.reports.files import write_reports

FILES = ["model.yaml", "report.html", "report.json"]
TRIED = ("refractory", "leak", "event_loss")
WITHOUT = [part for name in names() if name not in TRIED for part in ("--without", name)]
SIZE, DEAD_US = (24, 16), 20_000.0
SUMMARY = ["two lines of", "  summary"]
REPORT = "report: a.diagnosis/report.html"


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Return a folder with a recording of a longer dead time, and one that is as declared."""
    folder = tmp_path_factory.mktemp("recordings")
    camera = Camera(
        patchwork(SIZE, seed=6), BENCH, hidden={"pixel": {"refractory": {"period_us": DEAD_US}}},
        size=SIZE, duration_s=0.3, fps=200.0, step_us=25.0,
    )  # fmt: skip
    camera.record(folder / "dead.zip")
    shutil.copy(folder / "dead.declared.yaml", folder / "none.declared.yaml")
    config = load_config(folder / "none.declared.yaml", "frames.encoding=linear", seed=123_456)
    frames = list(camera.frames())
    images, stamps = [one.image for one in frames], [one.stamp for one in frames]
    sizes = {"width": SIZE[0], "height": SIZE[1]}
    with open_sink(folder / "none.zip", **sizes, metadata={}, with_frames=True) as sink:
        for image, stamp in zip(images, stamps, strict=True):
            sink.write_frame(round(stamp * 1e9), image)
        for events in simulate(images, stamps, config):
            sink.write_events(events)
    return folder


@pytest.fixture
def short(monkeypatch):
    """Simulate less often than a diagnosis that is to be believed."""
    monkeypatch.setattr(whole, "SAY_EVERY_S", math.inf)  # what is told does not hang on the time
    monkeypatch.setattr(reference, "MANY", 40)
    for module in (reference, shortlist):
        monkeypatch.setattr(module, "SOME", 16)
    monkeypatch.setattr(prepare, "PILOT_SEEDS", range(10_000, 10_004))
    monkeypatch.setattr(verdict, "DRAWS", 4)


def found(adv2e, recordings, name, out, *options):
    status, stdout, err = adv2e(
        "diagnose", recordings / f"{name}.zip", "-c", recordings / f"{name}.declared.yaml",
        "-o", out, *WITHOUT, *options,
    )  # fmt: skip
    assert (status, stdout) == (0, "")
    assert sorted(path.name for path in out.iterdir()) == FILES
    return json.loads((out / "report.json").read_text("utf-8")), err


@pytest.fixture
def example(recordings, monkeypatch):
    """Run the example of ``adv2e.diagnose``, with few effects that compete; returns its names."""

    def run():
        (test,) = doctest.DocTestFinder(recurse=False).find(package.diagnose, "diagnose")
        assert not doctest.DocTestRunner().run(test, clear_globs=False).failed
        return test.globs

    usual = whole.diagnose_file
    few = {"without": [name for name in names() if name not in TRIED], "threads": 2}
    monkeypatch.setattr(whole, "diagnose_file", lambda *a, **kw: usual(*a, **{**kw, **few}))
    return run


def told(progress):
    """Return the stages that were shown, each once, and the numbers of simulations."""
    shown = re.findall(r"(\w[\w: ]*): (\d+) simulations in", progress)
    return list(dict.fromkeys(stage for stage, _ in shown)), [int(count) for _, count in shown]


@pytest.mark.thorough
def test_a_missing_effect_is_named_by_the_command_and_in_python_whatever_the_threads(
    adv2e, recordings, short, example, tmp_path, monkeypatch
):
    shutil.copy(recordings / "dead.zip", tmp_path / "recording.zip")
    shutil.copy(recordings / "dead.declared.yaml", tmp_path / "declared.yaml")
    monkeypatch.chdir(tmp_path)
    given = ("recording.zip", "-c", "declared.yaml", "-o", "by_command", *WITHOUT)
    outcome = adv2e("diagnose", *given, "--threads", 1, "--progress")
    assert (outcome.status, outcome.out) == (0, "")
    in_python = example()
    assert in_python["dead_time"] == pytest.approx(DEAD_US, rel=0.05)
    write_reports(in_python["found"], "in_python")

    reports = []
    for folder in ("by_command", "in_python"):
        assert sorted(path.name for path in Path(folder).iterdir()) == FILES
        reports.append(json.loads(Path(folder, "report.json").read_text("utf-8")))
        assert reports[-1]["facts"].pop("time taken")
    assert json.dumps(reports[0]) == json.dumps(reports[1])
    model = Path("by_command/model.yaml").read_bytes()
    assert model == Path("in_python/model.yaml").read_bytes()

    made = reports[0]
    stages, counts = told(outcome.err)
    assert stages[:2] == ["reading the recording", "simulating the declared model"]
    assert stages[-2:] == ["judging on data not used so far", "finding what could have been seen"]
    assert "searching: fitting refractory" in stages[2:-2]
    assert "searching: trying 3 effects: event_loss" in stages[2:-2]
    assert all(stage.startswith("searching: ") for stage in stages[2:-2])
    assert counts == sorted(counts)
    assert 300 < counts[-1] <= int(made["facts"]["simulations"])  # the last are not shown
    assert re.match(r"Dead time: (19\.\d|20(\.\d)?) ms \(.*, declared 0\.5", made["sentence"])
    lines = summary.summary_text(in_python["found"]).splitlines()
    assert lines[0] == made["sentence"]
    lines.append(f"report: {Path('by_command/report.html')}")
    assert "\n".join([*lines, ""]) in outcome.err  # a bar of compiling may end after it
    assert made["verdict"] in ("explained", "partly_explained")
    (effect,) = made["effects"]
    assert effect["name"] == "refractory"
    key = "pixel.refractory.period_us"
    assert effect["parameters"][key] == pytest.approx(DEAD_US, rel=0.05)
    low, high = effect["interval"][key]
    assert low < effect["parameters"][key] < high
    error = made["error"]
    assert error["held_out"] is True
    assert error["after"] < 0.6 * error["before"]
    assert error["after"] < 1.3 * error["floor"]
    assert made["global_p"]["before"] < 1e-6 < made["global_p"]["after"]
    assert {one["name"] for one in made["rejected"]} <= set(TRIED) - {"refractory"}
    model = load_config(["by_command/model.yaml"])
    assert model.pixel.refractory.period_us == pytest.approx(effect["parameters"][key], rel=1e-3)
    declared = load_config([recordings / "dead.declared.yaml"])
    held = dataclasses.replace(model.pixel, refractory=declared.pixel.refractory)
    assert held == declared.pixel


@pytest.mark.thorough
def test_what_is_known_is_kept_at_each_stage_and_by_an_interruption(
    adv2e, recordings, short, tmp_path, monkeypatch
):
    out, beside = tmp_path / "out", tmp_path / "out.unfinished"
    given = (recordings / "dead.zip", "-c", recordings / "dead.declared.yaml", "-o", out)
    stop_at, seen, write = {"number": 99}, [], files.write_reports

    def watched(diagnosis, folder, **options):
        write(diagnosis, folder, **options)
        seen.append(json.loads((Path(folder) / "report.json").read_text("utf-8")))
        if len(seen) == stop_at["number"]:
            raise KeyboardInterrupt

    monkeypatch.setattr(files, "write_reports", watched)
    assert adv2e("diagnose", *given, *WITHOUT).status == 0
    declared, compared, added, judged = seen
    assert not any(one["complete"] for one in seen)
    assert {one["verdict"] for one in seen} == {"unfinished"}
    assert declared["signatures"] == []
    assert len(compared["signatures"]) > 200
    assert compared["effects"] == []
    assert [one["name"] for one in added["effects"]] == ["refractory"]
    assert (added["error"]["before"], judged["error"]["held_out"]) == (None, True)
    assert added["global_p"]["before"] < 1e-6 < added["global_p"]["after"]
    assert sorted(path.name for path in out.iterdir()) == FILES
    whole = (out / "report.json").read_bytes()
    assert json.loads(whole)["complete"] is True

    seen.clear()
    stop_at["number"] = 3
    outcome = adv2e("diagnose", *given, *WITHOUT, "--overwrite")
    assert outcome.status == 130
    ends = f"adv2e: interrupted; what was known by then: {beside / 'report.html'}"
    assert outcome.err.splitlines()[-1] == ends
    assert (out / "report.json").read_bytes() == whole
    with pytest.raises(KeyboardInterrupt), stopping_on_signals():
        assert last_words(KeyboardInterrupt()) == "interrupted"  # of another run
        raise KeyboardInterrupt
    left = json.loads((beside / "report.json").read_text("utf-8"))
    assert (left, left["complete"]) == (seen[-1], False)
    assert left["effects"] == added["effects"]
    page = (beside / "report.html").read_text("utf-8")
    assert "Not finished, still searching for what is missing. So far: dead time" in page
    model = load_config([beside / "model.yaml"])
    assert model.pixel.refractory.period_us == pytest.approx(DEAD_US, rel=0.05)

    (tmp_path / "broken.py").write_text(BROKEN, "utf-8")
    seen.clear()
    broken = adv2e("diagnose", *given, *WITHOUT, "--overwrite", "--effect", tmp_path / "broken.py")
    assert (broken.status, len(seen)) == (1, 2)
    assert (out / "report.json").read_bytes() == whole
    assert not beside.exists()


INTERRUPTED = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
from adv2e.cli import main
main(sys.argv[1:])
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT to a process there")
def test_an_interruption_of_the_process_leaves_a_report(recordings, tmp_path):
    out = tmp_path / "out"
    given = recordings / "dead.zip", "-c", recordings / "dead.declared.yaml", "-o", out, *WITHOUT
    with running_python(INTERRUPTED, "diagnose", *given) as process:
        while not (out / "report.json").exists():
            assert process.poll() is None
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate()
    assert process.returncode == 130
    ends = f"adv2e: interrupted; what was known by then: {out / 'report.html'}"
    assert err.decode().splitlines()[-1] == ends
    assert sorted(path.name for path in out.iterdir()) == FILES
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert json.loads((out / "report.json").read_text("utf-8"))["complete"] is False


def test_something_is_said_though_no_simulation_ends(adv2e, made_up, monkeypatch):
    def waits(*_, progress, **options):
        progress("searching: trying 2 effects: leak", 7)
        until = time.monotonic() + 60.0
        while len(said) < 2 and time.monotonic() < until:
            time.sleep(0.005)

    said, echo = [], Log.__call__
    monkeypatch.setattr(
        Log, "__call__", lambda log, text, *of: (said.append(text), echo(log, text, *of))
    )
    monkeypatch.setattr(whole, "SAY_EVERY_S", 0.02)
    monkeypatch.setattr(whole, "diagnose_evidence", waits)
    assert adv2e("diagnose", "a.zip").status == 0
    assert [text for text in said if text.startswith("searching: trying 2 effects: leak: 7 sim")]


def test_a_camera_as_declared_is_consistent(adv2e, recordings, short, tmp_path):
    made, err = found(adv2e, recordings, "none", tmp_path / "out")
    assert made["verdict"] == "consistent"
    assert err.startswith("Nothing is missing that these data show: the error of the")
    assert "consistent: The recording is what the declared model makes" in err
    assert (made["effects"], made["alternatives"], made["nuisances"]) == ([], [], {})
    assert made["error"]["before"] == made["error"]["after"]
    assert made["global_p"]["before"] == made["global_p"]["after"] > 0.01
    z = np.array([one["z_after"] for one in made["signatures"]], float)
    assert len(z) > 200
    assert np.sqrt(np.mean(z**2)) < 2.0
    model = load_config([tmp_path / "out" / "model.yaml"])
    assert model == load_config([recordings / "none.declared.yaml"])


BROKEN = """
from dataclasses import dataclass

from adv2e.effects.hooks import Hooks
from adv2e.parameters import Fit, Section, parameter


@dataclass(frozen=True, kw_only=True)
class BrokenParameters(Section):
    "Raises."

    share: float = parameter(0.1, unit="-", meaning="share", at_least=0, fit=Fit(0.0, 0.5, 0.1))


class Broken(Hooks):
    "Raises."

    stage = "readout"
    Parameters = BrokenParameters

    def events(self, chunks):
        for events in chunks:
            yield events[: len(events) // 0]
"""


@pytest.mark.thorough
def test_an_own_effect_that_raises_is_named_with_its_line(adv2e, recordings, short, tmp_path):
    effect, out = tmp_path / "broken.py", tmp_path / "out"
    effect.write_text(BROKEN, "utf-8")
    status, _, err = adv2e(
        "diagnose", recordings / "dead.zip", "-c", recordings / "dead.declared.yaml", "-o", out,
        *WITHOUT, "--effect", effect,
    )  # fmt: skip
    assert status == 1
    line = 1 + BROKEN.splitlines().index("            yield events[: len(events) // 0]")
    assert err.splitlines()[-1].startswith("adv2e: error: ")
    assert f"broken.py:{line}: effect broken: ZeroDivisionError: " in err
    assert not out.exists()


def test_an_effect_that_does_not_exist(adv2e, tmp_path):
    status, out, err = adv2e("diagnose", tmp_path / "a.zip", "--without", "refractry")
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert "--without refractry: no such effect, did you mean 'refractory'?" in err


def test_an_effect_like_no_other(adv2e, tmp_path):
    status, _, err = adv2e("diagnose", tmp_path / "a.zip", "--without", "xyzzy")
    assert status == 2
    assert "one of thresholds, " in err


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["a.zip", "b.zip"],
        ["a.zip", "--threads", "0"],
        ["a.zip", "--set", "pixel.lek=null"],
        ["a.zip", "--without"],
        ["a.zip", "--nonsense"],
    ],
)
def test_a_wrong_command_line(adv2e, arguments):
    status, out, err = adv2e("diagnose", *arguments)
    assert (status, out) == (2, "")
    assert err.count("\n") == 1


def test_a_wrong_configuration(adv2e, tmp_path):
    (tmp_path / "declared.yaml").write_text("pixel: {thresholds: {on: -1}}\n")
    status, _, err = adv2e("diagnose", "a.zip", "-c", tmp_path / "declared.yaml")
    assert status == 1
    assert "pixel.thresholds.on" in err
    assert err.count("\n") == 1


def test_an_existing_folder_is_found_before_anything_is_read(adv2e, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "report.json").write_text("{}")
    arguments = ["diagnose", tmp_path / "nowhere.zip", "-o", tmp_path / "out"]
    status, _, err = adv2e(*arguments)
    assert status == 1
    assert f"{tmp_path / 'out'}: exists already; --overwrite replaces it" in err
    status, _, err = adv2e(*arguments, "--overwrite")
    assert status == 1
    assert "nowhere.zip: no such file" in err
    assert (tmp_path / "out" / "report.json").read_text() == "{}"


def test_other_things_are_never_replaced(adv2e, tmp_path):
    (tmp_path / "thesis.txt").touch()
    status, _, err = adv2e("diagnose", "a.zip", "-o", tmp_path, "--overwrite")
    assert status == 1
    assert "thesis.txt" in err
    assert (tmp_path / "thesis.txt").exists()


def test_the_help_names_the_options(adv2e):
    status, out, _ = adv2e("diagnose", "--help")
    assert status == 0
    for option in ("--without", "--config", "--overwrite", "--threads", "--output", "--seed"):
        assert option in out


@pytest.fixture
def made_up(monkeypatch, tmp_path):
    """Stand in for reading and diagnosing; returns the calls, and what there was to tell."""
    calls = []

    def read(path, sensor, rotate180, track, **_):
        assert sensor is None or (sensor.width, sensor.height) == (346, 260)
        return (path, "turned", track) if rotate180 else path

    def part(recording, *given):
        return recording if given == (None, None, None) else (recording, given)

    def write(found, folder, *, overwrite):
        calls.append(folder)

    def diagnose(recording, config, *, progress, log, **options):
        calls.append({"recording": recording, "config": config, **options})
        log("a step")
        steps = ("simulating", 0), ("simulating", 3), ("searching", 3), ("judging", 10)
        for step in steps:
            progress(*step)

    monkeypatch.setattr(whole, "read_evidence", read)
    monkeypatch.setattr(whole, "part_of", part)
    monkeypatch.setattr(whole, "diagnose_evidence", diagnose)
    monkeypatch.setattr(whole, "write_reports", write)
    monkeypatch.setattr(summary, "summary_text", lambda found: "\n".join(SUMMARY))
    monkeypatch.chdir(tmp_path)
    return calls


def test_options_arrive(adv2e, made_up, tmp_path):
    (tmp_path / "mine.yaml").write_text("pixel: {leak: null}\n")
    outcome = adv2e(
        "diagnose", "a.zip", "-c", "davis346", "-c", "mine.yaml", "--threads", 3, "--seed", 4,
        "--without", "flicker", "--without", "leak", "--set", "pixel.refractory.period_us=7",
        "--rotate180", "--topic", "/dvs/events", "--start", 1, "--crop", "2,3,9,8",
    )  # fmt: skip
    assert outcome.status == 0
    call, folder = made_up
    part = (1.0, None, Rectangle(2, 3, 9, 8))
    read = ("a.zip", "turned", "/dvs/events")
    assert (call["recording"], call["threads"]) == ((read, part), 3)
    assert call["without"] == ("flicker", "leak")
    assert call["declared_name"] == "davis346, mine.yaml, pixel.refractory.period_us=7"
    assert call["config"].pixel.leak is None
    assert call["config"].pixel.refractory.period_us == 7.0
    assert call["config"].seed == 4
    assert str(folder) == "a.diagnosis"
    assert call["written"]["pixel.refractory.period_us"] == 7
    assert outcome.err.endswith("two lines of\n  summary\nreport: a.diagnosis/report.html\n")


TWICE = """
from adv2e.effects.hooks import Hooks
class Twice(Hooks):
    def events(self, chunks):
        yield from chunks
"""


@pytest.mark.parametrize(
    ("options", "held"),
    [
        ((), False),
        (("--set", "user.twice={}"), True),
        (("-c", "mine.yaml"), True),
        (("--without", "twice"), False),
    ],
)
def test_effects_of_the_users_own_are_candidates_unless_they_are_declared(
    adv2e, made_up, options, held
):
    Path("twice.py").write_text(TWICE)
    Path("mine.yaml").write_text("user: {twice: {}}")
    outcome = adv2e("diagnose", "a.zip", "--effect", "twice.py", *options)
    assert outcome.status == 0, outcome.err
    call, _ = made_up
    assert (call["config"].user.twice is not None) is held
    assert call["without"] == (("twice",) if "--without" in options else ())


@pytest.mark.parametrize(
    ("options", "name"), [((), "the defaults"), (("-c", "sub/mine.yaml"), "mine.yaml")]
)
def test_the_declared_model_has_a_name(adv2e, made_up, options, name):
    Path("sub").mkdir()
    Path("sub/mine.yaml").write_text("pixel: {leak: null}\n")
    assert adv2e("diagnose", "a.zip", *options).status == 0
    assert made_up[0]["declared_name"] == name


def test_own_effects_need_names_of_their_own(adv2e, made_up):
    Path("mine.py").write_text(TWICE.replace("Twice", "EventLoss"))
    status, _, err = adv2e("diagnose", "a.zip", "--effect", "mine.py")
    assert status == 2
    assert "--effect: event_loss: a built-in effect has that name; choose another" in err


@pytest.mark.parametrize(
    ("options", "lines"),
    [([], [*SUMMARY, REPORT]), (["-v"], ["a step", *SUMMARY, REPORT]), (["-q"], [])],
)
def test_what_is_said(adv2e, made_up, options, lines):
    outcome = adv2e("diagnose", "a.zip", *options)
    said = [line for line in outcome.err.splitlines() if not line.startswith("compiling")]
    assert (outcome.status, outcome.out, said) == (0, "", lines)


def test_progress_names_stages_and_counts_simulations_without_a_total(adv2e, made_up):
    outcome = adv2e("diagnose", "a.zip", "--progress", "-q")
    assert outcome.status == 0
    stages, counts = told(outcome.err)
    assert stages == ["reading the recording", "simulating", "searching", "judging"]
    assert counts[0] == 0
    assert counts == sorted(counts)
    assert "/" not in outcome.err
    assert "%" not in outcome.err

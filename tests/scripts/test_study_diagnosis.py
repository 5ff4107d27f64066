"""The study of the diagnosis: its order, its resuming, its scores and its tables."""

import json

import numpy as np
import pytest
import study_diagnosis as study
from camera.catalogue import LIBRARY, OUTSIDE
from click.testing import CliRunner
from study_diagnosis_parts import cases, figure, results, scoring, tables
from study_diagnosis_parts import run as study_run

SETUP = {
    "width": 48, "height": 36, "seconds": 0.8, "fps": 500.0, "bits": 16, "interpolation": "linear",
}  # fmt: skip


@pytest.fixture
def plan():
    def made(**options):
        wanted = {"kinds": cases.KINDS, "sizes": cases.SIZES, "library": LIBRARY}
        return cases.Plan(**{**wanted, **options})

    return made


def found(name, parameters=None, interval=None):
    return {"name": name, "parameters": parameters or {}, "interval": interval or {}}


def line_of(kind="library", effects=("refractory",), size="middle", verdict="explained", **rest):
    """Return a made-up line; by default the effects are found as they are."""
    return {
        "key": f"{kind}/{'+'.join(effects)}/{size}/{rest.pop('repeat', 0)}",
        "kind": kind, "effects": list(effects), "size": size, "study_seed": 0, "scene": "edges",
        "setup": SETUP, "hidden": {}, "commit": "abc", "lacking": [], "verdict": verdict,
        "found": [] if verdict in ("consistent", "unexplained") else [found(x) for x in effects],
        "alternatives": [], "truth": {}, "error": {"before": 0.9, "after": 0.5, "floor": 0.5},
        "global_p": {"before": 0.5, "after": 0.5}, "seconds": {"recording": 4.0, "diagnosis": 90.0},
        "simulations": 1000, "events": 9000, "threads": 2, "load": 1.0, "log": [], "ended": 1,
        **rest,
    }  # fmt: skip


# --- order ----------------------------------------------------------------------------------------


def test_the_middle_size_comes_first_and_kinds_in_turn(plan):
    made = plan().cases()
    first = made[:50]
    assert [case.kind for case in first[:5]] == list(cases.KINDS)
    assert {case.size for case in first} == {"middle", "none"}
    counts = [sum(case.kind == kind for case in first) for kind in cases.KINDS]
    assert counts == [10] * 5
    sizes = [case.size for case in made if case.kind == "library"]
    assert set(sizes[: len(LIBRARY)]) == {"middle"}
    assert abs(sizes[:60].count("small") - sizes[:60].count("large")) <= 1


def test_a_full_study_has_every_effect_in_every_size_once(plan):
    made = plan(nothing=100).cases()
    assert len({case.key for case in made}) == len(made)
    assert sum(case.kind == "nothing" for case in made) == 100
    for kind, names in (("library", LIBRARY), ("leave-one-out", LIBRARY), ("outside", OUTSIDE)):
        held = {(*case.effects, case.size) for case in made if case.kind == kind}
        assert held == {(name, size) for name in names for size in cases.SIZES}


def test_pairs_hold_every_effect_twice_and_never_one_thing_under_two_keys():
    made = cases.pairs(["leak", "photo_leak", "flicker", "readout"])
    assert made == [("photo_leak", "flicker"), ("flicker", "readout"), ("readout", "leak")]


def test_only_keeps_the_pairs_of_an_effect(plan):
    made = plan(kinds=("pairs",), sizes=("middle",), only=("flicker",)).cases()
    assert len(made) == 2
    assert all("flicker" in case.effects for case in made)


def test_shards_share_all_cases_out(plan):
    made = plan().cases()
    shares = [cases.shard(made, number, 7) for number in range(1, 8)]
    assert sorted(case.key for part in shares for case in part) == sorted(c.key for c in made)
    assert max(map(len, shares)) - min(map(len, shares)) <= 1


def test_scene_and_seed_follow_from_the_case_alone():
    one = cases.Case("library", ("leak",), "middle", 0)
    again = cases.Case("leave-one-out", ("leak",), "middle", 0)
    assert one.seed(0) == one.seed(0)
    assert len({one.seed(0), one.seed(1), again.seed(0)}) == 3
    many = [cases.Case("nothing", (), "none", k).scene(0) for k in range(60)]
    assert {many.count(name) > 8 for name in cases.SCENES} == {True}


def test_only_what_is_left_out_is_left_out():
    hidden = cases.Case("leave-one-out", ("leak",), "large", 0)
    assert hidden.without == ("leak",)
    assert hidden.hidden == {"pixel": {"leak": {"rate_hz": 6.0}}}
    pair = cases.Case("pairs", ("leak", "event_loss"), "middle", 0)
    assert pair.without == ()
    assert pair.hidden == {
        "pixel": {"leak": {"rate_hz": 2.0}},
        "readout": {"loss": {"fraction": 0.2}},
    }


# --- results --------------------------------------------------------------------------------------


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
    assert sorted(len(part) for part in done) == sorted([20, 20, 19, 19])
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
    assert line["failed"].startswith("ValueError: no such thing (test_study_diagnosis.py:")
    assert line["hidden"] == {"pixel.leak.rate_hz": 2.0}
    assert scoring.outcome(line) == "failed"
    json.dumps(line)


# --- scores ---------------------------------------------------------------------------------------


def outcome_of(effects, verdict, added, alternatives=(), kind="library"):
    line = line_of(kind, effects, verdict=verdict, alternatives=list(alternatives))
    return scoring.outcome({**line, "found": [found(name) for name in added]})


@pytest.mark.parametrize(
    ("verdict", "added", "alternatives", "outcome"),
    [
        ("explained", ["leak"], [], "named alone"),
        ("not_identifiable", ["leak"], ["photo_leak"], "among look-alikes"),
        ("not_identifiable", ["photo_leak"], ["leak"], "among look-alikes"),
        ("explained", ["photo_leak"], [], "wrong name"),
        ("not_identifiable", ["photo_leak"], ["shot_noise"], "wrong name"),
        ("explained", ["leak", "flicker"], [], "named beside a wrong name"),
        ("explained", ["flicker", "photo_leak"], ["leak"], "named beside a wrong name"),
        ("partly_explained", ["leak"], [], "named, something left"),
        ("partly_explained", ["flicker"], [], "wrong name, something left"),
        ("unexplained", [], [], "unexplained"),
        ("consistent", [], [], "missed"),
    ],
)
def test_outcomes_of_one_effect(verdict, added, alternatives, outcome):
    assert outcome_of(("leak",), verdict, added, alternatives) == outcome


@pytest.mark.parametrize(
    ("verdict", "added", "alternatives", "outcome"),
    [
        ("explained", ["leak", "flicker"], [], "both named"),
        ("partly_explained", ["flicker", "leak"], [], "both named"),
        ("not_identifiable", ["flicker", "photo_leak"], ["leak"], "both named"),
        ("explained", ["leak"], [], "one named"),
        ("explained", ["leak", "event_loss"], [], "named beside a wrong name"),
        ("explained", ["event_loss"], [], "wrong name"),
        ("consistent", [], [], "missed"),
    ],
)
def test_outcomes_of_two_effects(verdict, added, alternatives, outcome):
    effects = ("leak", "flicker")
    assert outcome_of(effects, verdict, added, alternatives, "pairs") == outcome


@pytest.mark.parametrize("kind", ["leave-one-out", "outside"])
@pytest.mark.parametrize(
    ("verdict", "added", "outcome"),
    [
        ("explained", ["shot_noise"], "wrong name"),
        ("partly_explained", ["shot_noise"], "wrong name, something left"),
        ("unexplained", [], "unexplained"),
        ("consistent", [], "missed"),
    ],
)
def test_no_name_is_right_where_the_library_lacks_it(kind, verdict, added, outcome):
    assert outcome_of(("leak",), verdict, added, kind=kind) == outcome


def test_any_verdict_but_consistent_is_a_false_alarm():
    verdicts = ("consistent", "unexplained", "partly_explained", "explained")
    seen = [outcome_of((), verdict, [], kind="nothing") for verdict in verdicts]
    assert seen == ["consistent", *["false alarm"] * 3]


def fitted(**values):
    interval = {"pixel.leak.rate_hz": [1.8, 1.9], "frames.shift_px": [[0.1, -0.7], [0.3, -0.5]]}
    truth = {"pixel.leak.rate_hz": 2.0, "frames.shift_px": [0.8, -0.6], "readout.tick_us": None}
    parameters = {"pixel.leak.rate_hz": 1.85, "readout.tick_us": 5.0, **values}
    line = line_of(effects=("leak",), truth=truth)
    return {**line, "found": [found("leak", parameters, interval), found("flicker", {"a": 9.0})]}


def test_parameters_are_compared_with_what_the_camera_did():
    line = fitted(**{"frames.shift_px": [0.8, -0.4]})
    errors = scoring.parameter_errors(line)
    assert errors == pytest.approx({"pixel.leak.rate_hz": 0.075, "frames.shift_px": 0.2})
    assert scoring.is_near(line) is False
    assert scoring.is_near(fitted()) is True
    assert scoring.is_near(line_of()) is None
    assert scoring.covered(line) == [False, False, True]


def test_gammas_are_compared_as_numbers():
    assert scoring.relative_error("gamma:1.2", "gamma:1.6") == pytest.approx(0.25)
    assert scoring.relative_error("gamma:1.2", "linear") is None


def test_intervals_of_shares():
    # Wilson's interval, by R: prop.test(3, 100, correct=FALSE)
    assert scoring.interval(3, 100) == pytest.approx((0.01025, 0.08452), abs=2e-5)
    assert scoring.interval(0, 0) == (0.0, 1.0)
    low, high = scoring.interval(50, 50)
    assert high == 1.0
    assert low == pytest.approx(50 / (50 + 1.96**2), abs=1e-3)


# --- tables ---------------------------------------------------------------------------------------


def made_up():
    quiet = [line_of("nothing", (), "none", "consistent", repeat=k) for k in range(48)]
    loud = line_of(
        "nothing", (), "none", "unexplained", repeat=48, global_p={"before": 1e-3, "after": 1e-3}
    )
    others = [name for name in LIBRARY if name not in ("leak", "flicker")]
    right = [line_of(effects=(name,)) for name in others[:18]]
    alike = line_of(
        effects=("leak",), verdict="not_identifiable", found=[found("photo_leak")],
        alternatives=["leak"],
    )  # fmt: skip
    wrong = line_of(
        effects=("flicker",), found=[found("shot_noise")], log=["  shot_noise: score 12"],
        hidden={"frames.flicker.depth": 0.15},
    )  # fmt: skip
    left_out = [
        line_of("leave-one-out", ("leak",), found=[found("photo_leak")]),
        line_of("leave-one-out", ("flicker",), verdict="unexplained"),
    ]
    outside = line_of("outside", ("echo",), found=[found("shot_noise")])
    pair = line_of("pairs", ("leak", "flicker"))
    return [*quiet, loud, *right, alike, wrong, *left_out, outside, pair]


def row(text, name):
    return next(line for line in text.splitlines() if line.startswith(f"| {name} |"))


def test_the_report_counts_what_happened():
    text = tables.report(made_up(), "abc")
    assert "19 of 20: 95.0%" in row(text, "named, or among look-alikes")
    assert "1 of 20: 5.0%" in row(text, "wrong name accepted")
    assert "19 of 19" in row(text, "named: held-out error at most 1.1 of its floor")
    assert "1 of 49: 2.0%" in row(text, "any verdict but consistent")
    assert "1 of 49: 2.0%" in row(text, "global test on the last part below 1%")
    assert "0 of 49" in row(text, "an effect named")
    left_out, outside = text.partition("left out of the library")[2].split("\n## ")[:2]
    assert "1 of 2: 50.0%" in left_out
    assert "the same thing under another key: 1" in left_out
    assert row(left_out, "wrong name") == "| wrong name | 1 | leak as photo_leak |"
    assert row(left_out, "unexplained") == "| unexplained | 1 | flicker |"
    assert row(outside, "wrong name") == "| wrong name | 1 | echo as shot_noise |"
    assert "| missed |" not in outside
    assert "| 49 of 100 |" in row(text, "nothing")
    assert f"20 of {len(LIBRARY)}" in row(text, "library")


def test_failures_come_with_what_competed():
    _, _, failures = tables.report(made_up(), "abc").partition("## What went wrong")
    assert "library/flicker/middle/0" in failures
    assert "frames.flicker.depth = 0.15" in failures
    assert "shot_noise: score 12" in failures
    assert "library/leak" not in failures
    assert "leave-one-out/flicker" not in failures


def test_the_confusion_matrix_shares_look_alikes():
    lines = [line for line in made_up() if line["kind"] == "library"]
    matrix = figure.confusion(lines)
    place = LIBRARY.index
    assert matrix[place("leak")][[place("leak"), place("photo_leak")]].tolist() == [0.5, 0.5]
    assert matrix[place("flicker"), place("shot_noise")] == 1.0
    assert matrix.sum() == pytest.approx(len(lines))
    missed = figure.confusion([line_of(effects=("readout",), verdict="consistent")])
    assert np.argwhere(missed).tolist() == [[place("readout"), len(LIBRARY) + 1]]


def test_report_writes_tables_and_figure_of_the_last_commit(tmp_path):
    pytest.importorskip("matplotlib")
    for line in made_up():
        results.append(tmp_path / "in" / "1-of-1.jsonl", line)
    newer = {**line_of(effects=("leak",)), "commit": "def", "ended": 2}
    results.append(tmp_path / "in" / "1-of-1.jsonl", newer)
    command = ["report", str(tmp_path / "in"), "-o", str(tmp_path / "out")]
    assert CliRunner().invoke(study.main, command).exit_code == 0
    text = (tmp_path / "out" / "diagnosis.md").read_text()
    assert "Commit def" in text
    assert "1 of 1" in row(text, "named, or among look-alikes")
    assert (tmp_path / "out" / "diagnosis.png").read_bytes().startswith(b"\x89PNG")
    older = CliRunner().invoke(study.main, [*command, "--commit", "abc"])
    assert "19 of 20" in older.output
    unknown = CliRunner().invoke(study.main, [*command, "--commit", "xyz"])
    assert "abc (73), def (1)" in unknown.output


def test_a_folder_without_results_is_an_error_that_says_so(tmp_path):
    command = ["report", str(tmp_path), "-o", str(tmp_path / "out")]
    result = CliRunner().invoke(study.main, command)
    assert result.exit_code == 1
    assert "'run' makes them" in result.output


def test_the_table_of_sizes_says_in_short_what_was_said():
    key = "pixel.refractory.period_us"
    near = {"found": [found("refractory", {key: 2100.0})], "truth": {key: 2000.0}}
    lines = [
        line_of(size="middle", **near),
        line_of(size="small", verdict="consistent"),
        line_of(size="large", verdict="partly_explained", alternatives=["slew_limit"], **near),
        line_of(effects=("black_level",), found=[found("dark_current")], size="large"),
        line_of(effects=("leak",), failed="ValueError: no (a.py:1)", size="small"),
        line_of(effects=("leak",), verdict="unexplained"),
        line_of(kind="leave-one-out", effects=("shot_noise",)),
    ]
    rows = [row.split("|")[1:-1] for row in tables.sizes_table(lines).splitlines()[2:]]
    assert {row[0].strip(): [cell.strip() for cell in row[1:]] for row in rows} == {
        "refractory": ["missed", "5.0 %", "(or slew_limit) 5.0 %, something left"],
        "leak": ["failed", "unexplained", ""],
        "black_level": ["", "", "dark_current"],
    }

"""Tables and figure of the study of the diagnosis."""

import numpy as np
import pytest
from camera.catalogue import LIBRARY
from click.testing import CliRunner
from studies import diagnosis as study
from studies import results, tables
from study_lines import found, line_of


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


def test_what_failed_is_no_part_of_a_rate_and_repeats_are_planned():
    failed = [
        {**line_of(kind, ("leak",), repeat=1), "failed": "DataError: no"}
        for kind in ("leave-one-out", "outside", "library")
    ]
    text = tables.report([*made_up(), *failed], "abc")
    left_out, outside = text.partition("left out of the library")[2].split("\n## ")[:2]
    assert "1 of 2: 50.0%" in left_out
    assert "1 of 1: 100.0%" in outside
    assert f"20 of {2 * len(LIBRARY)}" in row(text, "library")
    assert "| 49 of 100 |" in row(text, "nothing")


def test_failures_come_with_what_competed():
    _, _, failures = tables.report(made_up(), "abc").partition("## What went wrong")
    assert "library/flicker/middle/0" in failures
    assert "frames.flicker.depth = 0.15" in failures
    assert "shot_noise: score 12" in failures
    assert "library/leak" not in failures
    assert "leave-one-out/flicker" not in failures


def test_the_confusion_matrix_shares_look_alikes():
    lines = [line for line in made_up() if line["kind"] == "library"]
    matrix = tables.confusion(lines)
    place = LIBRARY.index
    assert matrix[place("leak")][[place("leak"), place("photo_leak")]].tolist() == [0.5, 0.5]
    assert matrix[place("flicker"), place("shot_noise")] == 1.0
    assert matrix.sum() == pytest.approx(len(lines))
    missed = tables.confusion([line_of(effects=("readout",), verdict="consistent")])
    assert np.argwhere(missed).tolist() == [[place("readout"), len(LIBRARY) + 1]]


def test_report_writes_tables_and_figure_of_the_last_commit(tmp_path):
    pytest.importorskip("matplotlib")
    for line in made_up():
        results.append(tmp_path / "in" / "1-of-1.jsonl", line)
    newer = {**line_of(effects=("leak",)), "commit": "def", "ended": 2}
    results.append(tmp_path / "in" / "1-of-1.jsonl", newer)
    command = ["report", str(tmp_path / "in"), "-o", str(tmp_path / "out" / "a.md")]
    assert CliRunner().invoke(study.main, command).exit_code == 0
    text = (tmp_path / "out" / "a.md").read_text()
    assert "Commit def" in text
    assert "1 of 1" in row(text, "named, or among look-alikes")
    assert (tmp_path / "out" / "a.png").read_bytes().startswith(b"\x89PNG")
    older = CliRunner().invoke(study.main, [*command, "--commit", "abc"])
    assert "19 of 20" in older.output
    unknown = CliRunner().invoke(study.main, [*command, "--commit", "xyz"])
    assert "abc (73), def (1)" in unknown.output


def test_a_folder_without_results_is_an_error_that_says_so(tmp_path):
    command = ["report", str(tmp_path), "-o", str(tmp_path / "out" / "a.md")]
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
    ]
    rows = [row.split("|")[1:-1] for row in tables.sizes_table(lines).splitlines()[2:]]
    assert {row[0].strip(): [cell.strip() for cell in row[1:]] for row in rows} == {
        "refractory": ["missed", "5.0 %", "(or slew_limit) 5.0 %, something left"],
        "leak": ["failed", "unexplained", ""],
        "black_level": ["", "", "dark_current"],
    }

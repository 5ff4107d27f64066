"""The script that compares what two commits make."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from dev import event_digests
from dev.digests.running import short


def compared(*words: str | Path) -> tuple[int, str]:
    done = CliRunner().invoke(event_digests.main, ["--compare", *map(str, words)])
    return done.exit_code, done.output


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
    assert events is None


def test_a_result_that_depends_on_threads_is_told() -> None:
    def run(threads: int, folder: Path) -> tuple[np.ndarray, str]:
        return np.zeros(1, [("p", "u1")]), f"digest of {threads}"

    about, _ = event_digests.one("case", run)
    assert about["two_threads"] == "digest of 2"


def report(error: float = 0.25, seventh: float = 7.0, version: str = "1.0") -> dict[str, object]:
    signatures = [{"name": f"number {n}", "measured": float(n), "unit": ""} for n in range(60)]
    signatures[7]["measured"] = seventh
    return {
        "verdict": "explained",
        "errors": [{"name": "distance", "before": {"value": error, "interval": [0.1, 0.4]}}],
        "signature_values": signatures,
        "facts": {"adv2e": version, "seed": "0"},
    }


RESULTS = {
    "plain": {"digest": "5fe", "events": 30, "on": 10, "off": 20},
    "info a.mp4": {"holds": short({"frames": {"count": 12, "rate_hz": 25.0}, "problems": []})},
    "info b.mp4": {"holds": {"status": 1, "stderr": "adv2e: error: b.mp4: cut short\n"}},
    "dataset voxel": {"holds": {"out/one/tensor.npy": "90ab", "out/one/times.txt": "17c4"}},
    "report nothing": {"holds": short(report())},
}


@pytest.mark.parametrize(
    ("name", "other", "told"),
    [
        ("plain", {"digest": "0", "events": 31, "on": 11, "off": 20},
         "30 (10 ON) -> 31 (11 ON); events not kept"),
        ("info a.mp4", short({"frames": {"count": 11, "rate_hz": 25.0}, "problems": ["gap"]}),
         "frames.count 12 -> 11; problems [] -> none; problems.0 none -> \"gap\""),
        ("info b.mp4", {"status": 1, "stderr": "adv2e: error: b.mp4: damaged\n"},
         r'stderr "adv2e: error: b.mp4: cut short\n" -> "adv2e: error: b.mp4: damaged\n"'),
        ("dataset voxel", {"out/one/tensor.npy": "77", "out/one/times.txt": "17c4"},
         'out/one/tensor.npy "90ab" -> "77"'),
        ("report nothing", short(report(error=0.2501)),
         "errors.distance.before.value 0.25 -> 0.2501"),
        ("report nothing", dict(sorted(short(report()).items())), "the same in another order"),
        ("info a.mp4", short({"frames": {"count": 12, "rate_hz": 25}, "problems": []}),
         "frames.rate_hz 25.0 -> 25"),
    ],
)  # fmt: skip
def test_a_changed_value_of_each_kind_is_told(
    tmp_path: Path, name: str, other: dict[str, object], told: str
) -> None:
    a, b = tmp_path / "a.json", tmp_path / "b.json"
    a.write_text(json.dumps(RESULTS))
    b.write_text(json.dumps(RESULTS | {name: other if "events" in other else {"holds": other}}))
    assert compared(a, b) == (1, f"{name}: {told}\n")
    kinds = {"plain": "info,datasets,reports"}.get(name, "events")
    assert compared(a, b, "--kinds", kinds) == (0, "no differences\n")


def test_one_of_many_numbers_is_told_by_its_name() -> None:
    x, y = short(report()), short(report(seventh=7.001))
    assert [key for key in x if x[key] != y[key]] == ["signature_values.number 7"]


def test_the_last_bit_and_the_version_do_not_matter() -> None:
    last = {"error": np.nextafter(0.25, 1), "seventh": np.nextafter(7.0, 0)}
    assert short(report(**last, version="2.0")) == short(report())


def test_cases_of_one_file_only_are_told(tmp_path: Path) -> None:
    a, b = tmp_path / "a.json", tmp_path / "b.json"
    a.write_text(json.dumps({"plain": RESULTS["plain"]}))  # as older ones are, of events alone
    b.write_text(json.dumps(RESULTS))
    status, said = compared(a, b)
    assert (status, said.count(f"only in {b}\n")) == (1, len(RESULTS) - 1)
    assert compared(a, b, "--kinds", "events") == (0, "no differences\n")


def test_what_is_told_of_inputs_is_the_same_again_and_anywhere(tmp_path: Path) -> None:
    results = [tmp_path / "a.json", tmp_path / "b.json"]
    for path in results:
        words = ["--out", str(path), "--kinds", "info", "--only", "info [b-d]*"]
        done = CliRunner().invoke(event_digests.main, words)
        assert done.exit_code == 0, done.output
    assert compared(*results) == (0, "no differences\n")
    found = json.loads(results[0].read_text())
    assert {"info bt709.mp4", "info case --fps 25", "info dsec.h5", "info cut.mkv"} <= {*found}
    assert found["info ddd17.h5"]["holds"]["events.count"] == 3000
    assert found["info cut.mkv"]["holds"]["stderr"].startswith("adv2e: error: cut.mkv: cut short")
    assert tempfile.gettempdir() not in json.dumps(found)

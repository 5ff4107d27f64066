"""``report.json`` keeps its contract."""

import json
import math
from dataclasses import replace

import pytest
from made_up_diagnosis import HOSTILE, everything, nothing, strange, unfinished

from adv2e.label import guessed, told_of
from adv2e.reports.files import record, record_text
from adv2e.reports.markup import OF_RECORDINGS, OF_TABLES

VERDICTS = ("consistent", "explained", "partly_explained", "not_identifiable", "unexplained")


def is_number(value):
    return value is None or (
        isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
    )


def is_value(value):
    return is_number(value) or isinstance(value, (str, bool)) or all(map(is_value, value))


def is_interval(value):
    return isinstance(value, list) and len(value) == 2 and all(map(is_number, value))


def check(report):
    """Hold `report` to the contract, key by key, in order."""
    keys = ["verdict", "effects", "alternatives", "nuisances", "rejected", "error", "global_p"]
    keys.append("signatures")
    assert list(report)[: len(keys)] == keys
    assert report["verdict"] in VERDICTS
    for effect in report["effects"]:
        assert list(effect) == ["name", "parameters", "interval"]
        assert isinstance(effect["name"], str)
        assert all(isinstance(path, str) for path in effect["parameters"])
        assert all(map(is_value, effect["parameters"].values()))
        assert set(effect["interval"]) <= set(effect["parameters"])
        assert all(map(is_interval, effect["interval"].values()))
    assert all(isinstance(name, str) for name in report["alternatives"])
    assert isinstance(report["nuisances"], dict)
    assert all(map(is_value, report["nuisances"].values()))
    for one in report["rejected"]:
        assert list(one) == ["name", "reason"]
        assert all(isinstance(text, str) for text in one.values())
    error = report["error"]
    assert list(error) == ["name", "before", "after", "floor", "held_out"]
    assert error["name"] is None or isinstance(error["name"], str)
    assert all(is_number(error[name]) for name in ("before", "after", "floor"))
    assert isinstance(error["held_out"], bool)
    assert list(report["global_p"]) == ["before", "after"]
    assert all(map(is_number, report["global_p"].values()))
    for one in report["signatures"]:
        assert list(one) == ["name", "z_before", "z_after"]
        assert isinstance(one["name"], str)
        assert is_number(one["z_before"])
        assert is_number(one["z_after"])


@pytest.mark.parametrize("wording", [OF_RECORDINGS, OF_TABLES])
@pytest.mark.parametrize("make", [everything, nothing, strange])
def test_the_record_keeps_the_contract(make, wording):
    def no_constant(name):
        raise AssertionError(f"{name} is no JSON")

    check(json.loads(record_text(replace(make(), wording=wording)), parse_constant=no_constant))


def test_the_record_says_what_was_found():
    report = json.loads(record_text(everything()))
    assert report["effects"][0] == {
        "name": "refractory",
        "parameters": {"pixel.refractory.period_us": 6012.34},
        "interval": {"pixel.refractory.period_us": [5503.0, 6498.0]},
    }
    assert report["error"]["before"] == 1.384
    assert report["error"]["after"] == 0.312
    assert report["error"]["floor"] == 0.27
    assert report["error"]["held_out"] is True
    assert report["global_p"] == {"before": 0.0002, "after": 0.34}
    assert report["nuisances"] == {"pixel.thresholds.on": 0.21, "frames.encoding": "linear"}
    assert report["complete"] is True
    assert report["signatures"][1] == {
        "name": "share below 1 ms",
        "z_before": -38.0,
        "z_after": None,
    }
    assert report["sentence"] == everything().sentence
    assert report["remark"] == everything().remark
    assert report["declared_values"]["pixel.refractory.period_us"] == 500.0
    assert [row["name"] for row in report["errors"]] == [row.name for row in everything().errors]
    assert report["errors"][1]["after"] == {"value": 121.0, "interval": [115.0, 127.0]}
    assert [one["size"] for one in report["detectable"]] == [740.0, 0.31, 0.052, None]
    assert report["masked"][1] == {"what": "hot pixels", "share": 0.0006}
    assert report["trials"][0]["held_out"] == 0.998
    assert report["recording"] == "office_zigzag.zip"
    table = record(replace(everything(), wording=OF_TABLES))
    assert table.pop("table") == report.pop("recording")
    assert table == report


def test_what_was_guessed_of_the_recording_is_its_label():
    line = told_of("a.txt", guessed("no unit is stated", "time unit", "us", "give --time-unit us"))
    label = record(replace(nothing(), notes=["other", line]))["label"]
    guess = {"what": "time unit", "value": "us", "why": "no unit is stated"}
    assert label == {"guessed": [guess], "left_out": []}
    assert record(replace(nothing(), notes=["other"]))["label"] is None


def test_an_empty_diagnosis_has_no_error():
    report = record(nothing())
    assert report["error"] == {
        "name": None, "before": None, "after": None, "floor": None, "held_out": False,
    }  # fmt: skip
    assert report["global_p"] == {"before": None, "after": None}


def test_what_is_known_so_far_is_no_verdict():
    report = record(unfinished())
    assert report["complete"] is False
    assert report["verdict"] not in VERDICTS
    assert report["sentence"].startswith(
        "Not finished, still searching: fitting leak. So far: dead"
    )
    assert report["error"]["held_out"] is False


def test_odd_numbers_are_null_and_odd_texts_survive():
    report = json.loads(record_text(strange()))
    assert report["error"] == {
        "name": HOSTILE, "before": 0.0, "after": None, "floor": None, "held_out": True,
    }  # fmt: skip
    assert report["effects"][0]["parameters"]["pixel.a_users_own.key"] == [0.12, 0.5]
    assert report["effects"][1]["interval"] == {"pixel.leak.rate_hz": [0.0, None]}

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from made_up_diagnosis import everything

from adv2e.reports.headline import standing_out
from adv2e.reports.residual import groups
from adv2e.reports.result import Signature
from adv2e.reports.summary import summary_text

NAN = float("nan")


def signature(name, group, z_before, z_after, kind="count"):
    meaning = f"what {name} means"
    return Signature(name, group, meaning, 12.0, 345.0, 67.0, z_before, z_after, "events", kind)


SIGNATURES = [
    signature("a1", "a", -3.5, 0.2),
    signature("b1", "b", 9.0, 1.0),
    signature("a2", "a", 2.9, -2.9),
    signature("c1", "c", 4.0, -3.1),
    signature("b2", "b", -20.0, NAN),
    signature("c2", "c", -50.0, 2.0),
    signature("d1", "d", 2.0, 2.0),
    signature("e1", "e", NAN, -30.0),
    signature("f1", "f", NAN, NAN),
]


def test_groups_that_still_stand_out_come_first_the_farthest_before_the_others():
    found = standing_out(SIGNATURES)
    assert [(one.group, one.farthest.name) for one in found] == [
        ("e", "e1"),
        ("c", "c1"),  # of the model found, which is what is left
        ("b", "b2"),
        ("a", "a1"),
    ]
    assert [(one.number, one.before, one.after) for one in found] == [
        (1, 0, 1),
        (2, 2, 1),
        (2, 2, 0),
        (2, 1, 0),
    ]


def test_numbers_of_events_come_first_then_times_then_all_else():
    kinds = {"covariance": "other", "gaps": "time", "fewer": "count", "many": "count"}
    size = {"covariance": 90.0, "gaps": 40.0, "fewer": 4.0, "many": 7.0}
    given = [signature(name, name, size[name], size[name], kind) for name, kind in kinds.items()]
    wanted = ["many", "fewer", "gaps", "covariance"]
    assert [one.group for one in standing_out(given)] == wanted
    unexplained = replace(everything(), verdict="unexplained", effects=[], signatures=given)
    text = groups(unexplained)
    assert [text.index(f"what {name} means") for name in wanted] == sorted(
        text.index(f"what {name} means") for name in wanted
    )
    assert "it shows in the what many means: 12.0 events measured" in unexplained.sentence


def test_nothing_stands_out_of_chance():
    quiet = [signature(f"s{k}", "g", 0.9 * k, -0.9 * k) for k in range(4)]
    assert standing_out(quiet) == []
    text = groups(replace(everything(), signatures=quiet))
    assert "No number differs by more than 3 standard deviations: here, the simulation is" in text


def test_the_page_tells_how_each_group_stands_out():
    text = groups(replace(everything(), verdict="unexplained", signatures=SIGNATURES))
    assert text.index("what e1 means") < text.index("what c1 means") < text.index("what b2 means")
    assert "what c2 means" not in text
    assert "2 of 2" in text
    assert "345" in text


def test_where_nothing_was_found_one_model_is_shown():
    nothing = replace(everything(), verdict="unexplained", effects=[], signatures=SIGNATURES)
    text = groups(nothing)
    headings = re.findall('<th scope="col"[^>]*>([^<]*)', text)
    assert headings == ["what", "measured", "simulated", "unit", "far off"]
    assert "model found" not in text


def test_where_nothing_is_left_the_page_tells_what_differed():
    text = groups(replace(everything(), verdict="explained", signatures=SIGNATURES))
    assert text.index("what c2 means") < text.index("what b2 means") < text.index("what a1 means")
    assert "what c1 means" not in text


@pytest.mark.parametrize("verdict", ["unexplained", "partly_explained", "consistent"])
def test_the_summary_tells_the_first_of_each_kind_where_nothing_is_named(verdict):
    kinds = {"c1": "time", "b2": "other"}
    given = [replace(one, kind=kinds.get(one.name, "count")) for one in SIGNATURES]
    given = [one for one in given if one.name not in ("b1", "c2")]
    found = replace(everything(), verdict=verdict, effects=[], signatures=given)
    lines = [
        "  what c1 means: 12.0 events measured, 67.0 simulated",
        "  what b2 means: 12.0 events measured, 67.0 simulated",
    ]
    told = [line for line in summary_text(found).splitlines() if line.startswith("  what ")]
    assert told == (lines if verdict == "unexplained" else [])
    assert ("it shows in the what e1 means" in found.sentence) == (verdict != "consistent")


def test_the_summary_stays_short_where_much_stands_out():
    long = [signature("word " * 60, f"group {k} " * 20, 9.0, 9.0) for k in range(9)]
    unexplained = replace(everything(), verdict="unexplained", effects=[], signatures=long)
    lines = summary_text(replace(unexplained, remark="word " * 300)).splitlines()
    assert len(lines) < 15
    assert max(map(len, lines)) <= 100

"""The cases of the study of the diagnosis: their order, and how they are shared out."""

import pytest
from camera.catalogue import LIBRARY, OUTSIDE
from studies import cases


@pytest.fixture
def plan():
    def made(**options):
        wanted = {"kinds": cases.KINDS, "sizes": cases.SIZES, "library": LIBRARY}
        return cases.Plan(**{**wanted, **options})

    return made


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

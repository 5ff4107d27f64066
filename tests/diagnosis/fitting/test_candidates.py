"""The library of effects: every candidate makes a configuration; scales of the parameters."""

import math

import pytest
from camera.catalogue import LIBRARY
from hypothesis import given
from hypothesis import strategies as st

from adv2e.config import Config, load_config, load_family, shipped, to_dict
from adv2e.config.tree import flat, get_key, set_key
from adv2e.diagnosis.fitting.candidates import Candidate, neutral_value
from adv2e.diagnosis.fitting.library import library, names
from adv2e.diagnosis.hints.collect import Hints
from adv2e.diagnosis.hints.lamps import Lamp
from adv2e.reports.markup import known_keys

HINTS = Hints(0.3, (Lamp(100.0), Lamp(63.5, 1.2)), 10)
CONFIGS = [None, *(name for name in shipped() if not load_family(name).forms)]


def configuration(name):
    return load_config([name] if name else [])


def changed(config, other):
    """Return the keys by which two configurations differ, with the values of the second."""
    before = dict(flat(to_dict(config)))
    return {key: value for key, value in flat(to_dict(other)) if before.get(key) != value}


def test_the_library_has_the_effects_of_the_catalogue():
    # how the pixels begin is no effect of a camera
    assert set(names()) == {*LIBRARY, "initial_reference"}
    assert len(names()) == len(set(names()))


@pytest.mark.parametrize("name", CONFIGS)
def test_every_candidate_applies_at_every_probe(name):
    declared = configuration(name)
    for one in library(declared, HINTS):
        assert one.starts
        for start in one.starts:
            config = one.applied(declared, one.scaled(start))
            assert isinstance(config, Config)
            found = one.settings(one.scaled(start))
            touched = changed(declared, config)
            assert touched, (one.name, start)
            for key, value in touched.items():
                if key in found:
                    assert found[key] == value or found[key] == pytest.approx(value)


@pytest.mark.parametrize("name", CONFIGS)
def test_every_candidate_applies_at_the_ends_of_its_ranges(name):
    declared = configuration(name)
    for one in library(declared, HINTS):
        for far in (-1e9, 1e9):
            config = one.applied(declared, [far] * len(one.parameters))
            for key, value in one.settings([far] * len(one.parameters)).items():
                assert get_key(to_dict(config), key) == value


@pytest.mark.parametrize("name", CONFIGS)
def test_probes_lie_within_the_ranges(name):
    for one in library(configuration(name), HINTS):
        for start in one.starts:
            for parameter, value in zip(one.parameters, start, strict=True):
                assert parameter.low < value < parameter.high, (one.name, parameter.key)
                assert not parameter.at_border(parameter.scaled(value))


NOT_AS_DECLARED = {
    "frames.encoding": "a text, which holds the number",
    "frames.flicker.phase_rad": "about that of the line",
    "pixel.thresholds.drift_per_s": "thresholds stay above zero to the end",
}


def test_ranges_are_those_that_are_declared_with_the_parameters():
    for one in library(Config(), HINTS):
        for parameter in one.parameters:
            if parameter.key not in NOT_AS_DECLARED:
                fit = known_keys(Config)[parameter.key].fit
                assert fit.low <= parameter.low < parameter.high <= fit.high, parameter.key
                assert parameter.log or not fit.log


def test_a_black_level_may_be_missing_in_the_frames_or_too_much():
    lack, excess = (one for one in library(Config(), HINTS) if one.name == "black_level")
    assert all(value > 0 for (value,) in lack.starts)
    assert all(value < 0 for (value,) in excess.starts)
    assert lack.parameters[0].low == -excess.parameters[0].high > 0


def test_without_a_low_pass_there_is_nothing_that_acts_on_it():
    found = {one.name for one in library(configuration("ideal"), HINTS)}
    assert {"photoreceptor_noise", "slew_limit"}.isdisjoint(found)
    assert "low_pass" in found


@pytest.mark.parametrize("name", CONFIGS)
def test_a_candidate_changes_its_own_keys_only(name):
    declared = configuration(name)
    for one in library(declared, HINTS):
        config = one.applied(declared, one.scaled(one.starts[0]))
        own = {parameter.key for parameter in one.parameters} | {key for key, _ in one.extra}
        for key in set(changed(declared, config)) - own:
            assert was_off(declared, key), (one.name, key)
            assert any(mine.startswith(key.rpartition(".")[0]) for mine in own), (one.name, key)


def was_off(config, key):
    """Tell whether a section that `key` is in was null, so that it is new with its default."""
    held = to_dict(config)
    for name in key.split(".")[:-1]:
        held = held[name]
        if held is None:
            return True
    return False


def test_every_key_is_declared_with_a_unit():
    for one in library(Config(), HINTS):
        for parameter in one.parameters:
            assert known_keys(Config)[parameter.key].unit
    assert known_keys(Config)["pixel.refractory.period_us"].unit == "us"
    assert known_keys(Config)["pixel.low_pass.cutoff_hz"].unit == "Hz"
    assert known_keys(Config)["frames.shift_px"].unit == "px"
    assert known_keys(Config)["readout.tick_us"].unit == "us"


def test_effects_may_have_several_forms():
    forms = [one for one in library(Config(), HINTS) if one.name == "thresholds"]
    assert sorted(len(one.parameters) for one in forms) == [1, 1, 2]
    lines = [one for one in library(Config(), HINTS) if one.name == "flicker"]
    assert [dict(one.extra)["frames.flicker.frequency_hz"] for one in lines] == [100.0, 63.5]


@pytest.mark.parametrize(("tick", "there"), [(1, False), (2, True), (500, True)])
def test_ticks_are_a_candidate_where_all_stamps_have_one(tick, there):
    made = library(Config(), Hints(1.0, (), tick))
    found = [one for one in made if one.name == "timestamp_tick"]
    assert len(found) == there
    for one in found:
        assert one.applied(Config(), []).readout.tick_us == tick
        assert one.settings([]) == {"readout.tick_us": float(tick)}


def forms(name, sets, hints=HINTS):
    """Return a configuration, and the forms of an effect on top of it."""
    declared = load_config([], sets)
    return declared, [one for one in library(declared, hints) if one.name == name]


@pytest.mark.parametrize(
    ("way", "other"), [("running", "random"), ("settled", "random"), ("random", "settled")]
)
def test_pixels_may_have_begun_the_other_way(way, other):
    declared, (one,) = forms("initial_reference", [f"pixel.initial_reference={way}"])
    assert one.applied(declared, []).pixel.initial_reference == other
    assert one.of_chance


def test_what_is_declared_and_not_there_can_be_taken_away():
    lamp = "frames.flicker={frequency_hz: 100, depth: 0.2}"
    declared, lines = forms("flicker", [lamp], Hints(0.3, (), 1))
    (one,) = lines
    assert one.applied(declared, []).frames.flicker is None
    declared, (one,) = forms("timestamp_tick", ["readout.tick_us=1000"], Hints(0.3, (), 1))
    assert one.applied(declared, []).readout.tick_us == 0.0
    assert forms("timestamp_tick", ["readout.tick_us=10"])[1] == []  # as the stamps have it


def test_of_a_low_pass_that_is_off_both_corners_are_told():
    _, found = forms("low_pass", ["pixel.low_pass=null"])
    assert len(found) == 2
    for one in found:
        keys = one.settings(one.scaled(one.starts[0]))
        assert set(keys) == {"pixel.low_pass.cutoff_hz", "pixel.low_pass.dark_cutoff_hz"}
    assert len(forms("low_pass", [])[1]) == 3


@pytest.mark.parametrize(
    ("too_many", "more"),
    [
        ((1.0, 1.0), [0, 0, 0]),
        ((1.9, 0.6), [0, 0, 0]),
        ((0.04, 0.25), [2, 2, 2]),
        ((3.0, 1.0), [2, 0, 2]),
    ],
)
def test_thresholds_far_off_are_looked_for_where_the_totals_say(too_many, more):
    usual = [len(one.starts) for one in forms("thresholds", [])[1]]
    declared, found = forms("thresholds", [], Hints(0.3, (), 1, too_many=too_many))
    assert [len(one.starts) - n for one, n in zip(found, usual, strict=True)] == more
    if more[2]:
        levels = declared.pixel.thresholds
        first = found[2].starts[-2]
        factors = [min(max(ratio, 0.1), 10.0) for ratio in too_many]
        assert first == pytest.approx((factors[0] * levels.on, factors[1] * levels.off))


# --- parameters ----------------------------------------------------------------------------------


def by_key(declared):
    every = (parameter for one in library(declared, HINTS) for parameter in one.parameters)
    return {(one.key, one.part): one for one in every}


PARAMETERS = by_key(Config())
parameters = st.sampled_from(list(PARAMETERS.values()))


@given(parameters, st.floats(0.0, 1.0))
def test_inner_and_outer_are_inverse(parameter, place):
    if parameter.log:
        value = math.exp(math.log(parameter.low) + place * math.log(parameter.high / parameter.low))
    else:
        value = parameter.low + place * (parameter.high - parameter.low)
    value = min(max(value, parameter.low), parameter.high)
    assert parameter.value_at(parameter.scaled(value)) == pytest.approx(value, rel=1e-9, abs=1e-12)


@given(parameters, st.floats(-1e12, 1e12))
def test_outer_stays_in_the_range(parameter, inner):
    value = parameter.value_at(inner)
    assert parameter.low <= value <= parameter.high
    if value in (parameter.low, parameter.high):
        assert parameter.at_border(inner)
    elif min(value - parameter.low, parameter.high - value) > 1e-6 * (
        parameter.high - parameter.low
    ):
        assert not parameter.at_border(inner)


@given(parameters)
def test_both_ends_are_borders_and_the_middle_is_not(parameter):
    assert parameter.at_border(parameter.scaled(parameter.low))
    assert parameter.at_border(parameter.scaled(parameter.high))
    middle = (parameter.scaled(parameter.low) + parameter.scaled(parameter.high)) / 2
    assert not parameter.at_border(middle)


@given(parameters, st.floats(-20, 20), st.floats(0.001, 5))
def test_outer_grows_with_inner(parameter, inner, more):
    assert parameter.value_at(inner) <= parameter.value_at(inner + more)


def test_scale_is_the_change_that_counts_as_one():
    one = PARAMETERS["frames.clock_offset_us", None]
    assert one.value_at(one.scaled(200.0) + 1.0) == pytest.approx(200.0 + one.scale)
    one = PARAMETERS["pixel.leak.rate_hz", None]
    assert one.value_at(one.scaled(2.0) + 1.0) == pytest.approx(2.0 * math.e)


def test_parts_of_a_list_are_set_one_by_one():
    right, below = PARAMETERS["frames.shift_px", (0, 2)], PARAMETERS["frames.shift_px", (1, 2)]
    declared = load_config([], ["frames.shift_px=[0.5, -1]"])
    one = Candidate("misregistration", (below,), ((0.0,),))
    assert one.applied(declared, one.scaled((2.0,))).frames.shift_px == (0.5, 2.0)
    both = Candidate("misregistration", (right, below), ((0.0, 0.0),))
    assert both.settings(both.scaled((1.5, -2.0))) == {"frames.shift_px": [1.5, -2.0]}
    assert declared.frames.shift_px == (0.5, -1.0)


def test_a_parameter_may_be_part_of_a_text():
    one = Candidate("frame_encoding", (PARAMETERS["frames.encoding", None],), ((1.0,),))
    assert one.applied(Config(), one.scaled((1.25,))).frames.encoding == "gamma:1.25"
    assert one.settings(one.scaled((2.0,))) == {"frames.encoding": "gamma:2"}


# --- neutral values ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "part", "sets", "value"),
    [
        ("pixel.refractory.period_us", None, [], 500.0),
        ("pixel.refractory.period_us", None, ["pixel.refractory=null"], 0.0),
        ("pixel.thresholds.on", None, ["pixel.thresholds.on=0.31"], 0.31),
        ("pixel.source_follower.cutoff_hz", None, [], math.inf),
        ("pixel.slew_limit.per_s", None, [], math.inf),
        ("pixel.low_pass.cutoff_hz", None, [], 300.0),
        ("pixel.low_pass.cutoff_hz", None, ["pixel.low_pass=null"], math.inf),
        ("pixel.low_pass.dark_cutoff_hz", None, ["pixel.low_pass=null"], math.inf),
        ("frames.shift_px", (0, 2), [], 0.0),
        ("frames.shift_px", (1, 2), ["frames.shift_px=[1, -2.5]"], -2.5),
        ("frames.encoding", None, ["frames.encoding=linear"], 1.0),
        ("frames.encoding", None, ["frames.encoding=gamma:1.8"], 1.8),
        ("frames.encoding", None, ["frames.encoding=srgb"], 2.2),
        ("pixel.dead_pixels.fraction", None, [], 0.0),
    ],
)
def test_the_value_of_a_parameter_at_which_nothing_changes(key, part, sets, value):
    declared = load_config([], sets)
    assert neutral_value(declared, by_key(declared)[key, part]) == value


def test_what_auto_means_for_the_frames_decides_where_nothing_changes():
    def tone(sets, means):
        made = library(load_config([], sets), Hints(1.0, (), 1, means))
        return next(one for one in made if one.name == "frame_encoding")

    linear, srgb = tone([], "linear"), tone([], "srgb")
    assert [neutral_value(Config(), one.parameters[0]) for one in (linear, srgb)] == [1.0, 2.2]
    assert [value for (value,) in srgb.starts] == pytest.approx(
        [2.2 * value for (value,) in linear.starts]
    )
    assert tone(["frames.encoding=gamma:1.4"], "srgb") == tone(
        ["frames.encoding=gamma:1.4"], "linear"
    )


def test_light_leaks_leave_other_leaks_as_they_are():
    declared = load_config(["ideal"])
    assert declared.pixel.leak is None
    leak, photo = (
        next(one for one in library(declared, HINTS) if one.name == name)
        for name in ("leak", "photo_leak")
    )
    alone = photo.applied(declared, photo.scaled([5.0]))
    assert alone.pixel.leak.rate_hz == 0.0
    assert alone.pixel.leak.photo_rate_hz == pytest.approx(5.0)
    both = photo.applied(leak.applied(declared, leak.scaled([2.0])), photo.scaled([5.0]))
    assert both.pixel.leak.rate_hz == pytest.approx(2.0)
    assert photo.settings(photo.scaled([5.0])) == {"pixel.leak.photo_rate_hz": pytest.approx(5.0)}


@pytest.mark.parametrize("name", CONFIGS)
def test_with_neutral_values_the_configuration_stays_as_it_was(name):
    declared = configuration(name)
    if not declared.frames.encoding.startswith("gamma:"):
        declared = load_config([name] if name else [], ["frames.encoding=gamma:1"])
    values = to_dict(declared)
    tried = 0
    for one in library(declared, HINTS):
        if one.extra or any(get_key(values, parameter.key) is None for parameter in one.parameters):
            continue
        neutral = [neutral_value(declared, parameter) for parameter in one.parameters]
        if all(k.low <= value <= k.high for k, value in zip(one.parameters, neutral, strict=True)):
            for key, now in changed(declared, one.applied(declared, one.scaled(neutral))).items():
                assert now == pytest.approx(get_key(values, key), rel=1e-9), key
            tried += 1
    assert tried > 5


# --- nested keys ---------------------------------------------------------------------------------

paths = st.lists(st.sampled_from("abc"), min_size=1, max_size=3).map(".".join)


@given(paths, paths, st.integers())
def test_keys_are_set_and_found(first, second, value):
    values = {}
    set_key(values, first, 1)
    set_key(values, second, value)
    assert get_key(values, second) == value
    assert (second, value) in flat(values)


def test_a_section_that_is_null_becomes_one():
    values = {"pixel": None}
    assert get_key(values, "pixel.leak.rate_hz") is None
    set_key(values, "pixel.leak.rate_hz", 3.0)
    assert values == {"pixel": {"leak": {"rate_hz": 3.0}}}

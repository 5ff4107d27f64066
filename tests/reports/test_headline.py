"""The finding in one sentence, and what to do next."""

from dataclasses import replace

import pytest
from made_up_diagnosis import everything

from adv2e.diagnosis.fitting.library import names
from adv2e.effects import label_of
from adv2e.reports.findings import convert_line, next_steps
from adv2e.reports.markup import OF_TABLES, Own, heading_of, part_of
from adv2e.reports.result import Finding, Signature

DEAD = Finding(
    "refractory",
    {"pixel.refractory.period_us": 4004.4},
    {"pixel.refractory.period_us": (3969.2, 4039.6)},
)


def found(verdict="explained", **changes):
    return replace(
        everything(), **{"verdict": verdict, "effects": [DEAD], "alternatives": [], **changes}
    )


def test_the_sentence_gives_the_value_its_interval_and_what_was_declared():
    assert found().sentence == "Dead time: 4.00 ms (3.97 to 4.04), declared 0.50 ms."


@pytest.mark.parametrize(
    ("held", "defaults", "told"),
    [
        ({"pixel.refractory.period_us": None}, [], ", declared off."),
        ({"pixel.refractory.period_us": 2000.0}, [], ", declared 2.00 ms."),
        (
            {"pixel.refractory.period_us": 500.0},
            ["pixel.refractory.period_us"],
            ", declared 0.50 ms (default).",
        ),
        ({}, [], "(3.97 to 4.04)."),
    ],
)
def test_what_was_declared(held, defaults, told):
    assert found(declared_values=held, defaults=defaults).sentence.endswith(told)


def test_several_effects_and_keys():
    both = Finding(
        "thresholds",
        {"pixel.thresholds.on": 0.2612, "pixel.thresholds.off": 0.31},
        {"pixel.thresholds.on": (0.25, 0.27), "pixel.thresholds.off": (0.3, 0.32)},
    )
    held = {"pixel.thresholds.on": 0.2, "pixel.thresholds.off": 0.2}
    assert found(effects=[DEAD, both], declared_values=held).sentence == (
        "Dead time: 4.00 ms (3.97 to 4.04); contrast threshold: ON 0.261 ln (0.250 to 0.270),"
        " declared 0.200 ln, and OFF 0.310 ln (0.300 to 0.320), declared 0.200 ln."
    )


def test_keys_that_were_read_off_have_no_interval():
    tick = Finding("timestamp_tick", {"readout.tick_us": 100.0}, {})
    told = found(effects=[tick], declared_values={"readout.tick_us": 0.0}).sentence
    assert told == "Tick of the time stamps: 100 µs, declared 0 µs."
    lamp = Finding(
        "flicker",
        {"frames.flicker.depth": 0.15, "frames.flicker.frequency_hz": 100.0},
        {"frames.flicker.depth": (0.14, 0.16)},
    )
    assert found(effects=[lamp]).sentence == "Flicker of lamps: 0.150 (0.140 to 0.160)."


def test_alternatives_are_named_in_the_sentence():
    told = found("not_identifiable", alternatives=["leak", "reset_overshoot"]).sentence
    assert told.endswith("0.50 ms; or instead: leak or overshoot of the reset.")


def test_where_nothing_is_missing_the_sentence_gives_the_error():
    told = found("consistent", effects=[]).sentence
    assert told == (
        "Nothing is missing that these data show: the error of the declared model is 1.38, and"
        " chance alone makes 0.270."
    )
    assert found("consistent", effects=[], errors=[]).sentence.endswith("these data show.")


def test_what_is_not_explained_is_told_by_what_differs_most():
    told = found("unexplained", effects=[]).sentence
    assert told.startswith("Something is missing that no known effect explains; it shows in the")
    assert told.endswith(": 0.710 of 1 measured, 0.660 simulated.")
    told = found("unexplained", effects=[], signatures=[]).sentence
    assert told.endswith("model is 1.38, and chance alone makes 0.270.")


@pytest.mark.parametrize("name", [*names(), "a_users_own"])
def test_every_effect_has_a_name_for_people(name):
    label = label_of(name)
    assert "_" not in label
    assert heading_of(name)[0].isupper()
    assert name in heading_of(name) or label == name.replace("_", " ")


def test_keys_of_an_effect_are_told_apart():
    assert part_of("pixel.refractory.period_us", alone=True) == ""
    assert part_of("pixel.thresholds.on", alone=True) == "ON"
    assert part_of("readout.frame_coupling.tau_us", alone=False) == "tau"
    assert part_of("user.mine.fall_per_s", alone=False) == "fall"


def test_the_next_step_is_to_convert_with_the_model():
    (step,) = next_steps(found(), "my folder/found")
    assert step.line == "adv2e convert -c 'my folder/found/model.yaml' VIDEO"
    (step,) = next_steps(found("consistent", effects=[]), "found")
    assert step.line == "adv2e convert -c found/model.yaml VIDEO"


def test_a_model_with_an_own_effect_needs_its_file():
    own = Own(files={"afterglow": "my effects/glow.py", "other": "other.py"})
    line = convert_line(found(own=own, model={"user": {"afterglow": {"tau_us": 3.0}}}), "found")
    assert line == "adv2e convert -c found/model.yaml --effect 'my effects/glow.py' VIDEO"


def test_effects_that_look_alike_are_to_be_separated():
    best, other = next_steps(found("not_identifiable", alternatives=["leak"]), "found")
    assert best.line.startswith("adv2e convert")
    assert "dead time: fast, high-contrast edges" in other.text
    assert other.line == ""


def test_where_something_is_left_the_next_step_is_an_own_effect_and_why():
    convert, own = next_steps(found("partly_explained"), "found")
    assert convert.line.startswith("adv2e convert")
    assert "--effect my_effect.py" in own.line
    (own,) = next_steps(found("unexplained", effects=[]), "found")
    assert own.line == "adv2e diagnose RECORDING -c DECLARED.yaml --effect my_effect.py"
    assert "It has to change what differs here: order." in own.text
    quiet = [Signature("s", "g", "m", 1.0, 1.0, 1.0, 0.0, 0.0, "events")]
    (own,) = next_steps(found("unexplained", effects=[], signatures=quiet), "found")
    assert "has to change" not in own.text


def test_what_may_be_wrong_with_the_recording_is_checked_before_an_effect_is_written():
    doubted = found("unexplained", effects=[], input_checks=["no frames from 0.1 to 0.2 s"])
    check, own = next_steps(doubted, "found")
    assert check.text == "First check the recording: no frames from 0.1 to 0.2 s."
    assert own.line


def test_no_own_effect_can_explain_a_table():
    (step,) = next_steps(found("unexplained", effects=[], wording=OF_TABLES), "found")
    assert step.line == "adv2e characterise TABLE -c DECLARED.yaml --error 0.1"

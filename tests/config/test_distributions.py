"""Numbers that are drawn: their laws, what a draw depends on, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.config import from_dict, load_config, load_family, to_annotated_yaml, to_dict
from adv2e.config.user_effects import load_effects
from adv2e.errors import ConfigError, UsageError

ON = "pixel.thresholds.on"
OFF = "pixel.thresholds.off"
SEEDS = 1500


def draws(key, form, count=SEEDS):
    """Return what seeds give for a distribution at a key."""
    family = load_family(sets=[f"{key}={form}"])
    return np.array([family.of(seed)[1][key] for seed in range(count)])


def distance(found, law):
    """Return the largest distance of the shares below each number from `law` (Kolmogorov)."""
    ranks = np.arange(1, found.size + 1) / found.size
    expected = np.array([law(number) for number in np.sort(found)])
    return max(np.abs(ranks - expected).max(), np.abs(ranks - 1 / found.size - expected).max())


# of as many draws, the distance is larger in one of 1,000,000 cases
FAR = math.sqrt(math.log(2e6) / 2 / SEEDS)


def normal_law(mean, deviation, above=-math.inf):
    def share(number):
        return math.erfc((mean - number) / deviation / math.sqrt(2)) / 2

    low = share(above)
    return lambda number: (share(number) - low) / (1 - low)


@pytest.mark.parametrize(
    ("form", "law"),
    [
        ("{uniform: [0.1, 0.5]}", lambda number: (number - 0.1) / 0.4),
        ("{log_uniform: [0.01, 1]}", lambda number: math.log(number / 0.01) / math.log(100)),
        ("{normal: [0.18, 0.03]}", normal_law(0.18, 0.03)),
        # a third of it lies below the least threshold
        ("{normal: [0.1, 0.2]}", normal_law(0.1, 0.2, above=0.01)),
    ],
)
@pytest.mark.quick_cases(1)
def test_numbers_follow_their_law(form, law):
    found = draws(ON, form)
    assert found.min() > 0
    assert distance(found, law) < FAR


@pytest.mark.parametrize(
    ("form", "values"),
    [
        ("{choice: [5, 10, 20]}", [5, 10, 20]),
        ("{choice: [7, 7, 3, 7]}", [7, 7, 3, 7]),
        ("{uniform: [2, 5]}", [2, 3, 4, 5]),
    ],
)
@pytest.mark.quick_cases(1)
def test_whole_numbers_are_each_as_likely(form, values):
    found = draws("sampling.L", form)
    assert found.dtype == np.int64
    assert {*found.tolist()} == {*values}
    for value in {*values}:
        share = values.count(value) / len(values)
        deviation = math.sqrt(share * (1 - share) / SEEDS)
        assert abs((found == value).mean() - share) < 5 * deviation


def test_a_tie_follows_the_other_number():
    tie = f"{{same_as: {ON}, times: {{normal: [1, 0.1]}}}}"
    family = load_family(sets=[f"{ON}={{uniform: [0.1, 0.5]}}", f"{OFF}={tie}"])
    pairs = [family.of(seed) for seed in range(SEEDS)]
    ratios = np.array([numbers[OFF] / numbers[ON] for _, numbers in pairs])
    assert distance(ratios, normal_law(1, 0.1)) < FAR
    on = np.array([numbers[ON] for _, numbers in pairs])
    assert abs(np.corrcoef(on, ratios)[0, 1]) < 5 / math.sqrt(SEEDS)
    config, numbers = pairs[0]
    assert (config.pixel.thresholds.on, config.pixel.thresholds.off) == (numbers[ON], numbers[OFF])


def test_a_tie_takes_numbers_that_are_not_drawn():
    sets = ["pixel.leak.rate_hz=0.0625", "frames.shift_px=[3, {uniform: [1, 2]}]"]
    ties = {
        "pixel.leak.jitter": ("{same_as: pixel.leak.rate_hz, times: 2, plus: 0.125}", 0.25),
        "pixel.thresholds.mismatch": ("{same_as: pixel.shot_noise.rate_hz}", 0.01),
        "frames.clock_offset_us": ("{same_as: 'frames.shift_px[0]'}", 3.0),
        "sampling.K": ("{same_as: sampling.L, times: 3}", 30),
    }
    family = load_family(sets=[*sets, *(f"{key}={form}" for key, (form, _) in ties.items())])
    config, numbers = family.of(5)
    assert {key: numbers[key] for key in ties} == {key: value for key, (_, value) in ties.items()}
    assert config.sampling.K == 30
    assert config.frames.shift_px == (3.0, numbers["frames.shift_px[1]"])


def test_a_number_depends_on_its_seed_and_key_alone():
    """Never others: training sets of before would not be made again."""
    form = {"normal": [0.18, 0.03]}
    alone = load_family({"pixel": {"thresholds": {"off": form}}})
    among = load_family(
        {
            "sampling": {"L": {"choice": [5, 10]}},
            "pixel": {"thresholds": {"off": form, "on": form}, "leak": {"rate_hz": form}},
        }
    )
    turned = load_family(
        {
            "pixel": {"leak": {"rate_hz": form}, "thresholds": {"on": form, "off": form}},
            "sampling": {"L": {"choice": [5, 10]}},
        }
    )
    config, numbers = among.of(7)
    assert turned.of(7) == (config, numbers)
    assert alone.of(7)[1][OFF] == numbers[OFF]
    assert len({numbers[OFF], numbers[ON], numbers["pixel.leak.rate_hz"]}) == 3
    assert numbers == {
        "sampling.L": 10,
        OFF: pytest.approx(0.1895650, abs=1e-6),
        ON: pytest.approx(0.1534387, abs=1e-6),
        "pixel.leak.rate_hz": pytest.approx(0.1173496, abs=1e-6),
    }
    assert config.seed == 7


def test_without_distributions_it_is_the_configuration():
    family = load_family("davis346", "pixel.leak=null", seed=3)
    assert family.config == load_config("davis346", "pixel.leak=null", seed=3)
    assert family.of(9) == (load_config("davis346", "pixel.leak=null", seed=9), {})
    assert family.written() == to_dict(family.config)


def test_a_later_file_takes_the_place_of_a_distribution():
    wide, narrow = {"uniform": [0.1, 0.5]}, {"normal": [0.2, 0.01]}
    layers = [{"pixel": {"thresholds": {"on": form}}} for form in (wide, narrow)]
    assert load_family(layers).forms == {ON: "{normal: [0.2, 0.01]}"}
    assert load_config([layers[0], {"pixel": {"thresholds": {"on": 0.3}}}]).pixel.thresholds.on
    assert load_family([{"pixel": {"thresholds": {"on": 0.3}}}, layers[0]]).forms
    assert load_family(sets=f"{ON}.uniform=[1, 2]").forms == {ON: "{uniform: [1, 2]}"}


def test_what_is_shown_reads_back():
    family = load_family(
        sets=[
            f"{ON}={{uniform: [0.1, 0.5]}}",
            f"{OFF}={{same_as: {ON}, times: {{normal: [1, .1]}}}}",
            "frames.shift_px=[{normal: [0, 1e0]}, 2]",
        ]
    )
    text = to_annotated_yaml(family.config, family.forms)
    again = load_family(yaml.safe_load(text))
    assert again.written() == family.written()
    assert again.of(4) == family.of(4)
    assert family.written()["pixel"]["thresholds"]["on"] == {"uniform": [0.1, 0.5]}


def test_nobody_else_draws():
    form = {"pixel": {"thresholds": {"on": {"uniform": [0.1, 0.5]}}}}
    words = (
        rf"^{ON}: \{{uniform: \[0.1, 0.5\]\}} is a distribution, .*'adv2e batch'.*write a number"
    )
    with pytest.raises(ConfigError, match=words):
        load_config(form)
    with pytest.raises(ConfigError, match=rf"^old\.h5: {ON}: .*'adv2e batch'"):
        from_dict(form, "old.h5")
    with pytest.raises(UsageError, match=r"^--set frames.shift_px\[1\]: .*'adv2e batch'"):
        load_config(sets="frames.shift_px=[0, {normal: [0, 1]}]")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("on: {unifrom: [0.1, 0.5]}", "on: must be a number, or one of {uniform: [a, b]}, {log_un"),
        ("on: {}", "on: must be a number, or one of {uniform"),
        ("on: {uniform: [0.1, 0.5], normal: [1, 1]}", "on: must be a number, or one of"),
        ("on: {uniform: 0.5}", "on.uniform: must be [a, b] with a below b, got 0.5"),
        ("on: {uniform: [0.5, 0.1]}", "on.uniform: must be [a, b] with a below b, got [0.5, 0.1]"),
        ("on: {uniform: [0.1, 0.2, 0.3]}", "on.uniform: must be [a, b] with a below b"),
        ("on: {uniform: [0.1, x]}", "on.uniform: must be a finite number, got 'x'"),
        ("on: {uniform: [0.1, .inf]}", "on.uniform: must be a finite number, got .inf"),
        (f"on: {{uniform: [0.1, 1{'0' * 400}]}}", "on.uniform: must be a finite number, got 1000"),
        ("on: {uniform: [0.1, true]}", "on.uniform: must be a finite number, got true"),
        ("on: {log_uniform: [0, 1]}", "on.log_uniform: must be [a, b] with a above 0 and below b"),
        ("on: {normal: [0.2, 0]}", "on.normal: must be [mean, deviation] with a deviation above 0"),
        ("on: {choice: []}", "on.choice: must be a list of numbers, [a, b, ...], got []"),
        ("on: {choice: [0.1, null]}", "on.choice: must be a finite number, got null"),
        ("on: {uniform: [0, 0.5]}", "on: {uniform: [0, 0.5]}: must be at least 0.01"),
        ("on: {choice: [0.1, -1]}", "on: {choice: [0.1, -1]}: must be at least 0.01"),
        ("on: {normal: [-9, 0.1]}", "on: {normal: [-9, 0.1]}: 1,000 draws were all outside of its"),
        ("on: {same_as: 3}", "on.same_as: must be the path of a key, got 3"),
        ("on: {same_as: pixel.thresholds.of}", "of is no key of a number, did you mean 'pixel.th"),
        ("on: {same_as: pixel.initial_reference}", "pixel.initial_reference is no key of a number"),
        ("on: {same_as: pixel.dark_current.dn}", "pixel.dark_current.dn has no number: it is off"),
        ("on: {same_as: frames.full_scale}", "frames.full_scale has no number"),
        ("on: {same_as: pixel.thresholds.on}", "goes round in a circle: pixel.thresholds.on"),
        ("on: {same_as: pixel.thresholds.off, times: x}", "on.times: must be a finite number"),
        ("on: {same_as: pixel.thresholds.off, times: {same_as: seed}}", "on.times: must be a num"),
        ("on: {same_as: pixel.thresholds.off, by: 2}", "on: must be a number, or one of"),
        ("on: {same_as: pixel.thresholds.off, times: -1}", "times: -1}: must be at least 0.01"),
    ],
)
def test_what_is_wrong_names_file_line_key_and_what_would_be_right(tmp_path, text, said):
    path = tmp_path / "c.yaml"
    path.write_text(f"# one\npixel:\n  thresholds:\n    {text}\n")
    with pytest.raises(ConfigError) as caught:
        load_family([path])
    assert str(caught.value).startswith(f"{path}:4: pixel.thresholds.on")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("argument", "said"),
    [
        ("seed={uniform: [0, 9]}", "seed: must be a whole number, got .*each sequence has a seed"),
        ("sampling.L={normal: [10, 1]}", "L.normal: this key takes whole numbers: .* by uniform"),
        ("sampling.L={log_uniform: [1, 9]}", "L.log_uniform: this key takes whole numbers"),
        ("sampling.L={uniform: [1, 2.5]}", "L.uniform: must be a whole number, got 2.5"),
        ("sampling.L={choice: [1, 1.0]}", "L.choice: must be a whole number, got 1.0"),
        ("sampling.L={uniform: [0, 5]}", "must be at least 1, got 0"),
        ("sampling.L={same_as: sampling.K, times: 1.5}", "must be a whole number, got 15"),
        ("frames.encoding={choice: [srgb, linear]}", "frames.encoding: must be text, got"),
        ("pixel.leek={uniform: [0, 1]}", "pixel.leek: unknown key"),
        ("pixel.leak={uniform: [0, 1]}", "pixel.leak.uniform: unknown key"),
        ("pixel.log_response.linear_below={choice: [0.5]}", "linear_below: must be 0 .pure"),
    ],
)
def test_what_does_not_fit_its_key(argument, said):
    with pytest.raises(UsageError, match=said):
        load_family(sets=[argument])


def test_the_widest_range_is_no_end_of_it():
    found = draws("frames.clock_offset_us", "{uniform: [-1.7e308, 1.7e308]}", 100)
    assert np.abs(found).max() < 1.7e308
    assert (found < 0).any()


def test_effects_of_ones_own_take_distributions(tmp_path):
    effect = tmp_path / "echo.py"
    effect.write_text(
        "from dataclasses import dataclass\n"
        "from adv2e.effects.hooks import Hooks\n"
        "from adv2e.parameters import Section, parameter\n"
        "@dataclass(frozen=True, kw_only=True)\n"
        "class Parameters(Section):\n"
        "    share: float = parameter(unit='-', meaning='share', at_least=0, at_most=1)\n"
        "class Echo(Hooks):\n"
        "    'Echoes.'\n"
        "    stage, Parameters = 'readout', Parameters\n"
        "    def events(self, chunks):\n"
        "        yield from chunks\n"
    )
    family = load_family(sets="user.echo.share={normal: [0, 1]}", effects=load_effects(str(effect)))
    config, numbers = family.of(1)
    assert 0 <= numbers["user.echo.share"] == config.user.echo.share <= 1


def test_ties_that_go_round_in_a_circle_are_refused():
    sets = [f"{ON}={{same_as: {OFF}}}", f"{OFF}={{same_as: {ON}, times: 2}}"]
    with pytest.raises(UsageError, match=f"goes round in a circle: {ON} -> {OFF}"):
        load_family(sets=sets)
    leads_there = [*sets, f"pixel.leak.rate_hz={{same_as: {ON}}}"]
    with pytest.raises(UsageError, match="goes round in a circle"):
        load_family(sets=leads_there)


@settings(max_examples=100, deadline=None)
@given(
    seed=st.integers(0, 2**64 - 1),
    ends=st.lists(st.floats(1e-300, 1.7e308), min_size=2, max_size=2, unique=True).map(sorted),
    law=st.sampled_from(["uniform", "log_uniform"]),
)
def test_numbers_lie_between_the_ends(seed, ends, law):
    family = load_family({"pixel": {"leak": {"rate_hz": {law: ends}}}})
    assert ends[0] <= family.of(seed)[1]["pixel.leak.rate_hz"] <= ends[1]

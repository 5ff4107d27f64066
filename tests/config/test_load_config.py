"""From files, --set and --seed to a Config: types, switching on and off, merging, messages."""

from __future__ import annotations

import dataclasses

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.config import Config, from_dict, load_config, to_annotated_yaml, to_dict, to_yaml
from adv2e.config.build import build
from adv2e.config.model import Pixel, Sampling
from adv2e.config.yaml12 import Origin, parse
from adv2e.effects.pixel.hot_pixels import HotPixels
from adv2e.effects.pixel.leak import Leak
from adv2e.effects.pixel.low_pass import LowPass
from adv2e.effects.pixel.source_follower import SourceFollower
from adv2e.effects.pixel.thresholds import Thresholds
from adv2e.errors import ConfigError, UsageError


@pytest.fixture
def write(tmp_path):
    """Write a configuration file and return its path."""

    def write(text, name="c.yaml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


def message(kind, *args, **kwargs):
    """Return the text of the error of `kind` that loading raises: exactly this kind, one line."""
    with pytest.raises(kind) as caught:
        load_config(*args, **kwargs)
    assert caught.type is kind
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_nothing_given_is_the_defaults():
    assert load_config() == Config()


def test_one_file_name_mapping_or_configuration_needs_no_list(write):
    path = write("pixel:\n  thresholds:\n    on: 0.3\n")
    config = Config(pixel=Pixel(thresholds=Thresholds(on=0.3)))
    assert load_config(path) == load_config(str(path)) == config
    assert load_config({"pixel": {"thresholds": {"on": 0.3}}}) == config
    assert load_config(config) == config
    assert load_config("davis346") == load_config(["davis346"])
    assert load_config(None) == Config()


def test_layers_of_all_kinds_lie_one_over_another(write):
    path = write("pixel: {thresholds: {off: 0.4, mismatch: 0.1}}")
    under = Config(seed=3, pixel=Pixel(thresholds=Thresholds(on=0.5, off=0.5)))
    over = {"pixel": {"thresholds": {"mismatch": 0}}}
    config = load_config([under, path, over], "pixel.leak=null")
    assert config.pixel.thresholds == Thresholds(on=0.5, off=0.4, mismatch=0.0)
    assert (config.seed, config.pixel.leak) == (3, None)


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"pixel": {"leek": 1}}, "pixel.leek: unknown key (value 1), did you mean 'leak'?"),
        ({"pixel.leak": None}, "each part by itself: pixel: {leak: ...}"),
        ({"pixel": {"thresholds": {"on": "0.3"}}}, "must be a number"),
        (3, "a configuration is a file, the name of a shipped one, a mapping or a Config, got int"),
        ([{}, 3], "a mapping or a Config, got int"),
    ],
)
def test_what_is_no_configuration_is_told(given, text):
    assert text in message(ConfigError, given)


def test_keys_left_out_keep_their_defaults(write):
    config = load_config([write("pixel:\n  thresholds:\n    on: 0.3\n")])
    assert config == Config(pixel=Pixel(thresholds=Thresholds(on=0.3)))


@pytest.mark.parametrize("text", ["", "# nothing\n", "---\n", "{}"])
def test_an_empty_file_changes_nothing(write, text):
    assert load_config([write(text)]) == Config()


def test_a_byte_order_mark_is_no_part_of_the_first_key(write):
    assert load_config([write("\ufeffseed: 3\n")]).seed == 3


def test_a_whole_number_is_a_float_where_one_is_declared():
    cutoff = load_config(sets=["pixel.low_pass.cutoff_hz=100"]).pixel.low_pass.cutoff_hz
    assert type(cutoff) is float
    assert cutoff == 100.0


def test_null_switches_an_effect_off(write):
    for text in ("null", "~", ""):
        config = load_config([write(f"pixel:\n  leak: {text}\n")])
        assert config.pixel.leak is None
        assert config.pixel.low_pass == LowPass()


def test_a_key_inside_a_null_section_switches_it_on_with_its_other_defaults(write):
    off = write("pixel: {leak: null}", "off.yaml")
    assert load_config([off], ["pixel.leak.rate_hz=0.5"]).pixel.leak == Leak(rate_hz=0.5)
    assert load_config([off], ["pixel.leak={}"]).pixel.leak == Leak()


def test_switching_off_forgets_what_was_set_before(write):
    first = write("pixel: {leak: {rate_hz: 0.5, jitter: 0.2}}", "1.yaml")
    second = write("pixel: {leak: null}", "2.yaml")
    third = write("pixel: {leak: {rate_hz: 0.7}}", "3.yaml")
    assert load_config([first, second, third]).pixel.leak == Leak(rate_hz=0.7)


def test_a_section_off_by_default_is_switched_on():
    expected = SourceFollower(cutoff_hz=2000.0)
    for text in (
        "pixel.source_follower={cutoff_hz: 2000}",
        "pixel.source_follower.cutoff_hz=2e3",
        "pixel={source_follower: {cutoff_hz: 2000}}",
    ):
        assert load_config(sets=[text]).pixel.source_follower == expected


def test_a_key_without_default_must_be_given(write):
    text = message(ConfigError, [write("seed: 1\npixel:\n  hot_pixels:\n    fraction: 0.1\n")])
    assert "c.yaml:3: pixel.hot_pixels.rate_hz: must be given" in text
    sets = ["pixel.hot_pixels.fraction=0.1", "pixel.hot_pixels.rate_hz=5"]
    assert load_config(sets=sets).pixel.hot_pixels == HotPixels(fraction=0.1, rate_hz=5.0)


def test_later_files_win_key_by_key(write):
    first = write("seed: 1\npixel: {thresholds: {on: 0.3, off: 0.4}}", "1.yaml")
    second = write("pixel: {thresholds: {off: 0.5}}", "2.yaml")
    assert load_config([first, second]).pixel.thresholds == Thresholds(on=0.3, off=0.5)
    assert load_config([second, first]).pixel.thresholds == Thresholds(on=0.3, off=0.4)
    assert load_config([first, second]).seed == 1


def test_set_wins_over_files_in_order_and_seed_over_set(write):
    file = write("seed: 1\nsampling: {K: 2, L: 3}")
    config = load_config([file], ["sampling.K=4", "sampling.K=5", "seed=6"], seed=7)
    assert config.sampling == Sampling(K=5, L=3)
    assert config.seed == 7
    assert load_config([file], ["seed=6"]).seed == 6


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("cutof_hz: 100", "pixel.low_pass.cutof_hz: unknown key (value 100), did you mean 'cut"),
        ("rate_hz: 1", "pixel.low_pass.rate_hz: unknown key (value 1), did you mean 'pixel."),
        ("zzz: 1", "known here: cutoff_hz, dark_cutoff_hz, update"),
        ("cutoff_hz: '100'", "cutoff_hz: must be a number [Hz], got '100': leave out the quotes"),
        ("cutoff_hz: 1_000", "must be a number [Hz], got '1_000': leave out the underscores"),
        ("cutoff_hz: true", "cutoff_hz: must be a number [Hz], got true"),
        ("cutoff_hz: null", "cutoff_hz: must be a number [Hz], got null"),
        ("cutoff_hz: [1]", "cutoff_hz: must be a number [Hz], got [1]"),
        ("cutoff_hz: 0", "cutoff_hz: must be above 0 Hz, got 0"),
        ("cutoff_hz: .nan", "cutoff_hz: must be a finite number, got nan"),
        ("cutoff_hz: 1" + "0" * 400, "cutoff_hz: too large a number"),
        ("update: 5", "update: must be one of exact, first_order_hold"),
        ("update: eulr", "update: must be one of exact, first_order_hold"),
    ],
)
def test_a_wrong_key_names_file_line_path_value_and_what_would_be_right(write, line, text):
    said = message(ConfigError, [write(f"# one\npixel:\n  low_pass:\n    {line}\n")])
    assert "c.yaml:4: pixel.low_pass." in said
    assert text in said


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("sampling: {K: 10.0}", "sampling.K: must be a whole number, got 10.0, which is"),
        ("sampling: {K: 1e3}", "got 1e3, which is a floating-point number: write 1000"),
        ("sampling: {K: 2.5}", "sampling.K: must be a whole number, got 2.5"),
        ("sampling: {K: true}", "sampling.K: must be a whole number, got true"),
        ("sampling: {K: 0}", "sampling.K: must be at least 1, got 0"),
        ("seed: -1", "seed: must be at least 0, got -1"),
        (f"seed: {2**64}", "at most 18446744073709551615, got 18446744073709551616"),
        ("seed: 0x" + "f" * 2000, "seed: must be at most 18446744073709551615, got one of 8000 b"),
        ("sampling: {K: 9223372036854775808}", "K: must be at most 1000000, got 9223372036854"),
        ("sampling: {L: 18446744073709551616}", "L: must be at most 1000000, got 1844674407370"),
        ("pixel: {thresholds: null}", "pixel.thresholds: cannot be null, it must be a mapping"),
        ("pixel: null", "pixel: cannot be null, it must be a mapping with the keys initial"),
        ("pixel: {leak: 3}", "pixel.leak: must be a mapping with the keys rate_hz, photo_rate"),
        ("pixel: {thresholds: 3}", "pixel.thresholds: must be a mapping with the keys on, off"),
        ("readout: {a: 1}", "readout.a: unknown key (value 1)"),
        ("frames: {encoding: gama}", "frames.encoding: must be auto, linear, srgb,"),
        ("frames: {full_scale: big}", "full_scale: must be a number or null, got 'big'"),
        ("pixel: {log_response: {linear_below: 0.5}}", "linear_below: must be 0 (pure"),
        ("low_pass: {}", "low_pass: unknown key (value {}), did you mean 'pixel.low_pass'?"),
        ("[1, 2]", "must hold keys such as 'pixel:', got [1, 2]"),
        ("seed", "must hold keys such as 'pixel:', got 'seed'"),
        ("seed: 1\nseed: 2", "c.yaml:2: seed: given twice (first on line 1)"),
    ],
)
def test_other_mistakes_in_a_file(write, text, said):
    assert said in message(ConfigError, [write(text)])


def test_a_mistake_in_the_second_file_names_the_second_file(write):
    files = [write("seed: 1", "good.yaml"), write("\n\nsed: 1", "bad.yaml")]
    assert "bad.yaml:3: sed: unknown key (value 1), did you mean 'seed'?" in message(
        ConfigError, files
    )


@pytest.mark.parametrize(
    ("argument", "said"),
    [
        ("pixel.low_pass", "must be KEY=VALUE"),
        ("=3", "must be KEY=VALUE"),
        ("pixel..leak=3", "must be KEY=VALUE"),
        ("pixel.leak=[1", "--set pixel.leak: not YAML"),
        ("pixel.leak={rate_hz: 1, rate_hz: 2}", "--set pixel.leak.rate_hz: given twice: keep one"),
        ("pixel.low_pass.cutof_hz=1", "--set pixel.low_pass.cutof_hz: unknown key (value 1), did"),
        ("cutoff_hz=1", "did you mean 'pixel.low_pass.cutoff_hz'?"),
        ("pixel.source_follower={cutoff_hz:20}", "'cutoff_hz: 20' with a space after the colon"),
        ("pixel.leak.rate_hz=-1", "--set pixel.leak.rate_hz: must be at least 0 Hz, got -1"),
        ("sampling.K=1e3", "--set sampling.K: must be a whole number, got 1e3"),
        ("pixel.hot_pixels.fraction=1", "--set pixel.hot_pixels.rate_hz: must be given"),
    ],
)
def test_mistakes_in_set_are_of_usage(argument, said):
    assert said in message(UsageError, (), [argument])


def test_a_wrong_seed_is_of_usage():
    assert message(UsageError, seed=-1) == "--seed: must be at least 0, got -1"


def test_set_is_looked_at_before_any_file(tmp_path):
    message(UsageError, [tmp_path / "absent.yaml"], ["wrong"])


def test_a_value_from_the_file_stays_the_files_fault(write):
    text = message(ConfigError, [write("sampling: {K: 0}")], ["sampling.L=3"])
    assert "c.yaml:1: sampling.K" in text


def test_an_empty_value_in_set_is_null():
    assert load_config(sets=["pixel.leak="]).pixel.leak is None


def full_config():
    return load_config(
        sets=[
            "seed=12345678901234567890",
            "pixel.source_follower={cutoff_hz: 1e3}",
            "pixel.hot_pixels={fraction: 1e-05, rate_hz: 1e22}",
            "pixel.photoreceptor_noise={rms: 0.1}",
            "pixel.refractory=null",
            "readout={arbiter: {event_ns: 100, row_ns: 1e3}, tick_us: 1.5}",
            "frames={encoding: 'gamma:2.2', full_scale: 1023, shift_px: [0.5, -1]}",
        ]
    )


@pytest.mark.parametrize("config", [Config(), full_config()], ids=["defaults", "full"])
def test_writing_and_reading_gives_the_same_configuration(write, config):
    assert load_config([write(to_yaml(config))]) == config
    assert load_config([write(to_annotated_yaml(config))]) == config
    assert from_dict(to_dict(config)) == config
    for text in (to_yaml(config), to_annotated_yaml(config)):
        assert yaml.safe_load(text) == to_dict(config)


@settings(max_examples=50, deadline=None)
@given(
    rate=st.floats(min_value=0, allow_infinity=False),
    cutoff=st.floats(min_value=5e-324, allow_infinity=False),
    seed=st.integers(min_value=0, max_value=2**64 - 1),
)
def test_any_number_survives_the_round_trip(rate, cutoff, seed):
    pixel = Pixel(leak=Leak(rate_hz=rate), low_pass=LowPass(cutoff_hz=cutoff))
    config = Config(seed=seed, pixel=pixel)
    assert build(Config, parse(to_yaml(config), Origin("f"))) == config


def test_to_dict_holds_plain_values():
    values = to_dict(full_config())
    hot = {"fraction": 1e-05, "rate_hz": 1e22, "spread": 0.0, "off_fraction": 0.0}
    assert values["pixel"]["hot_pixels"] == hot
    assert values["pixel"]["refractory"] is None
    assert values["readout"]["arbiter"] == {"event_ns": 100.0, "row_ns": 1000.0}
    assert values["readout"]["loss"] is None
    assert values["frames"]["shift_px"] == [0.5, -1.0]
    assert list(values) == [item.name for item in dataclasses.fields(Config)]


def test_on_given_twice_is_an_error_though_one_is_called_true():
    assert from_dict({"pixel": {"thresholds": {True: 0.3}}}).pixel.thresholds.on == 0.3
    with pytest.raises(ConfigError, match=r"^old\.h5: two keys have the same name: true is on"):
        from_dict({"pixel": {"thresholds": {True: 0.3, "on": 0.2}}}, "old.h5")


def test_from_dict_is_as_strict_as_a_file():
    with pytest.raises(ConfigError, match=r"^old\.h5: pixel\.lek: unknown key .*'leak'\?"):
        from_dict({"pixel": {"lek": None}}, "old.h5")


def test_the_annotated_form_gives_unit_and_meaning():
    text = to_annotated_yaml(Config())
    assert "cutoff_hz: 300.0          # [Hz] corner (-3 dB) at white\n" in text
    assert "# second pole; off\n    # cutoff_hz:              # [Hz] corner (-3 dB)\n" in text
    assert all(len(line) <= 100 for line in text.splitlines())


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("3", r"must be a list of 2 values such as \[0.0, 0.0\], got 3"),
        ("[1]", r"must be a list of 2 values such as \[0.0, 0.0\], got \[1\]"),
        ("[1, x]", r"frames\.shift_px\[1\]: must be a number \[px\], got 'x'"),
        ("[1, .inf]", r"frames\.shift_px: must be a finite number, got inf"),
    ],
)
def test_a_list_of_numbers_is_checked_part_by_part(value, text):
    with pytest.raises(UsageError, match=text):
        load_config(sets=[f"frames.shift_px={value}"])


def test_aliases_within_aliases_are_counted_where_they_stand(tmp_path):
    levels = ["a: &a [x, x, x, x, x, x, x, x, x]"]
    for before, name in zip("abcdefgh", "bcdefghi", strict=True):
        levels.append(f"{name}: &{name} [{', '.join([f'*{before}'] * 9)}]")
    path = tmp_path / "laughs.yaml"
    path.write_text("\n".join(levels))
    assert path.stat().st_size < 500
    with pytest.raises(ConfigError, match=r"laughs\.yaml:1: f\S+: over 100,000 values, aliases"):
        load_config([path])


@pytest.mark.parametrize("text", ["[" * 5000, "{a: " * 5000, "a:\n" + "- " * 5000, "? " * 5000])
@pytest.mark.quick_cases(1)
def test_text_nested_too_deeply(tmp_path, text):
    (tmp_path / "deep.yaml").write_text(text)
    with pytest.raises(ConfigError, match=r"deep\.yaml.*not YAML"):
        load_config([tmp_path / "deep.yaml"])


def test_numbers_of_thousands_of_digits(tmp_path):
    (tmp_path / "long.yaml").write_text(f"seed: {'9' * 5000}\n")
    with pytest.raises(ConfigError, match=r"long\.yaml:1: seed: '9{40}' is not a value of !!int"):
        load_config([tmp_path / "long.yaml"])


@pytest.mark.parametrize("size", ["64by48", "x", 5, (64,), (0, 3), (1.5, 2)])
def test_a_size_that_is_none_is_one_line(size):
    with pytest.raises(UsageError, match=r"^size: must be columns x rows, such as 346x260, got"):
        load_config(size=size)
    assert load_config(size="64x48") == load_config(size=(64, 48))

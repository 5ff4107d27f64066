"""YAML 1.2 core schema: what reads as what, and where a mistake is."""

from __future__ import annotations

import math

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.config.yaml12 import Origin, Value, parse, scalar_text
from adv2e.errors import ConfigError, UsageError

FILE = Origin("f.yaml")


def plain(value: Value):
    """Return a tree as ordinary Python values."""
    if isinstance(value.content, dict):
        return {key: plain(item) for key, item in value.content.items()}
    if isinstance(value.content, list):
        return [plain(item) for item in value.content]
    return value.content


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("true", True),
        ("TRUE", True),
        ("False", False),
        ("yes", "yes"),
        ("no", "no"),
        ("on", "on"),
        ("Off", "Off"),
        ("y", "y"),
        ("null", None),
        ("~", None),
        ("", None),
        ("12", 12),
        ("+12", 12),
        ("-3", -3),
        ("017", 17),
        ("0o17", 15),
        ("0x1F", 31),
        ("1_000", "1_000"),
        ("1e3", 1000.0),
        ("1E-3", 0.001),
        ("1e-05", 1e-05),
        ("5.", 5.0),
        (".5", 0.5),
        ("-2.5e+3", -2500.0),
        (".inf", math.inf),
        ("-.INF", -math.inf),
        ("12:30:00", "12:30:00"),
        ("1:30", "1:30"),
        ("2001-12-14", "2001-12-14"),
        ("'12'", "12"),
        ('"true"', "true"),
        ("!!str 12", "12"),
        ("!!float 1", 1.0),
        ("{cutoff_hz: 2000}", {"cutoff_hz": 2000}),
        ("[1, on, 1e3]", [1, "on", 1000.0]),
        ("{on: 0.2, off: 0.3}", {"on": 0.2, "off": 0.3}),
        ("{<<: 1}", {"<<": 1}),
    ],
)
def test_core_schema(text, value):
    read = plain(parse(text, FILE))
    assert read == value
    assert type(read) is type(value)


def test_nan_is_a_number():
    assert math.isnan(parse(".NaN", FILE).content)


def test_on_and_off_are_plain_keys_in_a_block():
    assert plain(parse("thresholds:\n  on: 1\n  off: 2\n", FILE)) == {
        "thresholds": {"on": 1, "off": 2}
    }


@pytest.mark.parametrize("text", ["{on: 1, off: 2}", "{true: 1, False: 2}", "{TRUE: 1, off: 2}"])
def test_what_yaml_1_1_makes_of_on_and_off_is_read_as_these(text):
    """PyYAML reads a bare on as true, and writes it back as true."""
    assert plain(parse(text, FILE)) == {"on": 1, "off": 2}


def test_every_value_knows_its_line_and_how_it_was_written():
    tree = parse("a: 1\nb:\n  c: 1e3\n", FILE)
    c = tree.content["b"].content["c"]
    assert c.origin == Origin("f.yaml", 3)
    assert c.text == "1e3"


def test_an_alias_is_its_anchor():
    assert plain(parse("a: &x {b: 1}\nc: *x\n", FILE)) == {"a": {"b": 1}, "c": {"b": 1}}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1\nb: 2\na: 3\n", "f.yaml:3: a: given twice (first on line 1)"),
        ("a:\n  b: 1\n  b: 1\n", "f.yaml:3: a.b: given twice"),
        ("a: {b: 1, b: 2}", "f.yaml:1: a.b: given twice"),
        ("x: 1\n1: 2\n", "f.yaml:2: a key must be text, got 1"),
        ("null: 2\n", "a key must be text, got null"),
        (
            "a:\n  on: 1\n  true: 2\n",
            "a.on: given twice (first on line 2) (a key true is on): keep",
        ),
        ("a: {False: 1, off: 2}", "f.yaml:1: a.off: given twice (first on line 1): keep one"),
        ("a: {b: 0,2}\n", "got 2: numbers have a decimal point, not a comma"),
        ("? {a: 1}\n: 2\n", "a key must be text, got a mapping"),
        ("a: [1, 2\n", "f.yaml:2: not YAML"),
        ("a: 1\n\tb: 2\n", "f.yaml:2: not YAML"),
        ("a: 1\n---\nb: 2\n", "f.yaml:2: not YAML: expected a single document"),
        ("a: 1\nb: \x01\n", "f.yaml:2: not YAML: the character '\\x01'"),
        ("a: !!python/name:os.system x\n", "f.yaml:1: a: unknown tag !!python/name:os.system"),
        ("a: !mine 1\n", "unknown tag !mine"),
        ("a: !!int x\n", "'x' is not a value of !!int"),
        ("a: &x [*x]\n", "must not contain itself"),
        ("a: " + "[" * 5000, "nested too deeply"),
        ("a: 1" + "0" * 5000, "is not a value of !!int"),
    ],
)
@pytest.mark.thorough
def test_a_mistake_is_one_line_with_its_place(text, message):
    with pytest.raises(ConfigError) as caught:
        parse(text, FILE)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_mistake_on_the_command_line_is_one_of_usage():
    with pytest.raises(UsageError, match=r"--set a\.b: not YAML"):
        parse("[1", Origin("--set", on_command_line=True), "a.b")


def test_a_long_value_is_cut_in_messages():
    assert len(str(parse("[" + "1, " * 100 + "1]", FILE))) == 60


@given(st.floats(allow_nan=False))
def test_floats_read_back_exactly_under_both_schemas(number):
    text = scalar_text(number)
    for read in (parse(text, FILE).content, yaml.safe_load(text)):
        assert read == number
        assert type(read) is float


@pytest.mark.parametrize(
    ("number", "text"),
    [(300.0, "300.0"), (1e-05, "1.0e-05"), (1.5e300, "1.5e+300"), (-1e16, "-1.0e+16")],
)
def test_floats_are_short(number, text):
    assert scalar_text(number) == text


def test_nan_reads_back():
    assert math.isnan(parse(scalar_text(math.nan), FILE).content)


@settings(max_examples=200)
@given(st.text() | st.sampled_from(["on", "no", "Null", "~", "1e3", "a: b", "a #b", "", " x", "é"]))
@pytest.mark.thorough
def test_texts_read_back_exactly_under_both_schemas(text):
    written = scalar_text(text)
    assert "\n" not in written
    assert parse(f"a: {written}", FILE).content["a"].content == text
    assert yaml.safe_load(f"a: {written}") == {"a": text}


@pytest.mark.parametrize("text", ["auto", "gamma:2.2", "first_order_hold"])
def test_plain_words_are_not_quoted(text):
    assert scalar_text(text) == text


@pytest.mark.parametrize("value", [None, True, False, 0, -7, 10**30])
def test_other_scalars_read_back(value):
    read = parse(scalar_text(value), FILE).content
    assert read == value
    assert type(read) is type(value)

"""``adv2e protocol``: what it says is so."""

import re
import shlex

import pytest

from adv2e.cli.diagnose import command as diagnose
from adv2e.cli.protocol import TEXT
from adv2e.config import load_config
from adv2e.diagnosis.fitting.library import OF_FRAMES, names
from adv2e.diagnosis.known_light import read_stimulus
from adv2e.geometry import Rectangle, Size


def test_it_is_printed_and_fits_a_terminal(adv2e):
    status, out, err = adv2e("protocol")
    assert (status, err) == (0, "")
    assert out == TEXT
    assert max(map(len, out.splitlines())) <= 100


def test_the_effects_that_it_names_are_those_of_the_library():
    words = set(re.findall(r"\b[a-z]+(?:_[a-z]+)+\b", TEXT)) - {"time_s", "light_dn"}
    known = {*names()} - {*OF_FRAMES}
    assert words - known == {"initial_reference"} - known
    unnamed = known - set(re.findall(r"\w+", TEXT))
    told_by_the_events_alone = {
        *("event_loss", "timestamp_tick", "clock_drift", "dead_pixels", "double_read")
    }
    rest = {"dark_current", "photoreceptor_noise", "threshold_mismatch"}
    assert unnamed <= told_by_the_events_alone | rest


@pytest.mark.parametrize("column", ["light_dn", "light_dn 150 110 30 30"])
def test_its_table_is_one_that_a_diagnosis_reads(tmp_path, column):
    rows = re.findall(r"^  ([\d.]+,\d+)(?: .*)?$", TEXT, re.MULTILINE)
    assert len(rows) == 7
    path = tmp_path / "stimulus.csv"
    path.write_text("\n".join([f"time_s,{column}", *rows]), "ascii")
    course, part = read_stimulus(path, Size(346, 260))
    whole = column == "light_dn"
    assert part == (Rectangle(0, 0, 346, 260) if whole else Rectangle(150, 110, 30, 30))
    assert len(course.leaps.times_us[0]) == 2


def test_its_command_and_its_configuration_are_read(tmp_path):
    (line,) = re.findall(r"^  adv2e diagnose (.*)$", TEXT, re.MULTILINE)
    given = diagnose.make_parser(diagnose.make_context("diagnose", ["a"], resilient_parsing=True))
    options, arguments, _ = given.parse_args(shlex.split(line))
    assert arguments == ["led.raw"] or options["recordings"] == ("led.raw",)
    assert options["light"] == "stimulus.csv"
    (text,) = re.findall(r"'(pixel: .*?)'", TEXT)
    (tmp_path / "declared.yaml").write_text(text, "ascii")
    config = load_config([tmp_path / "declared.yaml"])
    assert config.pixel.initial_reference == "random"

"""The commands: help of each, what convert passes on, config, effects."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import click
import numpy as np
import pytest

import adv2e as package
from adv2e.background import default_threads
from adv2e.cli import COMMANDS, main
from adv2e.cli.options import Log
from adv2e.config import Config, all_keys, load_config, shipped
from adv2e.config.files import find
from adv2e.config.model import Pixel
from adv2e.diagnosis.fitting.library import names
from adv2e.effects import EFFECTS, STAGES
from adv2e.formats import registry


@pytest.mark.parametrize("option", ["--version", "-V"])
def test_version(adv2e, option):
    assert adv2e(option) == (0, f"adv2e {package.__version__}\n", "")


def test_help_lists_every_command_with_a_line(adv2e):
    outcome = adv2e("--help")
    assert outcome.status == 0
    assert '_ADV2E_COMPLETE=bash_source adv2e)"\n' in outcome.out
    for name, line in COMMANDS.items():
        assert re.search(rf"^  {name} +{re.escape(line)}$", outcome.out, re.MULTILINE)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_and_option_has_help(name):
    command = main.get_command(click.Context(main), name)
    assert command.name == name
    assert command.help
    for option in command.params:
        if isinstance(option, click.Option):
            assert option.help, option.name


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_every_command_can_be_shown(adv2e, name):
    outcome = adv2e(name, "--help")
    assert outcome.status == 0
    assert outcome.out.startswith(f"Usage: adv2e {name}")


@pytest.mark.parametrize("command", COMMANDS)
def test_examples_in_the_help_stand_line_by_line(adv2e, command):
    lines = adv2e(command, "--help").out.splitlines()
    assert "  Examples:" in lines
    assert max(map(len, lines)) <= 100
    assert any(line.startswith(f"    adv2e {command}") for line in lines)


def test_the_help_of_convert_names_what_can_be_written(adv2e):
    out = " ".join(adv2e("convert", "--help").out.split())
    named = re.search(r"Write this format, whatever the suffix. One of: ([a-z0-9, ]+)\.", out)
    assert re.split(", | or ", named[1]) == registry.names()
    known = registry.layouts()
    assert f"Layout of an HDF5 output. One of: {', '.join(known)}. [default: {known[0]}]" in out


def test_convert_passes_its_options_on(adv2e, pipeline):
    outcome = adv2e(
        *("convert", "frames", "-o", "out.h5", "-c", "ideal", "--set", "sampling.L=3"),
        *("--seed", "7", "--threads", "2", "--overwrite", "--progress", "--start", "0.5"),
        *("--stop", "2", "--t0", "keep", "--timestamps", "t.txt", "--format", "h5"),
        *("--time-unit", "us", "--crop", "1,2,30,20", "--size", "8x6", "--bayer", "gbrg"),
        *(
            "--rotate180",
            "--layout",
            "dsec",
            "--with-frames",
            "--preview",
            "p.gif",
            "--allow-damaged",
        ),
        *("--causes", "--motion", "pan", "--extent", "9", "--stream", "1", "--strict"),
    )
    assert outcome.status == 0
    ((reading, output, options),) = pipeline.calls
    assert (reading.path, output, reading.threads) == ("frames", "out.h5", 2)
    assert reading.options == {
        "fps": None,
        "timestamps": Path("t.txt"),
        "time_unit": "us",
        "start_s": 0.5,
        "stop_s": 2.0,
        "t0": "keep",
        "allow_damaged": True,
        "crop": (1, 2, 30, 20),
        "bayer": "GBRG",
        "pixel_format": None,
        "network": False,
        "size": (8, 6),
        "rotate180": True,
        "motion": "pan",
        "extent_px": 9.0,
        "duration_s": None,
        "track": "1",
    }
    log = options.pop("log")
    assert options == {
        "config": load_config(["ideal"], ["sampling.L=3"], 7, size=(8, 6)),
        "format": "h5",
        "layout": "dsec",
        "with_frames": True,
        "overwrite": True,
        "preview": "p.gif",
        "side": None,
        "blurred_frames": None,
        "causes": True,
        "progress": True,
        "also_read": [find("ideal")],
        "doubt": None,
        "source_sha256": None,
        "strict": True,
    }
    assert log.level == 0


def test_convert_by_default(adv2e, pipeline):
    adv2e("convert", "clip.mp4")
    ((reading, output, options),) = pipeline.calls
    assert (reading.path, output, reading.threads) == ("clip.mp4", None, default_threads())
    assert options["config"] == Config()
    assert reading.options.pop("t0") == "auto"
    assert set(reading.options.values()) == {None, False}
    assert options["progress"] is False  # stderr is not a terminal here
    assert options["format"] is options["layout"] is None


def test_progress_is_shown_on_a_terminal_unless_quiet(adv2e, pipeline, monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    for args in ([], ["-q"], ["--no-progress"], ["-q", "--progress"]):
        adv2e("convert", "clip.mp4", *args)
    assert [call[2]["progress"] for call in pipeline.calls] == [True, False, False, True]


def test_the_summary_stays_out_of_the_events(adv2e, pipeline):
    assert adv2e("convert", "clip.mp4", "-o", "-") == (0, "", "the summary\n")


def test_quiet_says_nothing(adv2e, pipeline):
    assert adv2e("convert", "clip.mp4", "-q") == (0, "", "")


@pytest.mark.parametrize(
    ("flags", "heard"), [([], "a"), (["-q"], ""), (["-v"], "ab"), (["-vv"], "abc")]
)
def test_verbosity_decides_what_is_said(adv2e, pipeline, flags, heard):
    adv2e("convert", "clip.mp4", *flags)
    log = pipeline.calls[0][2]["log"]
    assert isinstance(log, Log)
    said = "".join(text for level, text in enumerate("abc") if log.level >= level)
    assert said == heard


def test_the_log_writes_to_stderr(capsys):
    log = Log(0)
    log("note")
    log("detail", 1)
    Log(-1)("silenced")
    assert capsys.readouterr() == ("", "note\n")


def test_config_show_prints_the_resolved_configuration(adv2e, tmp_path):
    args = ["-c", "v2e", "--set", "pixel.leak=null", "--seed", "4"]
    outcome = adv2e("config", "show", *args)
    assert outcome.status == 0
    assert "# [Hz] corner (-3 dB) at white" in outcome.out
    path = tmp_path / "shown.yaml"
    path.write_text(outcome.out)
    assert load_config([path]) == load_config(["v2e"], ["pixel.leak=null"], 4)


def test_config_alone_is_show(adv2e):
    assert adv2e("config").out == adv2e("config", "show").out
    assert adv2e("config", "-c", "v2e").out == adv2e("config", "show", "-c", "v2e").out


def test_config_defaults_has_every_key(adv2e, tmp_path):
    out = adv2e("config", "defaults").out
    path = tmp_path / "defaults.yaml"
    path.write_text(out)
    assert load_config([path]) == Config()
    for key in all_keys():
        assert re.search(rf'^ *(# *)?"?{key.name}"?:', out, re.MULTILINE), key.path
        assert key.about.meaning[:30] in out, key.path


def test_config_check(adv2e, tmp_path):
    good, bad = tmp_path / "good.yaml", tmp_path / "bad.yaml"
    good.write_text("seed: 1\n")
    bad.write_text("seed: x\n")
    assert adv2e("config", "check", good) == (0, f"{good}: ok\n", "")
    outcome = adv2e("config", "check", bad)
    assert outcome.status == 1
    assert outcome.err == (f"adv2e: error: {bad}:1: seed: must be a whole number, got 'x'\n")


def test_config_check_knows_effects_of_ones_own(adv2e, tmp_path):
    effect, saved = tmp_path / "off.py", tmp_path / "saved.yaml"
    effect.write_text(
        "from dataclasses import dataclass\n"
        "from adv2e.effects.hooks import Hooks\n"
        "from adv2e.parameters import Section\n\n"
        "@dataclass(frozen=True, kw_only=True)\n"
        "class Nothing(Section):\n    'None.'\n\n"
        "class Off(Hooks):\n    'Does nothing.'\n    stage = 'readout'\n    Parameters = Nothing\n"
        "    def events(self, chunks):\n        yield from chunks\n"
    )
    shown = adv2e("config", "show", "--effect", effect)
    assert shown.status == 0, shown.err
    saved.write_text(shown.out)
    assert adv2e("config", "check", saved, "--effect", effect) == (0, f"{saved}: ok\n", "")
    assert "--effect FILE.py" in adv2e("config", "check", saved).err


def test_config_takes_distributions_and_others_say_who_draws(adv2e, tmp_path):
    path, saved = tmp_path / "c.yaml", tmp_path / "shown.yaml"
    path.write_text('pixel: {thresholds: {"on": {uniform: [0.1, 0.5]}}}')
    assert adv2e("config", "check", path) == (0, f"{path}: ok\n", "")
    shown = adv2e("config", "show", "-c", path, "--set", "sampling.L={choice: [5, 10]}")
    assert "'adv2e batch' draws what is in braces" in shown.out.splitlines()[0]
    assert re.search(r'^    "on": \{uniform: \[0.1, 0.5\]\}  +# \[ln\]', shown.out, re.MULTILINE)
    assert "  L: {choice: [5, 10]}" in shown.out
    saved.write_text(shown.out)
    assert adv2e("config", "show", "-c", saved).out == shown.out
    path.write_text('pixel: {thresholds: {"on": {uniform: [0.5, 0.1]}}}')
    assert ":1: pixel.thresholds.on.uniform: must be [a, b]" in adv2e("config", "check", path).err
    for words in (
        ("convert", "clip.mp4", "-o", tmp_path / "a.h5"),
        ("diagnose", "a.zip", "-o", tmp_path / "found"),
        ("compare", "a.h5", "b.h5"),
    ):
        outcome = adv2e(*words, "-c", saved)
        assert outcome.status == 1
        assert re.fullmatch(r"adv2e: error: .*'adv2e batch' draws.*\n", outcome.err)


def test_config_help_names_what_is_shipped(adv2e):
    out = adv2e("config", "--help").out
    assert all(re.search(rf"\b{name}\b", out) for name in shipped())


def test_config_list_tells_what_is_shipped_a_line_each(adv2e):
    lines = adv2e("config", "list").out.splitlines()
    assert [line.split()[0] for line in lines] == shipped()
    assert all(len(line.split()) > 3 for line in lines)


def test_config_show_and_check_take_files_with_and_without_an_option(adv2e, tmp_path):
    path = tmp_path / "c.yaml"
    path.write_text("seed: 3\n")
    shown = adv2e("config", "show", "-c", "davis346", "-c", path)
    assert shown.status == 0
    assert adv2e("config", "show", "davis346", path) == shown
    assert adv2e("config", "check", "-c", path) == (0, f"{path}: ok\n", "")
    assert adv2e("config", "check", path, "--set", "seed=x").status == 2
    assert adv2e("config", "check") == (2, "", adv2e("config", "check").err)


def test_the_template_holds_the_sensor_and_all_else_as_comments(adv2e, tmp_path):
    outcome = adv2e("config", "template", "davis346")
    path = tmp_path / "declared.yaml"
    path.write_text(outcome.out)
    assert load_config(path) == load_config([], ["sensor={width: 346, height: 260, fit: crop}"])
    head, _, rest = outcome.out.partition("# pixel:\n")
    path.write_text(f"{head}pixel:\n" + re.sub("(?m)^# ", "", rest))
    assert load_config(path).pixel == load_config("davis346").pixel
    refused = adv2e("config", "template", "v2e")
    assert refused.status == 1
    assert "must be one of atis, davis240c, davis346, gen4" in refused.err


@pytest.mark.parametrize("name", ["DAVIS346", "Davis346", "davis364"])
def test_a_shipped_name_that_is_nearly_right_is_told_the_nearest(adv2e, name):
    outcome = adv2e("config", "show", name)
    assert outcome.status == 1
    assert "did you mean 'davis346'?" in outcome.err


def test_help_is_a_command_too(adv2e):
    assert adv2e("help") == adv2e("--help")
    assert adv2e("help", "convert") == adv2e("convert", "--help")
    assert adv2e("help", "config", "show") == adv2e("config", "show", "--help")
    assert adv2e("help", "convrt").status == 2


def test_many_options_stand_in_groups_and_each_once(adv2e):
    command = main.get_command(click.Context(main), "convert")
    out = adv2e("convert", "--help").out
    titles = re.findall(r"^(\w[\w ]+):$", out, re.MULTILINE)
    assert titles == ["Input", "Sensor and pixel", "Output", "Running"]
    for option in (one for one in command.params if isinstance(one, click.Option)):
        first = next(name for name in option.opts if name.startswith("--"))
        assert len(re.findall(rf"^  (?:-\w, )?{first}(?![\w-])", out, re.MULTILINE)) == 1
    assert "-h, --help" in out


@pytest.mark.parametrize("name", [*(one for one in COMMANDS if one not in ("config", "effects"))])
def test_every_command_that_works_can_be_quiet_and_show_its_progress(name):
    names = {item.name for item in main.get_command(click.Context(main), name).params}
    if name != "protocol":
        assert names >= {"quiet", "verbose", "progress"}


def test_a_film_or_a_folder_of_videos_is_told_the_command_that_is_meant(adv2e, tmp_path):
    np.save(tmp_path / "c.npy", np.full((3, 4, 5), 0.5, np.float32))
    outcome = adv2e("convert", tmp_path / "c.npy", "--fps", 9, "-o", tmp_path / "e.mp4")
    assert outcome.status == 2
    assert "--preview" in outcome.err
    assert "adv2e render" in outcome.err
    (tmp_path / "videos").mkdir()
    (tmp_path / "videos" / "a.mp4").touch()
    outcome = adv2e("convert", tmp_path / "videos")
    assert outcome.status == 1
    assert f"'adv2e batch {tmp_path / 'videos'} DEST'" in outcome.err


def test_a_mistyped_config_command_is_of_usage(adv2e):
    outcome = adv2e("config", "chek")
    assert outcome.status == 2
    assert "chek" in outcome.err


def test_effects_lists_all_by_stage_in_signal_order(adv2e):
    out = adv2e("effects").out
    places = [out.index(f"\n  {effect.name} ") for effect in EFFECTS]
    assert places == sorted(places)
    assert out.index("frames:") < out.index("pixel:")
    assert "pixel.low_pass.cutoff_hz" in out


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_an_effect_has_a_page_with_physics_parameters_and_references(adv2e, effect):
    outcome = adv2e("effects", effect.name)
    assert outcome.status == 0
    assert outcome.out.startswith(effect.summary())
    assert "References\n----------\n[1] " in outcome.out
    keys = [key for key in all_keys() if key.path.startswith(tuple(effect.paths))]
    for key in keys:
        if not key.is_section:
            assert re.search(rf"^{re.escape(key.path)}(?: \[.+\])?$", outcome.out, re.MULTILINE)
            assert key.about.meaning in " ".join(outcome.out.split())


@pytest.mark.parametrize("name", ["", *(effect.name for effect in EFFECTS)])
def test_effects_are_told_in_plain_characters_that_fit_a_terminal(adv2e, name):
    out = adv2e("effects", *filter(None, [name])).out
    assert out.isascii()
    assert not re.search(r"[`\\$]|\.\. |\]_|\^\{|_\{|====", out)
    assert max(map(len, out.splitlines())) <= 100


def test_an_equation_stands_in_a_line_of_its_own(adv2e):
    assert "\n    dy/dt = 2 pi f(t) (x - y)," in adv2e("effects", "low_pass").out


@pytest.mark.parametrize("name", names())
def test_every_name_that_a_diagnosis_tells_has_a_page(adv2e, name):
    assert adv2e("effects", name).status == 0


def test_the_page_gives_unit_default_range_and_source(adv2e):
    out = adv2e("effects", "low_pass").out
    corner = r"^pixel\.low_pass\.cutoff_hz \[Hz\]\n    corner .*\n    default 300\.0, above 0\n"
    assert re.search(corner + "    source: v2e default$", out, re.M)
    assert "By default the effect is on" in out
    out = adv2e("effects", "source_follower").out
    assert re.search(r"^pixel\.source_follower\.cutoff_hz \[Hz\]$", out, re.M)
    assert "\n    no default, above 0\n" in out
    assert "By default the effect is off" in out


def test_an_unknown_effect_is_of_usage_and_told_the_nearest(adv2e):
    outcome = adv2e("effects", "lowpass")
    assert outcome.status == 2
    assert "did you mean 'low_pass'?" in outcome.err


def test_all_effects_or_one_of_them(adv2e):
    outcome = adv2e("effects", "leak", "--all")
    assert (outcome.status, outcome.out) == (2, "")
    assert "NAME and --all" in outcome.err


def test_the_table_of_effects_agrees_with_the_configuration():
    sections = [
        item.name
        for item, key in zip(
            dataclasses.fields(Pixel),
            (key for key in all_keys() if re.fullmatch(r"pixel\.\w+", key.path)),
            strict=True,
        )
        if key.is_section
    ]
    with_sections = [
        effect.name for effect in EFFECTS if effect.stage == "pixel" and not effect.own_paths
    ]
    assert with_sections == sections
    paths = {key.path for key in all_keys()}
    for effect in EFFECTS:
        assert effect.stage in STAGES
        assert set(effect.paths) <= paths

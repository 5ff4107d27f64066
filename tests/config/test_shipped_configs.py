"""The configurations in configs/: they load, are what they say, and cite their numbers."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
import pytest
import yaml

from adv2e.config import (
    Config,
    all_keys,
    files,
    load_config,
    load_family,
    shipped,
    to_dict,
)
from adv2e.errors import ConfigError

NAMES = ["adv2e", "atis", "davis240c", "davis346", "gen4", "ideal", "paper", "v2e", "vid2e"]
RANDOM = ["train-e2vid", "train-ecnn", "train-v2e", "train-v2e-dark"]
"""Those from which only batches draw."""


def test_these_are_shipped():
    assert shipped() == sorted([*NAMES, *RANDOM])


@pytest.mark.parametrize("name", NAMES)
def test_it_loads_by_name_and_by_path(name):
    assert load_config([name]) == load_config([files.shipped_folder() / f"{name}.yaml"])


def test_adv2e_is_the_defaults_and_gives_every_key():
    assert load_config(["adv2e"]) == Config()
    tree = files.read("adv2e")
    for key in all_keys():
        inside = tree
        for part in key.path.split("."):
            if inside is not None and inside.content is not None:
                assert part in inside.content, key.path
                inside = inside.content[part]


@pytest.mark.parametrize("name", [*NAMES, *RANDOM])
def test_a_reader_of_yaml_1_1_reads_the_same(name):
    text = (files.shipped_folder() / f"{name}.yaml").read_text(encoding="utf-8")
    assert load_family(yaml.safe_load(text)).written() == load_family(name).written()
    assert not re.search(r"^\s*(on|off):", text, re.MULTILINE)


@pytest.mark.parametrize("name", [*NAMES, *RANDOM])
def test_every_number_has_a_comment(name):
    lines = (files.shipped_folder() / f"{name}.yaml").read_text(encoding="utf-8").splitlines()
    number = re.compile(r"\s*\"?\w+\"?:\s*([-+.\d][-+.\deE]*|\{.*\})\s*")
    bare = [
        line
        for before, line in pairwise(lines)
        if number.fullmatch(line) and not before.lstrip().startswith("#")
    ]
    assert [line for line in bare if line != "seed: 0"] == []


@pytest.mark.parametrize("name", ["paper", "v2e", "vid2e"])
def test_those_named_after_a_tool_say_that_they_are_not_the_tool(name):
    head = (files.shipped_folder() / f"{name}.yaml").read_text(encoding="utf-8").split("\n\n")[0]
    assert "in our pixel" in " ".join(head.replace("#", "").split())


def test_paper_is_as_printed():
    config = load_config(["paper"])
    assert config.pixel.low_pass.update == "paper"
    assert config.sampling.last_interval == "printed"
    assert (config.sampling.L, config.sampling.K) == (10, 10)
    assert config.frames.encoding == "linear"


def test_v2e_has_the_defaults_of_its_command_line():
    pixel = load_config(["v2e"]).pixel
    assert (pixel.thresholds.on, pixel.thresholds.off, pixel.thresholds.mismatch) == (
        0.2,
        0.2,
        0.03,
    )
    assert (pixel.leak.rate_hz, pixel.leak.jitter, pixel.shot_noise.rate_hz) == (0.01, 0.1, 0.001)
    assert pixel.refractory.period_us == 500.0
    assert pixel.low_pass.update == "euler"
    assert pixel.low_pass.dark_cutoff_hz == pytest.approx(pixel.low_pass.cutoff_hz * 20 / 275, 1e-2)


@pytest.mark.parametrize("name", RANDOM)
def test_those_that_are_drawn_go_over_every_pixel_and_no_other_command_takes_them(name):
    with pytest.raises(ConfigError, match=rf"{name}\.yaml:\d+: pixel\..* 'adv2e batch' draws"):
        load_config([name])
    own = load_family(name).forms
    assert own
    for under in NAMES:
        family = load_family([under, name])
        assert family.forms == own
        first, second = family.of(1), family.of(2)
        assert first[1].keys() == own.keys()
        assert all(first[1][key] != second[1][key] for key in own if "choice" not in own[key])


@pytest.mark.thorough
def test_those_that_are_drawn_are_as_their_sources_say():
    spreads = {}
    for name in RANDOM:
        family = load_family(["vid2e" if name in RANDOM[:2] else "v2e", name])
        spreads[name] = [family.of(seed)[0].pixel for seed in range(400)]
    on = np.array([pixel.thresholds.on for pixel in spreads["train-e2vid"]])
    off = np.array([pixel.thresholds.off for pixel in spreads["train-e2vid"]])
    for found in (on, off):
        assert found.mean() == pytest.approx(0.18, abs=5 * 0.03 / 20)
        assert found.std() == pytest.approx(0.03, rel=5 / np.sqrt(2 * 400))
    assert abs(np.corrcoef(on, off)[0, 1]) < 0.25
    on = np.array([pixel.thresholds.on for pixel in spreads["train-ecnn"]])
    ratios = np.array([pixel.thresholds.off for pixel in spreads["train-ecnn"]]) / on
    assert {*on.tolist()} == {round(0.1 * k + 0.1, 1) for k in range(11)}
    assert ratios.mean() == pytest.approx(1, abs=5 * 0.1 / 20)
    assert ratios.std() == pytest.approx(0.1, rel=5 / np.sqrt(2 * 400))
    for name in ("train-v2e", "train-v2e-dark"):
        for pixel in spreads[name]:
            assert 0.2 < pixel.thresholds.on == pixel.thresholds.off < 0.5
            assert 0.03 < pixel.thresholds.mismatch < 0.05
            dark = pixel.low_pass.cutoff_hz * 20 / 275
            assert pixel.low_pass.dark_cutoff_hz == pytest.approx(dark, 5e-3)
    for pixel in spreads["train-v2e-dark"]:
        assert pixel.low_pass.cutoff_hz == 10 * pixel.shot_noise.rate_hz
        assert 10 < pixel.low_pass.cutoff_hz < 100
    assert all(0.1 < pixel.leak.rate_hz < 0.5 for pixel in spreads["train-v2e"])


@pytest.mark.parametrize("name", ["adv2e", "davis240c", "davis346", "gen4"])
def test_cameras_have_run_before_in_good_light(name):
    pixel = load_config([name]).pixel
    assert pixel.initial_reference == "running"
    assert pixel.leak is None
    noise = (pixel.shot_noise, pixel.photoreceptor_noise)
    assert sum(one is not None for one in noise) == 1


def test_the_davis_cameras_see_light_that_their_frames_lack():
    for name in ("davis240c", "davis346"):
        config = load_config([name])
        assert (config.frames.black_level_dn, config.pixel.log_response.linear_below) == (10, 0)
        assert config.pixel.dark_current is None  # which would light up what is dark in truth


@pytest.mark.parametrize("name", ["vid2e", "ideal"])
def test_these_have_neither_filter_nor_noise(name):
    pixel = to_dict(load_config([name]).pixel)
    on = {key for key, value in pixel.items() if isinstance(value, dict)}
    assert on == {"log_response", "thresholds"}
    assert pixel["thresholds"]["mismatch"] == 0.0


def test_an_unknown_name_lists_the_names():
    with pytest.raises(ConfigError, match=r"v2: no such file .*'v2e'\?.* adv2e, atis, davis"):
        load_config(["v2"])


def test_a_shipped_name_with_suffix_is_put_right():
    with pytest.raises(ConfigError, match=r"^v2e\.yaml: no such file \(the shipped one: -c v2e\)$"):
        load_config(["v2e.yaml"])


def test_a_missing_file_is_named(tmp_path):
    path = tmp_path / "absent.yaml"
    with pytest.raises(ConfigError, match=re.escape(f"{path}: no such file")):
        load_config([path])


def test_a_file_of_the_same_name_comes_before_a_shipped_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "v2e").write_text("seed: 99")
    assert load_config(["v2e"]).seed == 99


def test_a_folder_of_the_same_name_does_not_hide_a_shipped_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "v2e").mkdir()
    (tmp_path / "mine").mkdir()
    assert load_config(["v2e"]).pixel.low_pass.update == "euler"
    with pytest.raises(ConfigError, match="mine: is a folder"):
        load_config(["mine"])


def test_a_file_that_is_not_text_is_refused(tmp_path):
    path = tmp_path / "c.yaml"
    path.write_bytes(b"seed: \xff\xfe")
    with pytest.raises(ConfigError, match="byte 6 is not UTF-8"):
        load_config([path])


def test_in_an_installed_package_they_are_inside_it(tmp_path, monkeypatch):
    package = tmp_path / "adv2e"
    (package / "config").mkdir(parents=True)
    monkeypatch.setattr(files, "__file__", str(package / "config" / "files.py"))
    assert files.shipped_folder() == tmp_path / "configs"
    (package / "configs").mkdir()
    (package / "configs" / "only.yaml").write_text("seed: 5")
    assert files.shipped() == ["only"]
    assert load_config(["only"]).seed == 5

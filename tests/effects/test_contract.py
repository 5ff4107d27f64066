"""What must hold of every effect of the pixel."""

import ast
import dataclasses
import importlib
import inspect
import re
from pathlib import Path

import numpy as np
import pytest
from harness import advance, quiet, start

import adv2e.effects
from adv2e.config import Config, from_dict, to_dict
from adv2e.config.model import (
    HighPass,
    HotPixels,
    Leak,
    LogResponse,
    LowPass,
    PhotoreceptorNoise,
    Pixel,
    Refractory,
    ResetOvershoot,
    ShotNoise,
    SlewLimit,
    SourceFollower,
    Thresholds,
)
from adv2e.effects import EFFECTS
from adv2e.parameters import Section

# for each section: parameters that do something here, and neutral ones (None: being absent)
CASES = {
    "log_response": (LogResponse(linear_below=60.0), LogResponse(linear_below=20.0, floor=0.5)),
    "low_pass": (LowPass(cutoff_hz=120.0), LowPass()),
    "slew_limit": (SlewLimit(per_s=20.0), None),
    "source_follower": (SourceFollower(cutoff_hz=300.0), None),
    "high_pass": (HighPass(cutoff_hz=10.0), None),
    "thresholds": (Thresholds(mismatch=0.05), Thresholds(mismatch=0.0)),
    "refractory": (Refractory(period_us=3000.0), Refractory(period_us=1e-9)),
    "reset_overshoot": (ResetOvershoot(fraction=0.2), ResetOvershoot(fraction=0.0)),
    "leak": (Leak(rate_hz=30.0, jitter=0.1), Leak(rate_hz=0.0)),
    "shot_noise": (ShotNoise(rate_hz=50.0), ShotNoise(rate_hz=0.0)),
    "photoreceptor_noise": (PhotoreceptorNoise(rms=0.08), PhotoreceptorNoise(rms=0.0)),
    "hot_pixels": (
        HotPixels(fraction=0.2, rate_hz=90.0),
        HotPixels(fraction=0.0, rate_hz=90.0),
    ),
}
SECTIONS = [f.name for f in dataclasses.fields(Pixel) if f.name != "initial_reference"]
CLASSES = {name: type(case[0]) for name, case in CASES.items()}


def events(pixel):
    x = np.arange(96)
    light = np.stack(
        [(90 + 70 * np.sin(0.2 * x - 0.3 * k))[None].astype(np.float32) for k in range(16)]
    )
    times = [k * 4_000_000 for k in range(16)]
    return advance(start(light, times, pixel, seed=8), light, times)[0]


def test_every_section_is_tested():
    # the others work through hooks, and are tested as those are
    assert set(CASES) == set(SECTIONS) - {"dark_current", "dead_pixels"}


def test_every_effect_has_a_test_of_its_name():
    here = Path(__file__).parent
    modules = Path(adv2e.effects.__file__).parent.glob("*/*.py")
    names = [module.stem for module in modules if module.stem != "__init__"]
    assert len(names) >= len(EFFECTS)
    assert not [name for name in names if not (here / f"test_{name}.py").exists()]


@pytest.mark.parametrize("name", CASES)
def test_does_something(name):
    assert events(quiet(**{name: CASES[name][0]})).tobytes() != events(quiet()).tobytes()


@pytest.mark.parametrize("name", CASES)
def test_neutral_equals_absent(name):
    found, plain = events(quiet(**{name: CASES[name][1]})), events(quiet())
    if name == "refractory":
        # a dead time of nothing takes the reference at the crossing: a hair past the threshold
        assert np.array_equal(found[["x", "y", "p"]], plain[["x", "y", "p"]])
        assert np.abs(found["t"] - plain["t"]).max() <= 1
    else:
        assert found.tobytes() == plain.tobytes()


@pytest.mark.parametrize("name", CASES)
def test_same_seed_same_events(name):
    pixel = quiet(**{name: CASES[name][0]})
    assert events(pixel).tobytes() == events(pixel).tobytes()


@pytest.mark.parametrize("name", CASES)
def test_survives_a_round_trip_through_text(name):
    config = Config(pixel=quiet(**{name: CASES[name][0]}))
    assert from_dict(to_dict(config)) == config


@pytest.mark.parametrize("name", CASES)
def test_says_what_it_is(name):
    section = CLASSES[name]
    module = importlib.import_module(section.__module__)
    assert section.__doc__
    assert re.search(r"doi:10\.|arXiv:", module.__doc__), "the module names no source"
    for field in dataclasses.fields(section):
        declared = field.metadata["parameter"]
        assert declared.unit, field.name
        assert declared.meaning, field.name
        fit = declared.fit
        if fit is not None:
            assert declared.complaint(fit.low) is declared.complaint(fit.high) is None
    # what is known of a circuit, not measured, is nothing to fit; tables alone tell off_fraction
    fitted = {
        f.name for f in dataclasses.fields(section) if f.metadata["parameter"].fit is not None
    }
    given = {"linear_below", "floor", "update", "jitter", "step", "off_fraction"}
    assert fitted | given >= {f.name for f in dataclasses.fields(section)}


@pytest.mark.parametrize("name", CASES)
def test_effects_do_not_import_each_other(name):
    module = importlib.import_module(CLASSES[name].__module__)
    for node in ast.walk(ast.parse(inspect.getsource(module))):
        if isinstance(node, ast.ImportFrom):
            assert not (node.module or "").startswith("adv2e.effects"), node.module


def test_no_section_is_without_a_check():
    assert all(issubclass(section, Section) for section in CLASSES.values())

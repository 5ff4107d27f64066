"""Effects of the user's own: files, their errors, their part of the configuration."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from adv2e import load_config, simulate
from adv2e.config import Config, from_dict, to_annotated_yaml, to_dict, to_yaml
from adv2e.config.active_effects import active_hooks
from adv2e.config.user_effects import load_effects
from adv2e.diagnosis.configurations import as_found, own_of, without_user_effects
from adv2e.diagnosis.fitting.library import library, names
from adv2e.diagnosis.hints.collect import Hints
from adv2e.errors import ConfigError
from adv2e.reports.markup import meaning_of, summary_of, unit_of

HINTS = Hints(1.0, (), 1)
HEAD = """
from __future__ import annotations
from dataclasses import dataclass
from adv2e.effects.hooks import Hooks
from adv2e.parameters import Section, parameter
"""

DIM = """
@dataclass(frozen=True, kw_only=True)
class Keys(Section):
    share: float = parameter(0.5, unit="-", meaning="what is left", above=0, at_most=1)

class Dim(Hooks):
    \"\"\"Takes light away.\"\"\"
    stage = "frames"
    Parameters = Keys
    def light(self, frames):
        for t_ns, light in frames:
            yield t_ns, light * self.parameters.share
"""

DRIFT = """
@dataclass(frozen=True, kw_only=True)
class Slope(Section):
    per_s: float = parameter(unit="1/s", meaning="drift")
    name: str = parameter("a", unit="-", meaning="which", choices=("a", "b"))

class DriveDrift(Hooks):
    Parameters = Slope
    def drive(self, times_s):
        return times_s * self.parameters.per_s
"""


@pytest.fixture
def load(tmp_path):
    def write(text, head=HEAD):
        path = tmp_path / "mine.py"
        path.write_text(head + text)
        return load_effects(path)

    return write


def fitted(kind, limits="at_least=0"):
    """Return the text of an effect with a parameter of some type that may be fitted."""
    return (
        "from adv2e.parameters import Fit\n"
        f"@dataclass(frozen=True, kw_only=True)\nclass K(Section):\n    depth: {kind} = parameter("
        f"unit='-', meaning='m', {limits}, fit=Fit(1.0, 9.0, 3.0))\n"
        "class A(Hooks):\n    Parameters = K\n    def drive(self, t): return t"
    )


def test_classes_of_a_file_in_their_order(load):
    effects = load(DIM + DRIFT)
    assert [effect.name for effect in effects] == ["dim", "drive_drift"]
    assert effects[0].source["file"] == "mine.py"


@pytest.mark.parametrize("method", ["light_now(self, t_ns, light)", "events_now(self, events)"])
def test_what_a_loop_calls_makes_an_effect(load, method):
    (effect,) = load(f"class A(Hooks):\n    def {method}: return None")
    assert effect.name == "a"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1", r"mine\.py: defines no effect, which is a class derived from"),
        ("def f(:", r"mine\.py:5: not Python: invalid syntax"),
        ("import math\nmath.sqrt(-1)", r"mine\.py:6: ValueError: .*"),
        ("import no_such_module", r"mine\.py:5: ModuleNotFoundError: .*no_such_module"),
        ("class A(Hooks):\n    pass", r"mine\.py:5: class A: changes nothing: it must define one"),
        (
            "class A(Hooks):\n    stage = 'lens'\n    def drive(self, t): return t",
            r"class A: stage: must be one of frames, pixel, readout, got 'lens'",
        ),
        (
            "class A(Hooks):\n    name = 'a b'\n    def drive(self, t): return t",
            r"class A: name: must be lower-case letters, digits and underscores, got 'a b'",
        ),
        (
            "class A(Hooks):\n    Parameters = dict\n    def drive(self, t): return t",
            r"class A: Parameters: must be a class derived from adv2e.parameters.Section",
        ),
        (
            "class K(Section):\n    pass\nclass A(Hooks):\n    Parameters = K\n"
            "    def drive(self, t): return t",
            r"mine\.py:7: class A: Parameters: K must be a dataclass",
        ),
        (
            "@dataclass(frozen=True, kw_only=True)\nclass K(Section):\n    depth: float = 1.0\n"
            "class A(Hooks):\n    Parameters = K\n    def drive(self, t): return t",
            r"class A: Parameters: depth must be declared with parameter\(unit=, meaning=\)",
        ),
        (fitted("int"), r"class A: Parameters: depth: fit: only float, and tuples of it"),
        (fitted("bool"), r"class A: Parameters: depth: fit: only float, and tuples of it"),
        (fitted("tuple[float, int]"), r"Parameters: depth: fit: only float, and tuples of it"),
        (fitted("float", "at_least=2"), r"Parameters: depth: fit: must be at least 2, got 1"),
        (fitted("list"), r"depth: its type must be one of float, int, bool, str or a tuple"),
        (
            "@dataclass(frozen=True, kw_only=True)\nclass K(Section):\n"
            "    depth: float = parameter(3.0, unit='-', meaning='m', at_most=1)\n"
            "class A(Hooks):\n    Parameters = K\n    def drive(self, t): return t",
            r"mine\.py:8: class A: Parameters: depth: default: must be at most 1, got 3",
        ),
        (fitted("'Depth'"), r"class A: Parameters: name 'Depth' is not defined"),
    ],
)
def test_a_file_that_is_wrong_is_told_where_and_what(load, text, message):
    with pytest.raises(ConfigError, match=message) as caught:
        load(text, HEAD.strip() + "\n")
    assert "\n" not in str(caught.value)


def test_its_neighbours_are_not_imported(load, tmp_path):
    (tmp_path / "beside.py").write_text("raise SystemExit('ran')")
    with pytest.raises(ConfigError, match="No module named 'beside'"):
        load("import beside\n" + DIM)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(ConfigError, match=r"none\.py: No such file"):
        load_effects(tmp_path / "none.py")


def test_its_section_is_as_strict_as_any_other(load):
    effects = load(DIM + DRIFT)
    with pytest.raises(ConfigError, match=r"user\.drive_drift\.per_s: must be given, .*1/s"):
        load_config(effects=effects)
    sets = ["user.drive_drift.per_s=0.5"]
    config = load_config((), sets, effects=effects)
    assert config.user.dim.share == 0.5
    assert config.user.drive_drift.per_s == 0.5
    for wrong, message in (
        ("user.dim.share=2", "must be at most 1, got 2"),
        ("user.dim.shar=1", "did you mean 'share'"),
        ("user.dimm.share=1", "did you mean 'dim'"),
        ("user.drive_drift.name=c", "must be one of a, b"),
    ):
        with pytest.raises(Exception, match=message):
            load_config((), [*sets, wrong], effects=effects)
    with pytest.raises(Exception, match=r"user: effects of your own need their file: effects=F"):
        load_config((), sets)


def test_it_is_on_unless_it_is_null(load):
    effects = load(DIM)
    assert [hook.name for hook in active_hooks(load_config(effects=effects))] == ["dim"]
    assert active_hooks(load_config((), ["user.dim=null"], effects=effects)) == []
    assert active_hooks(load_config((), ["user.dim.share=0.7"], effects=effects))[
        0
    ].parameters.share == pytest.approx(0.7)


def test_its_configuration_survives_text_and_is_one_of_ours(load, tmp_path):
    effects = load(DIM + DRIFT)
    config = load_config((), ["user.drive_drift={per_s: 2.0, name: b}"], 4, effects)
    assert isinstance(config, Config)
    assert from_dict(to_dict(config), effects=effects) == config
    path = tmp_path / "mine.yaml"
    path.write_text(to_yaml(config))
    assert load_config([path], effects=effects) == config
    assert "Takes light away." in to_annotated_yaml(config)
    assert dataclasses.replace(config, seed=5).user == config.user


def test_a_configuration_brings_its_effects_along(load):
    dim, drift = load(DIM + DRIFT)
    config = load_config((), ["user.dim.share=0.7"], effects=[dim])
    assert load_config(config) == config
    both = load_config([config, {"seed": 5}], "user.drive_drift={per_s: 2.0}", effects=[dim, drift])
    assert (both.seed, both.user.dim.share, both.user.drive_drift.per_s) == (5, 0.7, 2.0)


def test_each_number_of_a_list_is_fitted_by_itself(load):
    effects = load(fitted("tuple[float, float, float]"))
    declared = load_config((), ["user.a=null"], effects=effects)
    (one,) = (one for one in library(declared, HINTS) if one.name == "a")
    assert [parameter.part for parameter in one.parameters] == [(0, 3), (1, 3), (2, 3)]
    assert one.starts[0] == (3.0, 3.0, 3.0)
    assert len(one.starts) == 7
    assert one.applied(declared, one.scaled((1.5, 2.5, 9.0))).user.a.depth == (1.5, 2.5, 9.0)


def test_two_of_one_name_are_an_error(load):
    effects = load(DIM)
    with pytest.raises(ConfigError, match=r"user\.dim: two effects have this name"):
        load_config(effects=[*effects, *effects])


FRAMES = [np.full((4, 5), v) for v in (0.1, 0.2, 0.3, 0.2, 0.1)]
TIMES = [0.01 * k for k in range(5)]


def test_from_a_configuration_and_from_python_are_the_same(load):
    (dim,) = load(DIM)
    config = load_config((), ["user.dim.share=0.25"], effects=[dim])
    found = np.concatenate(list(simulate(FRAMES, TIMES, config)))
    plain = load_config()
    again = np.concatenate(list(simulate(FRAMES, TIMES, plain, effects=[dim(share=0.25)])))
    darker = np.concatenate(list(simulate([f * 0.25 for f in FRAMES], TIMES, plain)))
    assert found.tobytes() == again.tobytes() == darker.tobytes()
    assert found.size


def test_at_the_command_line(adv2e, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save("clip.npy", np.stack(FRAMES).astype(np.float32))
    (tmp_path / "mine.py").write_text(HEAD + DIM)
    (tmp_path / "drive.py").write_text(HEAD + DRIFT)
    outcome = adv2e("convert", "clip.npy", "--fps", "100", "-q", "--effect", "none.py")
    assert (outcome.status, outcome.out) == (1, "")
    assert outcome.err.endswith("none.py: No such file or directory\n")
    both = ("--effect", "mine.py", "--effect", "drive.py")
    outcome = adv2e("convert", "clip.npy", "--fps", "100", "-q", *both, "--set", "user.dim.share=3")
    assert outcome.status == 2
    assert "user.dim.share: must be at most 1, got 3" in outcome.err
    (tmp_path / "more.yaml").write_text("user: {drive_drift: {per_s: 3.0}}\n")
    outcome = adv2e("convert", "clip.npy", "--fps", "100", *both, "-c", "more.yaml", "-o", "a.txt")
    assert outcome.status == 0, outcome.err
    kept = json.loads((tmp_path / "a.txt.json").read_text())
    assert [source["file"] for source in kept["effects"]] == ["mine.py", "drive.py"]
    assert kept["config"]["user"]["drive_drift"]["per_s"] == 3.0
    assert not list(tmp_path.glob("__pycache__"))


def test_what_it_does_wrong_when_it_runs_names_file_and_line(adv2e, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save("clip.npy", np.stack(FRAMES).astype(np.float32))
    wrong = "class A(Hooks):\n    def drive(self, t):\n        return t + None\n"
    (tmp_path / "mine.py").write_text(HEAD + wrong)
    outcome = adv2e(
        "convert", "clip.npy", "--fps", "100", "-q", "--effect", "mine.py", "-o", "a.h5"
    )
    assert outcome.status == 1
    assert "mine.py:8: effect a: TypeError" in outcome.err
    assert outcome.err.count("\n") == 1
    assert not (tmp_path / "a.h5").exists()


def test_an_effect_without_ranges_is_switched_on_by_a_diagnosis_where_it_is_off(load):
    config = load_config([], effects=load(DIM))
    assert [one.name for one in library(config, HINTS)][-1] != "dim"
    off = without_user_effects(config)
    assert off.user.dim is None
    (dim,) = [one for one in library(off, HINTS) if one.name == "dim"]
    assert dim.applied(off, []).user.dim.share == 0.5
    assert names(off)[-1] == "dim"
    assert "dim" not in names()


def test_a_model_without_own_effects_needs_none_of_their_files(load):
    config = load_config([], effects=load(DIM))
    assert from_dict(as_found(without_user_effects(config))) == Config()
    assert as_found(config)["user"] == {"dim": {"share": 0.5}}
    assert as_found(Config()) == to_dict(Config())


@pytest.mark.parametrize("written", ["user.dim", "user.dim.share"])
def test_what_is_written_of_an_effect_is_held(load, written):
    config = load_config(
        [], effects=load(DIM + DRIFT.replace("parameter(unit", "parameter(0.1, unit"))
    )
    kept = without_user_effects(config, [written, "user.dimmer", "pixel.leak"])
    assert kept.user.dim == config.user.dim
    assert kept.user.drive_drift is None


def test_reports_know_unit_meaning_and_summary_of_own_effects(load):
    own = own_of(load_config([], effects=load(DIM.replace('unit="-"', 'unit="us"'))))
    assert unit_of("user.dim.share", own) == "us"
    assert meaning_of("user.dim.share", own) == "what is left"
    assert summary_of("dim", ["user.dim.share"], own) == "Takes light away."
    assert unit_of("pixel.refractory.period_us", own) == "us"
    assert own_of(Config()).keys == {}

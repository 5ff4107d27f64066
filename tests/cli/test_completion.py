"""What a shell is told when Tab is pressed, by the protocol of its completion script."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys

import pytest

from adv2e.cli import COMMANDS
from adv2e.config import all_keys, shipped
from adv2e.effects import EFFECTS
from adv2e.formats import registry


@pytest.fixture
def offered(adv2e, monkeypatch):
    """Return what completes the last word of a line: names, or the word "file"."""

    def complete(line):
        words = shlex.split(line)
        at = len(words) if line.endswith(" ") else len(words) - 1
        monkeypatch.setenv("_ADV2E_COMPLETE", "bash_complete")
        monkeypatch.setenv("COMP_WORDS", line)
        monkeypatch.setenv("COMP_CWORD", str(at))
        outcome = adv2e()
        assert (outcome.status, outcome.err) == (0, "")
        offers = [row.split(",") for row in outcome.out.splitlines() if row]
        return ["file" if kind == "file" else value for kind, value in offers]

    return complete


@pytest.mark.parametrize(
    ("line", "names"),
    [
        ("adv2e ", list(COMMANDS)),
        ("adv2e co", ["convert", "compare", "config"]),
        ("adv2e config ", ["check", "defaults", "list", "show", "template"]),
        ("adv2e config -c v2e --eff", ["--effect"]),
        ("adv2e config --se", ["--set", "--seed"]),
        ("adv2e convert clip.mp4 --pro", ["--progress"]),
        ("adv2e convert --t0 ", ["auto", "zero", "keep"]),
        ("adv2e convert -c ", shipped()),
        ("adv2e convert -c davis", ["davis240c", "davis346"]),
        ("adv2e config show -c pa", ["paper"]),
        ("adv2e convert --format ", registry.names()),
        ("adv2e convert --layout ", registry.layouts()),
        (
            "adv2e convert --set pixel.hot",
            [
                f"pixel.hot_pixels.{name}="
                for name in ("fraction", "rate_hz", "spread", "off_fraction")
            ],
        ),
        ("adv2e effects ", [name for item in EFFECTS for name in (item.name, *item.told_as)]),
        ("adv2e effects refr", ["refractory"]),
        (
            "adv2e diagnose rec.zip --without thr",
            ["thresholds", "threshold_mismatch", "threshold_drift"],
        ),
        ("adv2e render a.h5 --style s", ["surface"]),
        ("adv2e nothing ", list(COMMANDS)),
    ],
)
def test_names_are_offered(offered, line, names):
    assert offered(line) == names


@pytest.mark.parametrize(
    "line",
    [
        *("adv2e convert ", "adv2e convert cl", "adv2e info ", "adv2e render ", "adv2e compare a "),
        *("adv2e convert a.mp4 -o ", "adv2e convert a.mp4 --preview ", "adv2e convert -c mine"),
        *("adv2e convert --effect ", "adv2e convert --timestamps ", "adv2e demo -o "),
        *(
            "adv2e diagnose ",
            "adv2e characterise ",
            "adv2e compare a b --frames ",
            "adv2e config check mine",
        ),
    ],
)
def test_files_are_left_to_the_shell(offered, line):
    assert offered(line) == ["file"]


def test_every_key_is_offered(offered):
    keys = [f"{key.path}=" for key in all_keys() if not key.is_section]
    assert offered("adv2e convert --set ") == keys


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_are_told_what_each_command_does(adv2e, monkeypatch, shell):
    monkeypatch.setenv("_ADV2E_COMPLETE", f"{shell}_complete")
    monkeypatch.setenv("COMP_WORDS", "adv2e inf")
    monkeypatch.setenv("COMP_CWORD", "inf" if shell == "fish" else "1")
    out = adv2e().out
    assert "info" in out
    assert COMMANDS["info"] in out


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_each_shell_gets_its_script(adv2e, monkeypatch, shell):
    if shell == "bash":  # another bash would be asked for its version
        monkeypatch.setattr(
            "click.shell_completion.BashComplete._check_version", staticmethod(lambda: None)
        )
    monkeypatch.setenv("_ADV2E_COMPLETE", f"{shell}_source")
    outcome = adv2e()
    assert outcome.status == 0
    assert f"_ADV2E_COMPLETE={shell}_complete" in outcome.out


def test_commands_are_offered_without_importing_them():
    code = """
import sys
from adv2e.cli import main
try:
    main([])
except SystemExit as stop:
    assert not stop.code, stop.code
loaded = {"numpy", "adv2e.cli.convert", "adv2e.cli.config"} & set(sys.modules)
assert not loaded, loaded
"""
    asked = {"_ADV2E_COMPLETE": "bash_complete", "COMP_WORDS": "adv2e con", "COMP_CWORD": "1"}
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **asked}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.stderr == ""
    assert done.stdout == "plain,convert\nplain,config\n"

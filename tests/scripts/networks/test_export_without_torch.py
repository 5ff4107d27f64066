"""What the scripts that write networks say where PyTorch is not installed, and of wrong words."""

from __future__ import annotations

import sys

import export_rife
import export_superslomo
import pytest
from click.testing import CliRunner

SCRIPTS = [export_rife, export_superslomo]


@pytest.fixture
def no_torch(monkeypatch):
    for name in [*sys.modules]:
        if name.startswith("networks."):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "torch", None)


@pytest.mark.parametrize("script", SCRIPTS)
def test_the_extra_is_named(script, tmp_path, no_torch):
    (tmp_path / "a").write_bytes(b"weights")
    words = [str(tmp_path / "a"), "-o", str(tmp_path / "a.onnx")]
    done = CliRunner().invoke(script.main, words)
    assert (done.exit_code, done.output) == (
        1,
        "Error: the export of a network needs an optional package: pip install 'adv2e[torch]'\n",
    )
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


@pytest.mark.parametrize("script", SCRIPTS)
@pytest.mark.parametrize("words", [[], ["a"], ["-o", "a.onnx"], ["a", "b", "-o", "a.onnx"]])
def test_wrong_words(script, words):
    assert CliRunner().invoke(script.main, words).exit_code == 2


@pytest.mark.parametrize("mean", ["-0.1", "1.5", "grey"])
def test_a_mean_is_within_the_range_of_frames(mean):
    words = ["a", "-o", "a.onnx", "--mean", mean]
    done = CliRunner().invoke(export_superslomo.main, words)
    assert done.exit_code == 2
    assert "--mean" in done.output


def test_the_help_says_that_code_is_run():
    done = CliRunner().invoke(export_rife.main, ["--help"])
    assert "Code in it is run" in " ".join(done.output.split())

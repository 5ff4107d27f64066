"""The commands and the examples of each document run, in their order, in one folder."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from trees_of_batch import in_this_process

from adv2e.batches import processes
from adv2e.config import load_family
from adv2e.conversion import demo
from adv2e.diagnosis import prepare
from adv2e.diagnosis.fitting.library import names
from documentation.documents import ROOT, Block, Command, Document, documents
from documentation.inputs import make_inputs
from documentation.where import elsewhere, is_run

DOCUMENTS = {document.name: document for document in documents()}

RIVALS = {"refractory", "event_loss"}
"""The effects that compete in diagnoses here, besides those of the user's own: all take minutes."""

FOUND = {
    "README.md": ("found", "refractory", {"pixel.refractory.period_us": 4e3}),
    "docs/tutorials/own_camera.md": ("found", "refractory", {"pixel.refractory.period_us": 4e3}),
    "docs/diagnosis.md": ("found", "refractory", {"pixel.refractory.period_us": 1e4}),
    "docs/own_effects.md": ("again", "echo", {"user.echo.share": 0.3}),
}
"""Folder of a diagnosis that a document makes, the effect that it names, and what it fits."""

_SHELL = re.compile(r"[|<>;&$*\n]")

_ENDS = {0, 141}
"""Exit statuses: done; and of a pipe whose reader had enough."""


@pytest.fixture(autouse=True)
def _small(monkeypatch, tmp_path):
    every = prepare.library

    def library(declared, hints):
        built_in = {*names()} - RIVALS
        return [one for one in every(declared, hints) if one.name not in built_in]

    monkeypatch.setattr(prepare, "library", library)
    monkeypatch.setattr(processes, "run", in_this_process)
    smaller = {"WIDTH": 64, "HEIGHT": 48, "DURATION_S": 0.5, "RECORDING_S": 0.2}
    for name, value in smaller.items():
        monkeypatch.setattr(demo, name, value)
    monkeypatch.setattr(demo, "INSTANTS_S", (0.2, 0.4))
    monkeypatch.setattr("adv2e.rendering.films.default_scale", lambda width: 2)
    monkeypatch.chdir(tmp_path)


def run_in_shell(command: Command) -> str:
    """Run a command as a user would; return what it said."""
    path = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    text = command.text.replace("scripts/", f"{ROOT}/scripts/")
    done = subprocess.run(
        ["bash", "-e", "-o", "pipefail", "-c", text],
        env={**os.environ, "PATH": path}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode in _ENDS, f"{command}\n{done.stdout}{done.stderr}"
    return done.stdout + done.stderr


def run_command(command: Command, adv2e) -> str:
    """Run a command, and return what it said, unless it is run elsewhere or needs more."""
    if not is_run(command):
        return ""
    if not command.text.startswith("adv2e ") or _SHELL.search(command.text):
        return run_in_shell(command)
    outcome = adv2e(*shlex.split(command.text)[1:])
    assert outcome.status == 0, f"{command}\n{outcome.err}"
    return outcome.out + outcome.err


def shape(text: str) -> str:
    """Return a text without its numbers, and in one line."""
    return re.sub(r"\d[\d,.]*", "0", " ".join(text.split()))


def run_block(block: Block, adv2e, said: str) -> str:
    """Run what stands in a block, write the file that it is, or compare it with what was `said`.

    A text is what the commands of the block before print, with other numbers: recordings are
    smaller here.  Returns what its own commands said.
    """
    if block.language == "bash":
        return "\n".join(run_command(command, adv2e) for command in block.commands())
    if block.language == "text":
        for line in block.text.splitlines() if said.strip() else []:
            assert shape(line) in shape(said), f"{block.document}:{block.line}: {line}\n{said}"
    if block.file:
        Path(block.file).write_text(block.text, "utf-8")
    if block.language == "yaml":
        path = Path(block.file or "example.yaml")
        path.write_text(block.text, "utf-8")
        load_family([path])
    if block.language == "python":
        code = compile(block.text, f"{block.document}:{block.line}", "exec")
        if not block.file and not block.needs:
            exec(code, {"__name__": "__main__"})
    return ""


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name == "docs/light.md" else pytest.mark.thorough)
        for name in DOCUMENTS
    ],
)
def test_all_that_a_document_shows_runs(name, adv2e, tmp_path):
    document, said = DOCUMENTS[name], ""
    make_inputs(tmp_path, (block.text for block in document.blocks if block.language != "text"))
    for block in document.blocks:
        said = run_block(block, adv2e, said)
    for command in document.commands():
        if command.inline:
            run_command(command, adv2e)
    if name in FOUND:
        folder, effect, values = FOUND[name]
        report = json.loads((tmp_path / folder / "report.json").read_text("utf-8"))
        assert report["verdict"] == "explained"
        assert [one["name"] for one in report["effects"]] == [effect]
        parameters = report["effects"][0]["parameters"]
        assert {key: parameters[key] for key in values} == pytest.approx(values, rel=0.1)


def only_looked_at(document: Document) -> list[Command]:
    """Return the commands of which no more than the options is tried."""
    return [one for one in document.commands() if not is_run(one) and not elsewhere(one)]


def words_of(command: Command) -> list[list[str]]:
    """Return the words of each call of adv2e or of a script in a command."""
    calls = re.split(r"[|;\n]|&&|\bdo\b", command.text)
    words = (shlex.split(re.sub(r"[<>].*", "", call)) for call in calls)
    return [one for one in words if one and re.match(r"(adv2e|python|scripts/.*)$", one[0])]


@pytest.mark.parametrize("name", DOCUMENTS)
def test_options_of_what_is_not_run_are_right(name, adv2e):
    for command in only_looked_at(DOCUMENTS[name]):
        assert words_of(command), f"{command}: neither adv2e nor a script, so it must be run"
        for words in words_of(command):
            if words[0] == "adv2e":
                outcome = adv2e(*words[1:], "--help")
                assert outcome.status == 0, f"{command}\n{outcome.err}"
                assert outcome.out.startswith("Usage: ")


_HELPS = """
import json, os, runpy, sys
usual = sys.path[1:]
for place, *words in json.load(sys.stdin):
    for name, module in [*sys.modules.items()]:
        if (getattr(module, "__file__", None) or "").startswith(os.path.abspath("scripts")):
            del sys.modules[name]
    sys.path[:] = [os.path.dirname(os.path.abspath(words[0])), *usual]
    sys.argv = [*words, "--help"]
    try:
        runpy.run_path(words[0], run_name="__main__")
    except SystemExit as end:
        assert not end.code, place
"""
"""One process for all, as importing the package takes longer than all else."""


@pytest.mark.thorough
def test_options_of_scripts_that_are_not_run_are_right():
    calls = [
        [str(command), *words[words[0] == "python" :]]
        for document in DOCUMENTS.values()
        for command in only_looked_at(document)
        for words in words_of(command)
        if words[0] != "adv2e"
    ]
    done = subprocess.run(
        [sys.executable, "-c", _HELPS], input=json.dumps(calls),
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("Usage: ") == len(calls)


def test_an_option_that_is_unknown_is_an_error_beside_help(adv2e):
    assert adv2e("convert", "clip.mp4", "--fsp", "240", "--help").status == 2
    command = Command("a document", 1, "adv2e effects nonesuch --help")
    assert elsewhere(command) is None
    with pytest.raises(AssertionError, match="a document:1: adv2e convert --fsp 3"):
        run_command(Command("a document", 1, "adv2e convert --fsp 3"), adv2e)


def test_a_text_is_what_was_printed_but_for_its_numbers(adv2e):
    block = Block("a document", 1, "text", "dead time: 4.00 ms,\n  declared 0.5\n")
    run_block(block, adv2e, "seen\ndead time: 12.1 ms, declared 1,000\n")
    with pytest.raises(AssertionError, match="a document:1:   declared "):
        run_block(block, adv2e, "dead time: 12.1 ms, as declared\n")


def test_a_command_has_all_of_its_lines():
    text = "adv2e a \\\n    -o b  # of two lines\n\nfor f in *.mp4; do\n  adv2e c $f\ndone\n"
    block = Block("a document", 10, "bash", text + "adv2e d  # needs a recording of yours\n")
    assert [(one.line, one.text, one.needs) for one in block.commands()] == [
        (11, "adv2e a -o b", ""),
        (14, "for f in *.mp4; do\n  adv2e c $f\ndone", ""),
        (17, "adv2e d", "needs a recording of yours"),
    ]

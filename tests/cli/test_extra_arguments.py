"""One argument too many: what to type instead, as a whole command."""

from __future__ import annotations

import shlex

import pytest

ONE = "takes one {} at a time; for several: "


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """Stand in a folder that holds some inputs."""
    for name in ("a.mp4", "b.mp4", "a b.mov", "a.h5", "b.h5", "rec.zip", "more.zip"):
        (tmp_path / name).touch()
    for name in ("frames1", "frames2"):
        (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path)


def hint(adv2e, pipeline, *args):
    outcome = adv2e(*args)
    assert (outcome.status, outcome.out) == (2, "")
    assert outcome.err.startswith("adv2e: error: ")
    assert outcome.err.count("\n") == 1
    assert pipeline.calls == []
    return outcome.err.removeprefix("adv2e: error: ").rstrip("\n")


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        ("convert in.mp4 out.h5", "convert in.mp4 -o out.h5"),
        ("convert in.mp4 out.h5 -c v2e --seed 2", "convert in.mp4 -o out.h5 -c v2e --seed 2"),
        ("convert in.mp4 a.h5", "convert in.mp4 -o a.h5"),
        ("convert -c v2e in.mp4 'o u t'", "convert -c v2e in.mp4 -o 'o u t'"),
        ("convert a.mp4 out.txt", "convert a.mp4 -o out.txt"),
        ("convert rec.zip out.zip", "convert rec.zip -o out.zip"),
        ("convert frames1 out", "convert frames1 -o out"),
        ("render a.h5 out.mp4", "render a.h5 -o out.mp4"),
        ("demo folder", "demo -o folder"),
        ("diagnose rec.zip out", "diagnose rec.zip -o out"),
    ],
)
def test_an_output_is_put_behind_its_option(adv2e, pipeline, given, meant):
    said = hint(adv2e, pipeline, *shlex.split(given))
    assert said == f"put -o before the output: adv2e {meant}"


@pytest.mark.parametrize(
    ("given", "argument", "loop"),
    [
        ("convert a.mp4 b.mp4", "INPUT", 'for f in *.mp4; do adv2e convert "$f"; done'),
        ("convert x/a.mp4 x/b.mp4", "INPUT", 'for f in x/*.mp4; do adv2e convert "$f"; done'),
        ("convert a.mp4 none.mov", "INPUT", 'for f in a.mp4 none.mov; do adv2e convert "$f"; done'),
        (
            "convert a.mp4 b.mp4 'a b.mov' -c v2e",
            "INPUT",
            "for f in a.mp4 b.mp4 'a b.mov'; do adv2e convert \"$f\" -c v2e; done",
        ),
        ("convert a.mp4 b.mp4 -o out.h5", "INPUT", 'for f in *.mp4; do adv2e convert "$f"; done'),
        (
            "convert frames1 frames2 --fps 30",
            "INPUT",
            'for f in frames1 frames2; do adv2e convert "$f" --fps 30; done',
        ),
        ("convert rec.zip more.zip", "INPUT", 'for f in *.zip; do adv2e convert "$f"; done'),
        ("info ./a.h5 b.h5 --json", "FILE", 'for f in *.h5; do adv2e info "$f" --json; done'),
        (
            "render a.h5 b.h5 --style grey",
            "EVENTS",
            'for f in *.h5; do adv2e render "$f" --style grey -o "$f.mp4"; done',
        ),
    ],
)
def test_several_inputs_are_for_a_loop(adv2e, pipeline, given, argument, loop):
    said = hint(adv2e, pipeline, *shlex.split(given))
    assert said.endswith(f" {ONE.format(argument)}{loop}")


@pytest.mark.parametrize(
    ("given", "usage"),
    [
        ("compare a b c", "'c': adv2e compare [OPTIONS] MEASURED SIMULATED"),
        ("config list mine.yaml", "'mine.yaml': adv2e config list [OPTIONS]"),
    ],
)
def test_what_cannot_be_guessed_shows_the_usage(adv2e, pipeline, given, usage):
    assert hint(adv2e, pipeline, *given.split()) == f"unexpected argument {usage}"


def test_a_path_in_the_place_of_the_command_is_to_be_converted(adv2e, pipeline):
    assert "did you mean 'adv2e convert a.mp4'?" in hint(adv2e, pipeline, "a.mp4")
    assert "did you mean" not in hint(adv2e, pipeline, "xyz.mp4")

"""One argument too many: what the command takes, and where an output is put."""

from __future__ import annotations

import pytest


def hint(adv2e, pipeline, *args):
    outcome = adv2e(*args)
    assert (outcome.status, outcome.out) == (2, "")
    assert outcome.err.startswith("adv2e: error: ")
    assert outcome.err.count("\n") == 1
    assert pipeline.calls == []
    return outcome.err.removeprefix("adv2e: error: ").rstrip("\n")


@pytest.mark.parametrize(
    ("given", "usage"),
    [
        ("convert in.mp4 out.h5 -c v2e", "'out.h5': adv2e convert [OPTIONS] INPUT"),
        ("convert a.mp4 b.mp4 c.mp4 -o out.h5", "'b.mp4': adv2e convert [OPTIONS] INPUT"),
        ("render a.h5 out.mp4", "'out.mp4': adv2e render [OPTIONS] EVENTS"),
        ("demo folder", "'folder': adv2e demo [OPTIONS]"),
    ],
)
def test_an_output_is_put_behind_its_option(adv2e, pipeline, given, usage):
    said = hint(adv2e, pipeline, *given.split())
    batch = ", and 'adv2e batch' takes a folder of inputs" * given.startswith("convert")
    assert said == f"unexpected argument {usage}; an output is put behind -o{batch}"


@pytest.mark.parametrize(
    ("given", "usage"),
    [
        ("info a.h5 b.h5", "'b.h5': adv2e info [OPTIONS] FILE"),
        ("compare a b c", "'c': adv2e compare [OPTIONS] MEASURED SIMULATED"),
        ("config list mine.yaml", "'mine.yaml': adv2e config list [OPTIONS]"),
    ],
)
def test_where_there_is_no_output_the_usage_is_shown(adv2e, pipeline, given, usage):
    assert hint(adv2e, pipeline, *given.split()) == f"unexpected argument {usage}"


def test_a_diagnosis_takes_several_recordings_of_a_film_alone(adv2e, pipeline):
    said = hint(adv2e, pipeline, "diagnose", "rec.zip", "out")
    assert said.startswith("2 recordings are given: one is diagnosed")
    assert said.endswith("; an output is put behind -o")


def test_a_path_in_the_place_of_the_command_is_to_be_converted(adv2e, pipeline, tmp_path):
    path = tmp_path / "a.mp4"
    path.touch()
    assert f"did you mean 'adv2e convert {path}'?" in hint(adv2e, pipeline, str(path))
    assert "did you mean" not in hint(adv2e, pipeline, "xyz.mp4")

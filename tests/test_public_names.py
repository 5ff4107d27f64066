"""What ``import adv2e`` offers: names, help, and an example of each that runs."""

from __future__ import annotations

import doctest
import importlib
import pydoc
import shutil
import subprocess
import sys

import pytest
from camera import Camera, patchwork

import adv2e
from adv2e.diagnosis import prepare
from adv2e.diagnosis.fitting.library import names
from adv2e.diagnosis.outcome import conclusion
from adv2e.diagnosis.selection import reference, shortlist

NAMES = sorted(set(adv2e.__all__) - {"__version__", "EVENT_DTYPE"})  # those that have docstrings


def test_all_public_names_are_shown_and_there():
    assert dir(adv2e) == sorted(adv2e.__all__)
    for name in adv2e.__all__:
        assert getattr(adv2e, name) is not None


def test_help_tells_of_all_of_them():
    text = pydoc.plain(pydoc.render_doc(adv2e))
    described = text[: text.index("PACKAGE CONTENTS")]
    for name in set(adv2e.__all__) - {"__version__"}:
        assert name in described
    for name in set(NAMES) - {"Config"}:
        assert f"\n    {name}(" in text[text.index("FUNCTIONS") :]


def examples(thing, name):
    found = doctest.DocTestFinder(recurse=False).find(thing, name)
    found = [test for test in found if test.examples]
    assert found, f"{name} has no example"
    return found


@pytest.mark.parametrize("name", sorted({*NAMES, "adv2e"} - {"diagnose"}))
def test_the_example_of_each_works(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    thing = adv2e if name == "adv2e" else getattr(adv2e, name)
    runner = doctest.DocTestRunner()
    for test in examples(thing, name):
        assert not runner.run(test).failed


def test_the_example_of_diagnose_works(tmp_path, monkeypatch):
    """With fewer simulations than a diagnosis to be believed, and fewer effects that compete."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(reference, "MANY", 40)
    for module in (reference, shortlist):
        monkeypatch.setattr(module, "SOME", 16)
    monkeypatch.setattr(prepare, "PILOT_SEEDS", range(10_000, 10_004))
    monkeypatch.setattr(conclusion, "DRAWS", 4)
    Camera(
        patchwork((32, 24), seed=6), hidden={"pixel": {"refractory": {"period_us": 20_000.0}}},
        size=(32, 24), duration_s=0.3, fps=400.0, step_us=50.0,
    ).record(tmp_path / "recording.zip")  # fmt: skip
    shutil.move("recording.declared.yaml", "declared.yaml")
    home = importlib.import_module("adv2e.diagnosis.recordings")
    without = [name for name in names() if name not in ("refractory", "leak", "event_loss")]
    real = home.diagnose_evidence
    monkeypatch.setattr(
        home, "diagnose_evidence", lambda *a, **kw: real(*a, **{**kw, "without": without})
    )
    runner = doctest.DocTestRunner()
    for test in examples(adv2e.diagnose, "diagnose"):
        assert not runner.run(test, clear_globs=False).failed
        assert 15_000 < test.globs["dead_time"] < 25_000


def test_another_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'adv2e' has no attribute 'simulat'"):
        _ = adv2e.simulat


def test_importing_it_imports_nothing_of_weight():
    code = "import sys, adv2e; print([n for n in ('numpy', 'numba', 'cv2') if n in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"

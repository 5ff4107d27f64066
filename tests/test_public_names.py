"""What ``import adv2e`` offers: names, help, and an example of each that runs."""

from __future__ import annotations

import doctest
import pydoc
import subprocess
import sys

import pytest

import adv2e

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
    """That of diagnose takes long: it is run where a diagnosis is made, in tests/cli."""
    monkeypatch.chdir(tmp_path)
    thing = adv2e if name == "adv2e" else getattr(adv2e, name)
    runner = doctest.DocTestRunner()
    for test in examples(thing, name):
        assert not runner.run(test).failed


def test_another_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'adv2e' has no attribute 'simulat'"):
        _ = adv2e.simulat


def test_importing_it_imports_nothing_of_weight():
    code = "import sys, adv2e; print([n for n in ('numpy', 'numba', 'cv2') if n in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"

"""What ``import adv2e`` offers."""

from __future__ import annotations

import inspect
import subprocess
import sys

import pytest

import adv2e


def test_all_public_names_are_shown_and_there():
    assert dir(adv2e) == sorted(adv2e.__all__)
    for name in adv2e.__all__:
        assert getattr(adv2e, name) is not None


@pytest.mark.parametrize("name", sorted(set(adv2e.__all__) - {"__version__", "EVENT_DTYPE"}))
def test_each_says_what_it_is(name):
    assert inspect.getdoc(getattr(adv2e, name))


def test_another_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'adv2e' has no attribute 'simulat'"):
        _ = adv2e.simulat


def test_importing_it_imports_nothing_of_weight():
    code = "import sys, adv2e; print([n for n in ('numpy', 'numba', 'cv2') if n in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"

"""What ``import adv2e`` offers: names, help, and an example of each that runs."""

from __future__ import annotations

import doctest
import pickle
import pydoc
import subprocess
import sys

import numpy as np
import pytest

import adv2e
from adv2e.errors import Adv2eError

ERRORS = {name for name in adv2e.__all__ if name.endswith(("Error", "Warning"))}
TYPES = {"Camera", "Config", "Recording"}
NAMES = sorted(set(adv2e.__all__) - ERRORS - {"__version__", "EVENT_DTYPE"})  # with an example each


def test_all_public_names_are_shown_and_there():
    assert dir(adv2e) == sorted(adv2e.__all__)
    for name in adv2e.__all__:
        assert getattr(adv2e, name) is not None


def test_help_tells_of_all_of_them():
    text = pydoc.plain(pydoc.render_doc(adv2e))
    described = text[: text.index("PACKAGE CONTENTS")]
    for name in set(adv2e.__all__) - {"__version__"}:
        assert name in described
    for name in set(NAMES) - TYPES:
        assert f"\n    {name}(" in text[text.index("FUNCTIONS") :]


def examples(thing, name):
    found = doctest.DocTestFinder(recurse=False).find(thing, name)
    found = [test for test in found if test.examples]
    assert found, f"{name} has no example"
    return found


@pytest.mark.parametrize("name", sorted({*NAMES, "adv2e"} - {"diagnose"}))
@pytest.mark.quick_cases(1)
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


WRONG = {
    "adv2e.convert('c.npy', 'c.h5', fps=9)": "c.h5: exists already; overwrite=True replaces it",
    "adv2e.convert('c.npy', 'd.h5')": "c.npy: no times of its frames are known: give fps=F or"
    " timestamps=FILE",
    "adv2e.convert('c.npy', 'd.h5', fps=9, time_unit='s')": "time_unit is for lists of times, which"
    " fps replaces",
    "adv2e.convert('c.npy', 'd.h5', fps=9, start_s=2, stop_s=1)": "stop_s=1 must be after start_s",
    "adv2e.convert('c.npy', 'd.bag', fps=9, layout='x')": "layout x: only HDF5",
    "adv2e.render('e.txt', 'e.mp4', at_s=[1])": "instants (at_s) are for a .png",
    "adv2e.read_events('none.h5')": "none.h5: no such file",
}


@pytest.mark.parametrize("call", WRONG)
def test_errors_name_arguments_and_not_options(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save("c.npy", np.full((3, 4, 5), 0.5, np.float32))
    (tmp_path / "c.h5").touch()
    (tmp_path / "e.txt").write_text("0.1 1 2 1\n1.2 3 4 0\n")
    with pytest.raises(Adv2eError) as caught:
        eval(call, {"adv2e": adv2e})
    assert WRONG[call] in str(caught.value)
    assert "--" not in str(caught.value)


def test_what_is_told_of_frames_and_files_names_arguments(tmp_path):
    path = tmp_path / "e.txt"
    path.write_text("".join(f"{1000 * n} {n % 9} 2 1\n" for n in range(90)))
    (doubt,) = [one for one in adv2e.read_events(path).problems if "time_unit" in one]
    assert "--" not in doubt


def test_grey_frames_of_8_bits_are_told_to_be_a_guess():
    frames = [np.full((4, 5), dn, np.uint8) for dn in (50, 100, 200)]
    with pytest.warns(UserWarning, match="are srgb, .*8-bit grey arrays") as told:
        guessed = np.concatenate([*adv2e.simulate(frames, 100, "ideal")])
    assert [one.filename for one in told] == [__file__]
    stated = [
        *adv2e.simulate(frames, 100, ["ideal", {"frames": {"encoding": "srgb"}}])
    ]  # without a word
    colour = [*adv2e.simulate([np.dstack([one] * 3) for one in frames], 100, "ideal")]
    for other in (stated, colour):
        np.testing.assert_array_equal(guessed, np.concatenate(other))


def test_public_functions_can_be_sent_to_other_processes():
    for name in NAMES:
        assert pickle.loads(pickle.dumps(getattr(adv2e, name))) is getattr(adv2e, name)

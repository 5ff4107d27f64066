"""Running the command line inside the test process, and an end for tests that hang."""

from __future__ import annotations

import os
import signal
import sys
from collections import Counter
from collections.abc import Iterator
from types import ModuleType
from typing import NamedTuple

# before NumPy is imported: threads of its BLAS, in several processes at once, wait for one another
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
import warm

from adv2e.__main__ import collect_seldom
from adv2e.cli import main

collect_seldom()  # to search the compiler's objects for cycles took a fourteenth of the run

LONGEST_S = 400
"""After that a test hangs.  Where it does so is printed before; see faulthandler_timeout."""


@pytest.hookimpl(tryfirst=True)  # before -m chooses
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark as thorough all cases of a test but the first few, of which it says how many."""
    seen: Counter[str] = Counter()
    for item in items:
        quick = item.get_closest_marker("quick_cases")
        if quick is not None:
            test = item.nodeid.partition("[")[0]
            seen[test] += 1
            if seen[test] > quick.args[0]:
                item.add_marker("thorough")


@pytest.fixture(autouse=True)
def _no_test_hangs() -> Iterator[None]:
    """Kill the test run rather than wait for a test that does not end."""
    if not hasattr(signal, "alarm"):
        yield
        return
    signal.alarm(LONGEST_S)
    yield
    signal.alarm(0)


@pytest.fixture(autouse=True, scope="session")
def _solvers_are_compiled() -> None:
    """Compile what most tests need: they look at all that a command says, and at its time."""
    for form in ("lanes", "steps"):
        warm.compile_solver(form)


class Outcome(NamedTuple):
    status: int
    out: str
    err: str


@pytest.fixture
def adv2e(capsys):
    """Run ``adv2e`` with the arguments given; return its exit status, stdout and stderr."""

    def run(*args):
        with pytest.raises(SystemExit) as caught:
            main([str(arg) for arg in args])
        out, err = capsys.readouterr()
        return Outcome(caught.value.code or 0, out, err)

    return run


class Summary:
    def text(self):
        return "the summary"


@pytest.fixture
def pipeline(monkeypatch):
    """Stand in for the conversion: remembers the call, and ends as `ending` says."""
    module = ModuleType("adv2e.conversion.pipeline")
    module.calls = []
    module.ending = Summary

    def convert(reading, output, **options):
        module.calls.append((reading, output, options))
        return module.ending()

    module.convert_reading = convert
    monkeypatch.setitem(sys.modules, "adv2e.conversion.pipeline", module)
    return module


@pytest.fixture
def one_torch_thread():
    """Draw and add up as PyTorch does on one thread, from the same state of chance."""
    torch = pytest.importorskip("torch")
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    torch.manual_seed(0)
    yield
    torch.set_num_threads(before)

"""Every script runs from a clone as it stands: by its path, and without the tests' search path."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = sorted(
    path.relative_to(ROOT).as_posix()
    for path in (ROOT / "scripts").rglob("*.py")
    if path.read_text("utf-8").startswith("#!")
)

_RUN = """
import os, runpy, sys
usual = sys.path[1:]
for script in sys.argv[1:]:
    for name, module in [*sys.modules.items()]:
        if (getattr(module, "__file__", None) or "").startswith(os.path.abspath("scripts")):
            del sys.modules[name]
    sys.path[:] = [os.path.dirname(os.path.abspath(script)), *usual]
    sys.argv = [script, "--help"]
    print("script", script, flush=True)
    try:
        runpy.run_path(script, run_name="__main__")
    except SystemExit as end:
        assert not end.code, end.code
"""
"""One process for all, as importing the package takes longer than all else."""


@pytest.fixture(scope="module")
def helps():
    done = subprocess.run(
        [sys.executable, "-c", _RUN, *SCRIPTS],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    parts = re.split(r"^script (\S+)\n", done.stdout, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


@pytest.mark.parametrize("script", SCRIPTS)
def test_a_script_tells_how_to_use_it(helps, script):
    assert helps[script].lower().startswith("usage: ")


def test_the_tables_name_every_script_once_and_no_other():
    named = []
    for path in (ROOT / "scripts").rglob("README.md"):
        folder = path.parent.relative_to(ROOT).as_posix()
        found = re.findall(r"^\| `(\S+\.py)", path.read_text("utf-8"), flags=re.MULTILINE)
        named += [f"{folder}/{name}" for name in found]
    assert sorted(named) == SCRIPTS

"""``scripts/demo`` installs once, in an environment of its own, and hands its arguments on."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

_PYTHON = """#!/usr/bin/env bash
if [[ $1 == -m ]]; then echo "$@" >>calls; else exec {python} "$@"; fi
"""
"""In place of the environment's: it notes which modules it should run."""


def test_the_demonstration_is_installed_once_and_run(tmp_path):
    (tmp_path / "scripts").mkdir()
    for name in ("pyproject.toml", "scripts/demo", "scripts/environment.sh"):
        shutil.copy(ROOT / name, tmp_path / name)
    python = tmp_path / ".venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.write_text(_PYTHON.format(python=sys.executable), "utf-8")
    python.chmod(0o755)
    for arguments in ([], ["--seed", "3"]):
        subprocess.run([tmp_path / "scripts" / "demo", *arguments], check=True)
    install, *runs = (tmp_path / "calls").read_text("utf-8").splitlines()
    assert install.startswith("-m pip install ")
    assert install.endswith("--editable .")
    assert runs == [f"-m adv2e demo -o demo --overwrite{more}" for more in ("", " --seed 3")]

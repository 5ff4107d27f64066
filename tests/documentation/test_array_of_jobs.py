"""The array of jobs that is shown for Slurm does the whole, each task a part of it."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from trees_of_batch import clip

from documentation.documents import ROOT, Document

pytestmark = pytest.mark.thorough


def test_the_tasks_of_the_array_do_the_whole(tmp_path):
    document = Document.read(ROOT / "docs" / "batches.md")
    (command,) = (one for one in document.commands() if one.text.startswith("sbatch "))
    _, array, *_, name, script = shlex.split(command.text)
    first, last = map(int, re.fullmatch(r"--array=(\d+)-(\d+)", array).groups())
    assert name == "--wrap"
    for k in range(3):
        clip(tmp_path / "videos" / f"{k}.avi", start=k)
    path = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    for task in (first, last):  # with as many tasks as there are parts here
        told = {"SLURM_ARRAY_TASK_ID": f"{1 + (task != first)}", "SLURM_ARRAY_TASK_COUNT": "2"}
        subprocess.run(
            ["bash", "-e", "-c", script], cwd=tmp_path, env={**os.environ, **told, "PATH": path},
            check=True, capture_output=True,
        )  # fmt: skip
    assert sorted(p.name for p in (tmp_path / "events").glob("*.h5")) == ["0.h5", "1.h5", "2.h5"]
    assert first == 1

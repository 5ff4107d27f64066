"""What tests of the benchmarks in scripts/ share."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


@pytest.fixture
def module(monkeypatch):
    """Import a module of scripts/ by name."""
    monkeypatch.syspath_prepend(SCRIPTS)
    return importlib.import_module


@pytest.fixture
def clips(module):
    return module("benchmarks.clips")


@pytest.fixture
def processes(module):
    return module("benchmarks.processes")


@pytest.fixture
def small(clips, tmp_path):
    """A clip of 25 small frames, as a file."""
    return str(clips.stored(clips.Clip(width=32, height=24, frames=25), tmp_path))

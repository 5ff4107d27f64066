"""What tests of the benchmarks in scripts/ share."""

from __future__ import annotations

import pytest
from benchmarks import clips


@pytest.fixture
def small(tmp_path):
    """A clip of 25 small frames, as a file."""
    return str(clips.stored(clips.Clip(width=32, height=24, frames=25), tmp_path))

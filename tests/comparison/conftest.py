from __future__ import annotations

import pytest
import streams


@pytest.fixture
def random_events():
    return streams.random_events


@pytest.fixture
def events():
    return streams.random_events(1, 3000)

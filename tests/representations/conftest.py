from __future__ import annotations

import pytest
from streams import random_events


@pytest.fixture
def events():
    return random_events(1, 3000)

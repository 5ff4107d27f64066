"""The camera that records what is diagnosed: that of the tests, which shares no code with adv2e."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).parents[3]


def _module(name: str) -> Any:
    folder = str(REPOSITORY / "tests")
    if folder not in sys.path:
        sys.path.append(folder)
    return import_module(name)


camera = _module("camera")
catalogue = _module("camera.catalogue")
settings = _module("camera.settings")
stimulus = _module("camera.stimulus")

"""Matplotlib, which only figures need."""

from __future__ import annotations

import importlib
from typing import Any

from adv2e.errors import MissingExtraError


def load_pyplot() -> Any:
    """Return Matplotlib's pyplot, drawing to files only.

    Raises
    ------
    MissingExtraError
        Matplotlib is not installed.
    """
    try:
        importlib.import_module("matplotlib").use("Agg")
        return importlib.import_module("matplotlib.pyplot")
    except ImportError as error:
        raise MissingExtraError("a figure", "studies") from error

"""The page of biases names keys that exist, and its examples follow from its formulas."""

from __future__ import annotations

import math
import re

import pytest

from adv2e.config.build import all_keys
from documentation.documents import ROOT

PAGE = (ROOT / "docs" / "biases.md").read_text("utf-8")
KEYS = {*re.findall(r"`(pixel\.\w+\.\w+)`", PAGE)}


def test_keys_that_it_names_exist():
    assert len(KEYS) >= 7
    assert {key.path for key in all_keys()} >= KEYS


def test_examples_follow_from_the_formulas():
    factor = 0.7 / 0.7**2 / 20
    said = {
        r"OnBn = 10 DiffBn means `on: ([\d.]+)`": factor * math.log(10),
        r"100 pA means ([\d.]+) kHz": 1e-3 * 100e-12 / (2 * math.pi * 0.025 * 131e-15),
        r"100 pA means (\d+) µs": 1e6 * 20e-15 * 0.8 / 100e-12,
        r"25 % more light is `on: ([\d.]+)`": math.log(1.25),
        r"25 % less is `off: ([\d.]+)`": -math.log(0.75),
    }
    for pattern, value in said.items():
        found = re.search(pattern, " ".join(PAGE.split()))
        assert found, pattern
        assert float(found[1]) == pytest.approx(value, rel=0.01), pattern

"""Sections made in Python, as tests and programs make them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from adv2e import compiled
from adv2e.config import Config
from adv2e.config.model import Pixel, Sampling
from adv2e.conversion.simulation import simulate
from adv2e.effects.pixel.leak import Leak
from adv2e.effects.pixel.log_response import LogResponse
from adv2e.effects.pixel.low_pass import LowPass
from adv2e.effects.pixel.refractory import Refractory
from adv2e.effects.pixel.thresholds import Thresholds
from adv2e.errors import ConfigError
from adv2e.parameters import Section, parameter


@dataclass(frozen=True, kw_only=True)
class Everything(Section):
    """A key of each kind."""

    share: float = parameter(1, unit="-", meaning="a number", at_most=2)
    limit: float | None = parameter(None, unit="-", meaning="a number or none")
    place: tuple[float, float] = parameter((0, 0), unit="px", meaning="two numbers")
    mixed: tuple[int, float] = parameter((2, 2), unit="-", meaning="one of each")
    count: int = parameter(3, unit="-", meaning="a whole number")
    on: bool = parameter(True, unit="-", meaning="a switch")


def test_whole_numbers_become_floats_where_any_number_may_stand():
    made = Everything(limit=4, place=(1, 2.5))
    assert (
        repr(made)
        == "Everything(share=1.0, limit=4.0, place=(1.0, 2.5), mixed=(2, 2.0), count=3, on=True)"
    )
    assert Everything().limit is None


def test_a_number_that_no_float_holds_is_refused():
    with pytest.raises(ConfigError, match="limit: too large a number"):
        Everything(limit=10**400)


def test_the_range_is_checked_all_the_same():
    with pytest.raises(ConfigError, match="share: must be at most 2, got 3"):
        Everything(share=3)


@pytest.mark.parametrize("form", ["exact", "paper"])
def test_whole_numbers_compile_nothing_anew(form):
    """To compile a solver takes a minute."""

    def made(number):
        return Config(
            pixel=Pixel(
                thresholds=Thresholds(on=number(1), off=number(1), mismatch=number(0)),
                log_response=LogResponse(linear_below=number(2), floor=number(1)),
                refractory=Refractory(period_us=number(100)),
                leak=Leak(rate_hz=number(1), jitter=number(0)),
                low_pass=LowPass(cutoff_hz=number(100), dark_cutoff_hz=number(1), update=form),
            ),
            sampling=Sampling(L=1, K=2),
        )

    frames, times = np.full((3, 4, 5), 0.04, np.float32), [0.0, 0.1, 0.2]
    list(simulate(frames, times, made(float), threads=1))
    seen = []
    with compiled.watched(seen.append):
        list(simulate(frames, times, made(int), threads=1))
    assert seen == []

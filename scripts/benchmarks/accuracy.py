"""Time error of a tool's events: against the dense solution of the circuit that the tool states.

The k-th ON (OFF) event of a pixel is held against the k-th ON (OFF) event of the truth.  A tool
that makes too many or too few events is therefore off by whole events from there on, as it should
be: which of its events are superfluous is not said anywhere.  The ratio of counts is told beside.
"""

from __future__ import annotations

import importlib
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.effects.frames.encoding import decode_values
from adv2e.errors import MissingExtraError
from adv2e.synthetic.clips import encode_srgb
from benchmarks.processes import REPOSITORY
from benchmarks.settings import CUTOFF_HZ, KNEE_DN, THRESHOLD

Array = NDArray[np.float64]

EVLIB_FLOOR_DN = 0.255
"""evlib's ``log_floor`` of 0.001."""


@dataclass(frozen=True)
class TimeError:
    """Distance in time of a tool's events from the truth's [us].

    Attributes
    ----------
    median, mean, worst : float
        Over all pairs; NaN without any.
    ratio : float
        Events of the tool over those of the truth.
    sequences : float
        Share of the pixels with the right sequence of polarities.
    left_out : float
        Share of the true events that are not compared: what comes after an event whose existence
        or time hangs on rounding.
    """

    median: float
    mean: float
    worst: float
    ratio: float
    sequences: float
    left_out: float


def chosen_pixels(pixels: int, count: int, seed: int = 0) -> list[int]:
    """Return the flat indices of `count` pixels, in order, spread by chance."""
    chosen = np.random.default_rng(seed).choice(pixels, min(count, pixels), replace=False)
    return [int(k) for k in np.sort(chosen)]


class Truth:
    """Events of some pixels of a clip, by the dense solver of the tests.

    Parameters
    ----------
    clip : path
        ``.npy`` file of the frames.
    frames : int
        How many of them.
    fps : float
    pixels : sequence of int
        Flat indices.

    Raises
    ------
    MissingExtraError
        SciPy is not installed.
    """

    def __init__(self, clip: str, frames: int, fps: float, pixels: Sequence[int]) -> None:
        self._solver = _solver()
        stack = np.load(clip, mmap_mode="r")[:frames]
        self._codes = np.asarray(stack.reshape(len(stack), -1)[:, list(pixels)])
        self._times = np.arange(len(stack)) / fps
        self._known: dict[str, list[Any]] = {}

    def of(self, tool: str) -> list[Any]:
        """Return the truth of each pixel under the circuit of `tool`."""
        if tool not in self._known:
            light = self._codes.astype(np.float64)
            if tool == "eventcv":  # sees the clip coded as sRGB, to 8 bits
                light = decode_values(encode_srgb(light).astype(np.float64), "srgb", 255.0)
            self._known[tool] = self._solver.dense_truth(light, self._times, _circuit(tool))
        return self._known[tool]


def _solver() -> Any:
    """Return the module of the tests that solves the circuit densely."""
    folder = str(REPOSITORY / "tests")
    if folder not in sys.path:
        sys.path.append(folder)
    try:
        return importlib.import_module("reference.dense_ode")
    except ImportError as error:
        raise MissingExtraError("the dense solution of the circuit", "studies") from error


def _circuit(tool: str) -> Any:
    """Return the circuit that a tool says it simulates, for the dense solver."""
    given: dict[str, Any] = {"linear_below": KNEE_DN, "on": THRESHOLD, "off": THRESHOLD}
    if tool == "evlib":  # a logarithm with a floor, no filter
        given |= {"linear_below": 0.0, "floor": EVLIB_FLOOR_DN, "cutoff_hz": None}
    elif tool == "eventcv":  # its corner is 0.1 + 0.9 light
        given |= {"cutoff_hz": CUTOFF_HZ, "dark_cutoff_hz": 0.1 * CUTOFF_HZ}
    else:
        given |= {"cutoff_hz": CUTOFF_HZ, "dark_cutoff_hz": 21.8}
    return _solver().Circuit(**given)


def time_error(probe: Path, truth: Sequence[Any]) -> TimeError:
    """Return how far the events stored at `probe` are from the truth of their pixels."""
    with np.load(probe) as found:
        t, pixel, on = found["t"].astype(np.float64), found["pixel"], found["p"] > 0
    return compare([(t[pixel == k], on[pixel == k]) for k in range(len(truth))], truth)


def compare(events: Sequence[tuple[Any, Any]], truth: Sequence[Any]) -> TimeError:
    """Return how far events are from the truth.

    Parameters
    ----------
    events : per pixel, (times [us], tells ON from OFF)
        In the order of time.
    truth : per pixel, Truth of the dense solver
        Events as (time [s], polarity), and until when they hang on nothing.
    """
    apart: list[Array] = []
    counted = true_count = left_out = right = 0
    for (t, on), true in zip(events, truth, strict=True):
        until = true.valid_until * 1e6
        t_true, on_true = true.events[:, 0] * 1e6, true.events[:, 1] > 0
        kept, kept_true = t < until, t_true < until
        left_out += int(np.count_nonzero(~kept_true))
        t, on = t[kept], on[kept]  # noqa: PLW2901
        t_true, on_true = t_true[kept_true], on_true[kept_true]
        counted, true_count = counted + len(t), true_count + len(t_true)
        right += np.array_equal(on, on_true)
        apart += [in_order(t[on == sign], t_true[on_true == sign]) for sign in (True, False)]
    errors = np.concatenate(apart) if apart else np.empty(0)
    return TimeError(
        median=float(np.median(errors)) if errors.size else math.nan,
        mean=float(np.mean(errors)) if errors.size else math.nan,
        worst=float(np.max(errors)) if errors.size else math.nan,
        ratio=counted / true_count if true_count else math.nan,
        sequences=right / len(truth),
        left_out=left_out / (left_out + true_count) if left_out + true_count else 0.0,
    )


def in_order(a: Any, b: Any) -> Array:
    """Return the distances between the k-th of `a` and the k-th of `b`, as far as both go."""
    shared = min(len(a), len(b))
    return np.abs(np.asarray(a[:shared], np.float64) - np.asarray(b[:shared], np.float64))

"""Whether a diagnosis was right, and about what."""

from __future__ import annotations

import math
from typing import Any

from studies.cases import LIBRARY, NOTHING, OWN_PERIOD, PAIRS
from studies.results import Line

ALONE, ALIKE, PARTLY = "named alone", "among look-alikes", "named, something left"
BOTH, ONE = "both named", "one named"
BESIDES, WRONG = "named beside a wrong name", "wrong name"
UNEXPLAINED, MISSED, FAILED = "unexplained", "missed", "failed"
WRONG_PARTLY = "wrong name, something left"
CLEAR, ALARM = "consistent", "false alarm"

OF_ONE = (ALONE, ALIKE, PARTLY, BESIDES, WRONG, WRONG_PARTLY, UNEXPLAINED, MISSED, FAILED)
"""Outcomes with one effect that the library has."""

OF_PAIRS = (BOTH, ONE, BESIDES, WRONG, WRONG_PARTLY, UNEXPLAINED, MISSED, FAILED)
OF_STRANGERS = (UNEXPLAINED, WRONG_PARTLY, WRONG, MISSED, FAILED)
"""Outcomes with an effect that the library does not have: no name is right."""

NAMED = (ALONE, ALIKE, PARTLY)
MISNAMED = (BESIDES, WRONG, WRONG_PARTLY)

NEAR = 0.10
"""Relative error of a parameter that counts as right."""

RAISED = 1.1
"""Held-out error over its floor that counts as right."""


def outcome(line: Line) -> str:
    """Return what became of a case.

    An effect counts as named if it was added, or is an alternative to what was added.  A name that
    is not in the recording, and stands for none that is, is a wrong name.
    """
    if "failed" in line:
        return FAILED
    if line["kind"] == NOTHING:
        return CLEAR if line["verdict"] == "consistent" else ALARM
    if line["verdict"] in ("consistent", "unexplained"):
        return MISSED if line["verdict"] == "consistent" else UNEXPLAINED
    added = [one["name"] for one in line["found"]]
    true = set(line["effects"]) if line["kind"] in (LIBRARY, PAIRS, OWN_PERIOD) else set()
    left = line["verdict"] == "partly_explained"
    right = true & set(added)
    wrong = [name for name in added if name not in true]
    # one of the names may stand for an alternative that is true
    if wrong and (true - right) & set(line["alternatives"]):
        right |= true & set(line["alternatives"])
        wrong = wrong[1:]
    if wrong:
        return BESIDES if right else (WRONG_PARTLY if left else WRONG)
    if line["kind"] == PAIRS:
        return BOTH if right == true else ONE
    if left:
        return PARTLY
    return ALIKE if line["alternatives"] else ALONE


def names(line: Line) -> str:
    """Return what was added, for tables."""
    added = " + ".join(one["name"] for one in line.get("found", ()))
    others = ", ".join(line.get("alternatives", ()))
    return f"{added} (or {others})" if others else added


def parameter_errors(line: Line) -> dict[str, float]:
    """Return the relative error of each fitted key of each effect that is in the recording.

    Keys that the camera holds at nothing are left out: no error is relative to that.
    """
    errors = {}
    for one in line.get("found", ()):
        if one["name"] in line["effects"]:
            for key, value in one["parameters"].items():
                error = relative_error(value, line["truth"].get(key))
                if error is not None:
                    errors[key] = error
    return errors


def relative_error(value: Any, truth: Any) -> float | None:
    """Return the distance of two numbers, lists or gammas over the size of the second."""
    found, true = _numbers(value), _numbers(truth)
    size = math.hypot(*true)
    if not true or len(found) != len(true) or size == 0.0:
        return None
    return math.dist(found, true) / size


def _numbers(value: Any) -> list[float]:
    if isinstance(value, (list, tuple)):
        return [number for one in value for number in _numbers(one)]
    if isinstance(value, str):
        kind, _, rest = value.partition(":")
        return [float(rest)] if kind == "gamma" else []
    return [float(value)] if isinstance(value, (int, float)) else []


def is_near(line: Line) -> bool | None:
    """Tell whether all fitted parameters are right; None: none was fitted."""
    errors = parameter_errors(line)
    return max(errors.values()) <= NEAR if errors else None


def covered(line: Line) -> list[bool]:
    """Tell of each fitted number whether its 95 % interval holds the truth."""
    found = []
    for one in line.get("found", ()):
        if one["name"] not in line["effects"]:
            continue
        for key, (low, high) in one["interval"].items():
            true = _numbers(line["truth"].get(key))
            for a, b, number in zip(_numbers(low), _numbers(high), true, strict=False):
                found.append(min(a, b) <= number <= max(a, b))
    return found


def is_at_floor(line: Line) -> bool:
    """Tell whether the error on held-out data is that of independent draws of one model."""
    error = line["error"]
    return bool(error["after"] <= RAISED * error["floor"])


def interval(hits: int, count: int) -> tuple[float, float]:
    r"""Return the 95 % interval of a share, `hits` of `count`.

    Source: E. B. Wilson, "Probable inference, the law of succession, and statistical inference",
    Journal of the American Statistical Association 22, 1927, doi:10.1080/01621459.1927.10502953.
    """
    if count == 0:
        return 0.0, 1.0
    z = 1.959963984540054
    share, weight = hits / count, z * z / count
    middle = (share + weight / 2) / (1 + weight)
    half = z * math.sqrt(share * (1 - share) / count + weight / (4 * count)) / (1 + weight)
    return max(0.0, middle - half), min(1.0, middle + half)

"""A comparison as a table for people."""

from __future__ import annotations

import textwrap
from typing import Any

from adv2e.sources.times.rates import seconds

_WIDTH = 100


def text(report: dict[str, Any]) -> str:
    """Return the dictionary of :func:`adv2e.comparison.compare.compare` as lines of text."""
    if "measures" not in report:
        return _sets(report)
    seeds = report["floors"]["two_seeds"] is not None
    lines = [_stream(name, report[name]) for name in ("measured", "simulated")]
    lines += [_windows(report["windows"]), ""]
    lines += _measures(report["measures"], seeds)
    lines += [*_scales(report["measures"]["error"]), "", *_told_apart(report["told_apart"]), ""]
    lines += _statistics(report["statistics"])
    lines += ["", "What each distance is"]
    for name, measure in report["measures"].items():
        lines += _paragraph(name, measure["definition"])
    lines += _paragraph("told_apart", report["told_apart"]["definition"])
    lines += ["", "What each floor is"]
    for name, definition in report["floors"].items():
        if definition is not None:
            lines += _paragraph(name, definition)
    return "\n".join([*lines, "", report["warning"]])


def _sets(report: dict[str, Any]) -> str:
    lines = [
        f"{name:<11}{one['recordings']} recordings of {one['width']}x{one['height']} pixels,"
        f" {one['events']:,} events"
        for name, one in ((name, report[name]) for name in ("measured", "simulated"))
    ]
    lines += [f"{'compared':<11}{report['pairs']} pairs have one name", ""]
    lines += [*_told_apart(report["told_apart"]), ""]
    lines += _paragraph("told_apart", report["told_apart"]["definition"])
    lines += _paragraph("half_split", report["floors"]["half_split"])
    return "\n".join([*lines, "", report["warning"]])


def _told_apart(told: dict[str, Any]) -> list[str]:
    """Return how far the two can be told apart, and by what if they can."""
    if told["value"] is None:
        return textwrap.wrap(f"told_apart: none, as {told['why_none']}", _WIDTH)
    low, high = told["interval_95"]
    floors = ", ".join(f"{k} {v:.2f}" for k, v in told["floor"].items() if v is not None)
    lines = [
        f"{'told_apart':<28}{told['value']:>10.2f}  ({low:.2f} to {high:.2f}; 0.5: cannot be told)",
        *([f"  floor: {floors}"] if floors else []),
    ]
    largest = told["differences"]["largest"]
    lines += ["  simulated against measured, where they differ most:"] * bool(largest)
    return lines + [f"    {one['text']}" for one in largest]


def _stream(name: str, stream: dict[str, Any]) -> str:
    span = "no events"
    if stream["events"]:
        first, last = (seconds(stream[end] * 1000) for end in ("first_us", "last_us"))
        span = f"{stream['events']:,} events, {first} to {last} s"
    return (
        f"{name:<11}{stream['file']} ({stream['layout']}, {stream['width']}x{stream['height']}):"
        f" {span}"
    )


def _windows(windows: dict[str, Any]) -> str:
    first, last = (seconds(windows["edges_us"][end] * 1000) for end in (0, -1))
    return (
        f"{'compared':<11}over {windows['used']} of {windows['total']} {windows['kind']},"
        f" {first} to {last} s"
    )


def _measures(measures: dict[str, Any], seeds: bool) -> list[str]:
    header = f"{'distance':<28}{'value':>10}{'half_split':>14}" + f"{'two_seeds':>14}" * seeds
    lines = [header]
    for name, measure in measures.items():
        floor = measure["floor"]
        line = f"{name:<28}{_number(measure['value']):>10}{_number(floor['half_split']):>14}"
        lines.append(line + f"{_number(floor['two_seeds']):>14}" * seeds)
    return lines


def _scales(error: dict[str, Any]) -> list[str]:
    parts = (
        f"{int(sigma) // 1000} ms {_number(value)}"
        for sigma, value in error["per_sigma_us"].items()
    )
    return [f"  error by sigma: {', '.join(parts)}"]


def _statistics(statistics: dict[str, Any]) -> list[str]:
    lines = [f"{'statistic':<28}{'measured':>14}{'simulated':>14}"]
    for name, one in statistics.items():
        if "value" in one:
            lines.append(f"{name:<28}{'':>14}{_number(one['value']):>14}")
        else:
            lines.append(f"{name:<28}{_number(one['measured']):>14}{_number(one['simulated']):>14}")
    return lines


def _number(value: float | None) -> str:
    if value is None:
        return "-"
    if isinstance(value, int) or abs(value) >= 10_000:
        return f"{value:,.0f}"
    return f"{value:.4g}"


def _paragraph(name: str, definition: str) -> list[str]:
    return textwrap.wrap(
        f"{name}: {definition}.", _WIDTH, initial_indent="  ", subsequent_indent="    "
    )

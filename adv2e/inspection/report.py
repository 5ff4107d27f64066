"""What a file holds, in two columns for people."""

from __future__ import annotations

from typing import Any

from adv2e.files.names import shown
from adv2e.sources.times.instants import seconds

_WIDTH = 12


def text(report: dict[str, Any]) -> str:
    """Return the dictionary of :func:`adv2e.inspection.inspect.inspect` as lines of text."""
    rows = [
        ("file", report["file"]),
        ("layout", report["layout"]),
        ("pixels", f"{report['width']} x {report['height']}"),
    ]
    if report["events"] is not None:
        rows += _events(report["events"])
    if report["frames"] is not None:
        rows += _frames(report["frames"])
    rows += _origin(report["metadata"])
    rows += [("problem", line) for line in report["problems"]]
    rows += [("note", line) for line in report["notes"]]
    return "\n".join(f"{name:<{_WIDTH}}{shown(value)}" for name, value in rows)


def _events(events: dict[str, Any]) -> list[tuple[str, str]]:
    rows = [("events", f"{events['count']:,} ({events['on']:,} ON, {events['off']:,} OFF)")]
    if not events["count"]:
        return rows
    rows.append(("ON share", f"{100 * events['on_share']:.2f} %"))
    rows.append(("span", _span(events["first_us"] * 1000, events["last_us"] * 1000)))
    if events["rate_hz"]:
        each = events["rate_per_pixel_hz"]
        rows.append(("rate", f"{events['rate_hz']:,.0f} events/s, {each:.4g} a pixel a second"))
    if events["tick_us"]:
        rows.append(("tick", f"{events['tick_us']} us"))
    return rows


def _frames(frames: dict[str, Any]) -> list[tuple[str, str]]:
    kind = f" of {frames['dtype']}, {'colour' if frames['colour'] else 'grey'}"
    rows = [("frames", f"{frames['count']:,}{kind if frames['dtype'] else ''}")]
    if frames["count"]:
        rows.append(("frame span", _span(frames["first_ns"], frames["last_ns"])))
    if frames["rate_hz"]:
        shortest, longest = frames["shortest_interval_ms"], frames["longest_interval_ms"]
        steps = f"{shortest:.6g}" + (f" to {longest:.6g}" if longest > shortest else "")
        rows.append(("frame rate", f"{frames['rate_hz']:.6g} Hz, intervals of {steps} ms"))
    if "light" in frames:
        rows.append(("light", frames["light"]))
    if "own_clock" in frames:
        clock = "the source's own" if frames["own_clock"] else "zero at the first frame"
        rows.append(("clock", clock))
    return rows


def _span(first_ns: int, last_ns: int) -> str:
    return f"{seconds(first_ns)} to {seconds(last_ns)} s ({seconds(last_ns - first_ns)} s)"


def _origin(metadata: dict[str, Any]) -> list[tuple[str, str]]:
    rows = []
    if "adv2e" in metadata:
        rows.append(("made by", f"adv2e {metadata['adv2e']}"))
    if "seed" in metadata:
        rows.append(("seed", str(metadata["seed"])))
    source = metadata.get("source")
    if isinstance(source, dict) and "name" in source:
        rows.append(("made from", str(source["name"])))
    return rows

"""Report on the content of a file, in two columns for people."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from adv2e.files.regular import shown
from adv2e.label import rows_of
from adv2e.sources.times.rates import seconds

_WIDTH = 12


def text(report: dict[str, Any]) -> str:
    """Return the dictionary of :func:`adv2e.info` as lines of text."""
    return "\n".join(f"{name:<{_WIDTH}}{shown(value)}" for name, value in _rows(report))


def _rows(report: dict[str, Any]) -> Iterator[tuple[str, str]]:
    yield "file", report["file"]
    if report["label"] is not None:
        yield from rows_of(report["label"])
    yield "layout", report["layout"]
    yield "pixels", f"{report['width']} x {report['height']}"
    if report["events"] is not None:
        yield from _events(report["events"])
    if report["frames"] is not None:
        yield from _frames(report["frames"])
    yield from _origin(report["metadata"])
    for name in ("problem", "note"):
        for line in report[f"{name}s"]:
            yield name, line


def _events(events: dict[str, Any]) -> Iterator[tuple[str, str]]:
    yield "events", f"{events['count']:,} ({events['on']:,} ON, {events['off']:,} OFF)"
    if events["count"]:
        yield "ON share", f"{100 * events['on_share']:.2f} %"
        yield "span", _span(events["first_us"] * 1000, events["last_us"] * 1000)
    if events["rate_hz"]:
        each = events["rate_per_pixel_hz"]
        yield "rate", f"{events['rate_hz']:,.0f} events/s, {each:.4g} a pixel a second"
    if events["tick_us"]:
        yield "tick", f"{events['tick_us']} us"
    if events["causes"]:
        made = {name: count for name, count in events["causes"].items() if count}
        yield "causes", ", ".join(f"{name} {count:,}" for name, count in made.items()) or "none"


def _frames(frames: dict[str, Any]) -> Iterator[tuple[str, str]]:
    kind = f" of {frames['dtype']}, {'colour' if frames['colour'] else 'grey'}"
    yield "frames", f"{frames['count']:,}{kind if frames['dtype'] else ''}"
    if frames["count"]:
        yield "frame span", _span(frames["first_ns"], frames["last_ns"])
    if frames["rate_hz"]:
        ends = [f"{frames[f'{end}_interval_ms']:.6g}" for end in ("shortest", "longest")]
        steps = " to ".join(dict.fromkeys(ends))  # once, if they differ by rounding alone
        yield "frame rate", f"{frames['rate_hz']:.6g} Hz, intervals of {steps} ms"
    if "light" in frames:
        yield "light", frames["light"]
    if "own_clock" in frames:
        yield "clock", "the source's own" if frames["own_clock"] else "zero at the first frame"


def _origin(metadata: dict[str, Any]) -> Iterator[tuple[str, str]]:
    if "adv2e" in metadata:
        yield "made by", f"adv2e {metadata['adv2e']}"
    if "seed" in metadata:
        yield "seed", str(metadata["seed"])
    source = metadata.get("source")
    if isinstance(source, dict) and "name" in source:
        yield "made from", str(source["name"])
        if "size" in source:
            yield "made of", _placement(source)


def _placement(source: dict[str, Any]) -> str:
    """Return the placement of the frames on the sensor: turned, cropped, fitted."""
    parts = ["frames of {}x{}".format(*source["size"])]
    if source.get("rotate180"):
        parts.append("turned by 180 degrees")
    if "crop" in source:
        x, y, width, height = source["crop"]
        parts.append(f"of which {width}x{height} at x {x}, y {y} are taken")
    if "sensor" in source:
        parts.append(source["sensor"]["text"])
    return ", ".join(parts)


def _span(first_ns: int, last_ns: int) -> str:
    return f"{seconds(first_ns)} to {seconds(last_ns)} s ({seconds(last_ns - first_ns)} s)"

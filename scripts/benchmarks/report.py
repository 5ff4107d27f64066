"""Tables of the benchmarks, in Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from writing import table

from benchmarks.frontier import Point
from benchmarks.processes import Measured, Spread, number

SPEED_ABOUT = (
    "Frames in memory to sorted events in memory, compiled and warmed up (four frames; then the"
    " garbage of the imports is collected, and 0.4 s waited for threads that spin, whatever the"
    " tool), each run in a process of its own,"
    " rounds interleaved: median (least..most). Mpx-frames: pixels times frames, in"
    " millions, as the pixel sees them (after interpolation). Time: wall time relative to the first"
    " row of the table, paired by round. Peak memory is that of the whole process, with the"
    " interpreter, libraries, clip and all events."
)
FRONTIER_ABOUT = (
    "346x260 at 240 frames a second, noise off. Error: distance in time of the k-th ON (OFF) event"
    " of a pixel from the k-th of the truth, over some pixels; the truth is a dense solution of the"
    " circuit that the tool itself states (EventCV: corner 0.1 + 0.9 light, frames as 8-bit sRGB;"
    " evlib: no filter). Events: relative to the truth. Times of adv2e and EventCV are whole"
    " microseconds, which alone is 0.25 us."
)


def megapixel_frames(measured: Measured) -> float:
    """Return pixels times frames that the pixel sees, in millions."""
    last, job = measured.last, measured.job
    return float(last["pixels"]) * seen_frames(last["frames"], job.options.get("sets", ())) / 1e6


def seen_frames(frames: int, sets: Sequence[str]) -> int:
    """Return the number of frames after interpolation by the last ``sampling.L`` of `sets`."""
    factor = 1
    for one in sets:
        key, _, value = one.partition("=")
        if key == "sampling.L":
            factor = int(value)
    return (frames - 1) * factor + 1


def speed_tables(measured: Sequence[Measured]) -> str:
    """Return a table a clip; jobs are named ``clip: what``."""
    clips: dict[str, list[Measured]] = {}
    for one in measured:
        clips.setdefault(one.job.name.partition(": ")[0], []).append(one)
    parts = [f"**{clip}**\n\n{_speed_table(rows)}" for clip, rows in clips.items()]
    return "\n\n".join([SPEED_ABOUT, *parts])


def _speed_table(measured: Sequence[Measured]) -> str:
    header = (
        "setting", "Mpx-frames/s", "a CPU second", "CPU ns a pixel-frame", "time", "frames",
        "M events", "Mev/s", "peak MiB",
    )  # fmt: skip
    return table(header, [_speed_row(one, measured[0]) for one in measured])


def _speed_row(one: Measured, first: Measured) -> list[str]:
    size, events = megapixel_frames(one), one.last["events"] / 1e6
    return [
        one.job.name.partition(": ")[2],
        str(one.wall_s().inverse(size)),
        number(size / one.cpu_s().median),
        number(1e3 * one.cpu_s().median / size),
        str(_per_frame(one, first)),
        number(seen_frames(one.last["frames"], one.job.options.get("sets", ()))),
        number(events),
        number(events / one.wall_s().median),
        peak_text(one),
    ]


def _per_frame(one: Measured, first: Measured) -> Spread:
    """Return the ratio of wall times a pixel-frame: settings may differ in length."""
    return one.ratio(first).times(megapixel_frames(first) / megapixel_frames(one))


def peak_text(one: Measured) -> str:
    """Return the peak memory [MiB], the least of the rounds: others may have compiled."""
    peaks = [r.report["peak_mib"] for r in one.rounds if r.report.get("peak_mib")]
    return f"{min(peaks):.0f}" if peaks else "-"


def frontier_table(points: Sequence[Point]) -> str:
    """Return the table of accuracy against cost."""
    header = (
        "tool", "sub-steps", "CPU ns a pixel-frame", "median error [us]", "mean [us]",
        "worst [us]", "events", "pixels with the right sequence", "left out",
    )  # fmt: skip
    rows = [
        [
            point.curve,
            point.steps or "-",
            str(point.measured.cpu_s().times(point.cpu_ns / point.measured.cpu_s().median)),
            number(point.error.median),
            number(point.error.mean),
            number(point.error.worst),
            f"{point.error.ratio:.3f}",
            f"{100 * point.error.sequences:.0f} %",
            f"{100 * point.error.left_out:.1f} %",
        ]
        for point in points
    ]
    return f"{FRONTIER_ABOUT}\n\n{table(header, rows)}"

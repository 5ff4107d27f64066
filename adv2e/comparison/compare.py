"""Comparison of a measured and a simulated recording, or of two sets; statistics of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from adv2e.comparison.distances import (
    MEASURES,
    SIGMAS_US,
    Distances,
    compact,
    distances,
    pooled,
)
from adv2e.comparison.features import trains
from adv2e.comparison.offset import latency_offset_us
from adv2e.comparison.sets import Stream, compare_sets, members
from adv2e.comparison.two_samples import Floor, in_windows
from adv2e.comparison.windows import Windows, fixed_windows, frame_windows, span_of
from adv2e.errors import DataError, UsageError, warn
from adv2e.events import Events, Window, cut
from adv2e.formats.event_file import Progress
from adv2e.formats.frames import open_frames
from adv2e.formats.reading import read_events
from adv2e.formats.recording import Recording
from adv2e.in_python import in_python
from adv2e.label import report_of
from adv2e.light.sensor import check_beside
from adv2e.options import CompareOptions, EventInput, chosen, declared, takes
from adv2e.sources import PICTURES, VIDEO_SUFFIXES, check_stored
from adv2e.sources.times.rates import seconds

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from adv2e.config import Written
    from adv2e.sources import Source

Reading = Callable[[str | Path], AbstractContextManager[Progress | None]]
"""Returns, for a file, a context within which it is read, and what is told how far it is."""

# ---- Statistics of one stream by itself: counts, rates, ON share, inter-event times.


QUANTILES = (1, 5, 25, 50, 75, 95, 99)
"""Quantiles in use [%]."""
SHORT_US = 1000
"""Limit below which an inter-event time counts as short [us]."""

STATISTICS = {
    "events": "events in the time compared",
    "on_events": "ON events",
    "off_events": "OFF events",
    "rate": "events a pixel a second",
    "on_rate": "ON events a pixel a second",
    "off_rate": "OFF events a pixel a second",
    "on_share": "ON events over all events",
    **{
        f"inter_event_us_{q:02d}": f"{q} % quantile of the time to the next event of the same"
        " pixel, of either polarity [us]"
        for q in QUANTILES
    },
    "inter_event_share_under_1ms": "share of those times below 1 ms",
}
"""Name and definition of each."""


def stream_statistics(
    events: Events, duration_s: float, width: int, height: int
) -> dict[str, float | None]:
    """Return the :data:`STATISTICS` of the events of a time [s], None where there is nothing."""
    count, on = len(events), int(np.count_nonzero(events["p"]))
    exposure = duration_s * width * height
    counts = count, on, count - on
    values: list[float | None] = [*counts, *(n / exposure for n in counts)]
    values.append(on / count if count else None)
    _, times = trains(events, width)
    if len(times):
        values += map(float, np.percentile(times, QUANTILES))
        values.append(float(np.mean(times < SHORT_US)))
    else:  # no pixel fired twice
        values += [None] * (len(QUANTILES) + 1)
    return dict(zip(STATISTICS, values, strict=True))


# ---- Noise floor of the distances: what they come to where nothing but chance differs.
#
# Each measured event goes to one of two halves by the toss of a coin. If events were a Poisson
# process, the difference of the halves would be as large as that of one full draw from its own
# rate, so the distance between the halves, over the norm of the whole, is how near the true rate
# itself would come (a second draw lies sqrt 2 times as far). It needs no model. Pixels fire more
# regularly than Poisson's, so that a model may come nearer.


SPLITS = 4
"""Half splits whose distances are averaged."""


def half_split(
    measured: Events, windows: Windows, width: int, height: int, *, splits: int = SPLITS
) -> Floor:
    """Return the distances between two halves of the measured events, mean over `splits`.

    The split draws from a generator of fixed seed: the same events give the same floor.
    """
    coin = np.random.default_rng(0)
    found = []
    for _ in range(splits):
        heads = coin.random(len(measured)) < 0.5
        halves = measured[heads], measured[~heads]
        found.append(distances(*halves, windows, width, height, whole=measured).values)
    return {name: pooled([one[name] for one in found], "mean") for name in MEASURES}


DEFAULT_WINDOW_S = 0.05
"""Length of a window where there are no frames [s]."""

WARNING = (
    "Do not set these numbers beside published ones: their definitions differ from these or are"
    " not stated."
)

OFFSET = (
    "how much later the simulated events are [us]: where the correlation of the signed streams,"
    " pixel by pixel, both smoothed with a Gaussian of 2 ms, is largest within +-50 ms; null where"
    " it does not stand out"
)

HALF_SPLIT = (
    "distance between two halves of the measured events, each event put into one of them by chance,"
    " relative measures over the norm of all: about how near the true rate of a Poisson process"
    " would come; needs no model"
)
TWO_SEEDS = (
    "distance between two simulations of the configuration given that differ in their seed alone"
    " ({} and {}); relative measures over the norm of the measured stream"
)


@takes(CompareOptions)
def compare(
    measured: Stream | Sequence[Stream],
    simulated: Stream | Sequence[Stream],
    config: Written | Sequence[Written] | None = None,
    *,
    frame_times_ns: NDArray[np.int64] | None = None,
    reading: Reading = lambda path: nullcontext(),
    doubt: Callable[[str], None] = lambda text: warn(in_python(text)),
    **options: Unpack[CompareOptions],
) -> dict[str, Any]:
    """Return all distances and statistics with their definitions and floors, ready for JSON.

    Parameters
    ----------
    measured, simulated : str, Path or Recording, or a sequence of them
        Two recordings of one size on one clock: files, or what :func:`adv2e.read_events` returned.
        Or two sets of recordings of one size: sequences, folders, or patterns such as ``a/*.h5``.
        Of sets, a classifier tells how far they can be told apart, and nothing else is returned.
    config : Config, or what :func:`adv2e.load_config` takes, optional
        With it the frames are simulated, by its seed and by the next one, for the floor of two
        seeds.
    frame_times_ns : array of int64, optional
        Times of the frames whose intervals are the windows [ns]; default: those of the frames.
    reading : Reading
        Tells of files that are read.
    doubt : callable
        Takes lines for people that ask for a look; default: they are warnings.
    **options
        See :class:`adv2e.options.CompareOptions`.  How to read a file is for files alone:
        `rotate180`, `track`, `start_s` and `stop_s` are of `measured`.

    Raises
    ------
    DataError
        Sizes differ, a stream is empty, or the streams have no whole window in common; a file
        cannot be read; there are no frames to simulate, or they have another size; a set has too
        few recordings.
    UsageError
        One is a set and the other is not, or an option is of two recordings alone.

    Examples
    --------
    >>> import numpy as np
    >>> import adv2e
    >>> frames = [np.full((24, 32), light, np.float32) for light in (0.1, 0.2, 0.4, 0.8)]
    >>> one, other = (np.concatenate([*adv2e.simulate(frames, 100, seed=k)]) for k in (1, 2))
    >>> one, other = (adv2e.Recording("array", "array", 32, 24, events) for events in (one, other))
    >>> found = adv2e.compare(one, other, window_s=0.01)
    >>> found["measures"]["relative_5_bins"]["value"] < 0.5
    True
    """
    if sets := _sets(measured, simulated, config, frame_times_ns, options):
        return {**compare_sets(sets, _readers(options, reading), doubt), "warning": WARNING}
    read = [not isinstance(one, Recording) for one in (measured, simulated)]
    measured, simulated, source = _opened(measured, simulated, options, reading)
    for line in source.doubts if source else ():
        doubt(line)
    times = measured.frame_times_ns if frame_times_ns is None else frame_times_ns
    if source is not None and frame_times_ns is None:
        times = np.array([frame.t_ns for frame in source.frames()])
    again = None
    if config is not None:
        again = _resimulation(measured, source, config, options["threads"])
    spans, window_s = _spans(measured, simulated), options["window_s"]
    if window_s is None and times is not None and len(times) > 1:
        windows = frame_windows(times, spans)
    else:
        windows = fixed_windows(max(1, round((window_s or DEFAULT_WINDOW_S) * 1e6)), spans)
    size = (measured.width, measured.height)
    (ours, theirs), *kept = compact([measured.events, simulated.events], *size)
    found = distances(ours, theirs, windows, *kept)
    floors = {"half_split": half_split(ours, windows, *kept)}
    drawn = None
    if again is not None:
        simulate_events, seeds = again
        drawn = one, other = [simulate_events(seed) for seed in seeds]
        floors["two_seeds"] = distances(one, other, windows, *size, whole=measured.events).values
    streams = measured.events, simulated.events
    for stream in compress((measured, simulated), read):
        for problem in stream.problems:
            doubt(f"{stream.path}: {problem}")
    return {
        "measured": _stream(measured),
        "simulated": _stream(simulated),
        "windows": {
            "kind": windows.kind,
            "used": len(windows.used),
            "total": windows.total,
            "edges_us": [*(start for start, _ in windows.used), windows.stop],
        },
        "measures": {name: _measure(name, found, floors) for name in MEASURES},
        "told_apart": in_windows(streams, windows, size, drawn),
        "statistics": _statistics(measured, simulated, windows),
        "floors": {
            "half_split": HALF_SPLIT,
            "two_seeds": None if again is None else TWO_SEEDS.format(*seeds),
        },
        "warning": WARNING,
    }


def _sets(
    measured: Stream | Sequence[Stream],
    simulated: Stream | Sequence[Stream],
    config: Any,
    frame_times_ns: Any,
    options: CompareOptions,
) -> tuple[list[Stream], list[Stream]] | None:
    """Return two sets of recordings, None where there are two recordings."""
    sets = members(measured), members(simulated)
    if sets == (None, None):
        return None
    if sets[0] is None or sets[1] is None:
        which = "MEASURED" if sets[0] is None else "SIMULATED"
        raise UsageError(f"{which}: is one recording, and the other is a set: give two of a kind")
    single: dict[str, Any] = {"-c": config, "frame_times_ns": frame_times_ns}
    alone = ("window_s", "frames", "start_s", "stop_s")
    single |= {declared(CompareOptions)[one].flag_of(one): options.get(one) for one in alone}
    for flag in (flag for flag, value in single.items() if value is not None):
        raise UsageError(f"{flag} is of two recordings, not of two sets of them: leave it out")
    return sets[0], sets[1]


def _readers(
    options: CompareOptions, reading: Reading
) -> tuple[Callable[[Stream], Recording], Callable[[Stream], Recording]]:
    """Return what reads a recording of the measured and of the simulated set."""
    given = chosen(EventInput, options)
    of_simulated: EventInput = {**given, "rotate180": False, "track": None}
    return (
        lambda stream: _read(stream, given, reading),
        lambda stream: _read(stream, of_simulated, reading),
    )


def _opened(
    measured: Any,
    simulated: Any,
    options: CompareOptions,
    reading: Reading,
) -> tuple[Recording, Recording, Source | None]:
    """Return both streams, and the frames from elsewhere if there are any."""
    given, frames = chosen(EventInput, options), options["frames"]
    whole: EventInput = {"rotate180": False, "track": None, "start_s": None, "stop_s": None}
    # of the frames, lists and files of events have times in a unit; a video has its own
    has_own = frames is not None and Path(frames).suffix.lower() in (*VIDEO_SUFFIXES, *PICTURES)
    names = ("rotate180", "crop") if has_own else ("rotate180", "crop", "time_unit")
    of_frames: Any = {name: value for name, value in given.items() if name in names}
    of_files = {
        *(() if isinstance(measured, Recording) else given),
        *(() if isinstance(simulated, Recording) else given.keys() - whole.keys()),
        *(() if frames is None else of_frames),
    }
    for name in (name for name, value in given.items() if value and name not in of_files):
        raise UsageError(f"{name}: is of the reading of a file: leave it out")
    if frames is not None:
        check_stored(frames)
    return (
        _read(measured, given, reading),
        _read(simulated, {**given, **whole}, reading),
        None if frames is None else open_frames(frames, **of_frames),
    )


def _read(stream: Stream, given: EventInput, reading: Reading) -> Recording:
    if isinstance(stream, Recording):
        return stream
    with reading(stream) as progress:
        return read_events(stream, progress=progress, **given)


def _resimulation(
    measured: Recording,
    source: Source | None,
    written: Written | Sequence[Written],
    threads: int | None,
) -> tuple[Callable[[int], Events], tuple[int, int]]:
    """Return what simulates the frames of `source`, or of `measured`, by a seed; and two seeds."""
    # all this is needed for a configuration alone
    from adv2e.comparison.resimulation import resimulator  # noqa: PLC0415
    from adv2e.config import load_config  # noqa: PLC0415
    from adv2e.kernel.rng import LARGEST_SEED  # noqa: PLC0415

    config, size = load_config(written), (measured.width, measured.height)
    if source is not None:
        frames, encoding = source.frames, source.encoding
    elif measured.frame_times_ns is not None:
        check_beside(*size, config.sensor, measured.path)
        config = replace(config, sensor=None)
        frames, encoding = measured.frames, measured.encoding
    else:
        raise DataError(
            f"{measured.path}: holds no frames to simulate with this configuration; give them with"
            " --frames"
        )
    simulate_events = resimulator(frames, config, encoding, size, threads=threads)
    return simulate_events, (config.seed, (config.seed + 1) % (LARGEST_SEED + 1))


def _spans(measured: Recording, simulated: Recording) -> list[Window]:
    """Return the spans of both, after checking that they can be compared."""
    # a simulated pixel may keep still while its frames last; measured events may be a part cut out
    spans = []
    for stream, times in ((measured, None), (simulated, simulated.frame_times_ns)):
        span = span_of(stream.events, times)
        if span is None:
            raise DataError(f"{stream.path}: holds no events, so there is nothing to compare")
        spans.append(span)
    if (measured.width, measured.height) != (simulated.width, simulated.height):
        raise DataError(
            f"{simulated.path}: {simulated.width}x{simulated.height} pixels, but {measured.path}"
            f" has {measured.width}x{measured.height}: only streams of one size can be compared"
        )
    if spans[0][1] < spans[1][0] or spans[1][1] < spans[0][0]:
        raise DataError(
            f"{simulated.path}: spans {_seconds(spans[1])}, {measured.path} {_seconds(spans[0])};"
            " they have no time in common and must be on one clock (see convert --t0)"
        )
    return spans


def _seconds(span: Window) -> str:
    return f"{seconds(span[0] * 1000)} to {seconds(span[1] * 1000)} s"


def _stream(stream: Recording) -> dict[str, Any]:
    events = stream.events
    return {
        "file": str(stream.path),
        "layout": stream.layout,
        "width": stream.width,
        "height": stream.height,
        "events": len(events),
        "first_us": int(events["t"][0]) if len(events) else None,
        "last_us": int(events["t"][-1]) if len(events) else None,
        "label": report_of(stream.metadata, stream.problems),
    }


def _measure(name: str, found: Distances, floors: dict[str, Floor]) -> dict[str, Any]:
    about = MEASURES[name]
    parts = found.per_window[name]
    return {
        "definition": about.definition,
        "value": found.values[name],
        "floor": {which: floors[which][name] if which in floors else None for which in _FLOORS},
        **(
            {"per_sigma_us": {str(s): v for s, v in zip(SIGMAS_US, parts, strict=True)}}
            if name == "error"
            else {"per_window": parts}
        ),
    }


_FLOORS = ("half_split", "two_seeds")


def _statistics(measured: Recording, simulated: Recording, windows: Windows) -> dict[str, Any]:
    ours, theirs = (cut(s.events, windows.start, windows.stop) for s in (measured, simulated))
    size = measured.width, measured.height
    told = [stream_statistics(events, windows.duration_s, *size) for events in (ours, theirs)]
    each = {
        name: {"definition": definition, "measured": told[0][name], "simulated": told[1][name]}
        for name, definition in STATISTICS.items()
    }
    offset = latency_offset_us(ours, theirs, measured.width)
    return {**each, "latency_offset_us": {"definition": OFFSET, "value": offset}}

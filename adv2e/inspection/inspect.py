"""Inspection of one file: content, problems and notes, of its events among others."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from adv2e.causes import CAUSES, has_causes
from adv2e.effects.frames.encoding import full_scale_of
from adv2e.errors import DataError, UsageError
from adv2e.events import Events, pixels_of
from adv2e.files.regular import check_ends, shown
from adv2e.files.zips import Members
from adv2e.formats.reading import Recording, read_events
from adv2e.formats.registry import may_hold_events
from adv2e.label import Label
from adv2e.light.decoding import light_line, light_text
from adv2e.options import EventInput, InfoOptions, SourceOptions, chosen, declared, takes
from adv2e.sources import OPENERS, PICTURES, STDIN, Source, is_live, open_source
from adv2e.sources.frame import Light
from adv2e.sources.stored import EVENTS, LIST
from adv2e.sources.times.rates import seconds

if TYPE_CHECKING:
    from typing_extensions import Unpack


@takes(InfoOptions)
def info(
    path: str | Path,
    *,
    progress: Callable[[int, int | None], None] | None = None,
    **options: Unpack[InfoOptions],
) -> dict[str, Any]:
    """Return the content of a recording, an event file or an input with frames, ready for JSON.

    Parameters
    ----------
    path : str or Path
        Any file or folder that can be compared or converted.
    progress : callable, optional
        Is called now and then with two numbers: how much was read, and of how much, where that is
        known.
    **options
        See :class:`adv2e.options.InfoOptions`.  Events outside the sensor are told, however many.

    Returns
    -------
    dict
        ``file``, ``label`` (None without), ``layout``, ``width``, ``height``, ``events`` (None
        without), ``frames`` (None without), ``problems``, ``notes``, ``metadata``: always all.

    Raises
    ------
    DataError
        The file is missing, of an unknown kind, or cannot be read.

    Examples
    --------
    >>> import os, tempfile
    >>> from adv2e import info, write_events
    >>> from adv2e.events import make_events
    >>> events = make_events(t=[10, 20], x=[0, 3], y=[0, 2], p=[1, 0])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_events(os.path.join(folder, "a.h5"), events, (4, 3))
    ...     found = info(os.path.join(folder, "a.h5"))
    >>> found["width"], found["height"], found["events"]["count"]
    (4, 3, 2)
    """
    given, path = path, Path(path)
    if is_live(given):
        if options["stop_s"] is None and "://" not in str(given):
            raise UsageError(f"{given}: a camera has no end: --stop S says when to stop")
    else:
        check_ends(path)
    if str(path) == STDIN or is_live(given) or _has_only_frames(path):
        if options["size"] is not None and options["pixel_format"] is None:
            raise UsageError(
                "--size is that of raw video here, of which --pixel-format says the rest: frames"
                " are described as they are"
            )
        source = open_source(given, **chosen(SourceOptions, options))
        return _of_source(source, progress or (lambda done, total: None))
    for name in ("fps", "timestamps", "bayer", "pixel_format", "allow_damaged"):
        if options.get(name):
            flag = declared(InfoOptions)[name].flag_of(name)
            raise DataError(f"{path}: its events are described: leave {flag} out")
    reading: EventInput = {**chosen(EventInput, options), "crop_events": True}
    return _of_recording(read_events(path, progress=progress, **reading))


def _has_only_frames(path: Path) -> bool:
    if path.is_dir():
        return not may_hold_events(path)
    if path.suffix.lower() == ".zip":
        from adv2e.sources.zipped import images_in  # noqa: PLC0415  (needs OpenCV)

        files = Members(path)
        return bool(files.enter(LIST) or images_in(files)) and not files.enter(EVENTS)
    suffix = path.suffix.lower()
    return (suffix in OPENERS or suffix in PICTURES) and not may_hold_events(path)


def _of_recording(recording: Recording) -> dict[str, Any]:
    size = (recording.width, recording.height)
    frames = None
    if recording.frame_times_ns is not None:
        first = next(recording.frames(), None)
        frames = {
            **describe_times(recording.frame_times_ns),
            "dtype": None if first is None else first.image.dtype.name,
            "colour": None if first is None else first.image.ndim == 3,
        }
        if first is not None:
            white = first.white or full_scale_of(first.image.dtype)
            frames.update(_light(recording.light, white))
    return {
        "file": shown(recording.path),
        "label": recording.metadata.get("label"),
        "layout": recording.layout,
        "width": recording.width,
        "height": recording.height,
        "events": describe_events(recording.events, *size),
        "frames": frames,
        "problems": [*recording.problems, *oddities_of(recording.events, *size)],
        "notes": [],
        "metadata": {key: one for key, one in recording.metadata.items() if key != "label"},
    }


def _light(light: Light, white: float) -> dict[str, Any]:
    return {
        "encoding": light.encoding,
        "full_scale": white,
        "light": light_text(light, white),
    }


def _of_source(source: Source, progress: Callable[[int, int | None], None]) -> dict[str, Any]:
    times: list[int] = []
    for frame in source.frames():
        times.append(frame.t_ns)
        progress(len(times), source.count)
    times_ns = np.array(times, np.int64)
    doubt = source.doubt_of_white(source.largest_read)  # known once all frames were read
    label = Label()
    label.add(light_line(source.light, source.full_scale), *source.doubts, *source.notes, doubt)
    return {
        "file": shown(source.path),
        "label": label.entries,
        "layout": source.kind,
        "width": source.width,
        "height": source.height,
        "events": None,
        "frames": {
            **describe_times(times_ns),
            "dtype": source.dtype.name,
            "colour": source.colour,
            **_light(source.light, source.full_scale),
            "own_clock": source.has_clock,
        },
        "problems": list(filter(None, (*source.doubts, doubt))),
        "notes": list(source.notes),
        "metadata": {},
    }


def describe_times(times_ns: NDArray[np.int64]) -> dict[str, Any]:
    """Return count, span, rate and intervals of frames; None for what one frame cannot tell.

    Parameters
    ----------
    times_ns : array of int64, (frames,)
        Times of the frames [ns], increasing.
    """
    steps_ms = np.diff(times_ns) / 1e6
    count = len(times_ns)
    duration_s = (int(times_ns[-1]) - int(times_ns[0])) / 1e9 if count else None
    return {
        "count": count,
        "first_ns": int(times_ns[0]) if count else None,
        "last_ns": int(times_ns[-1]) if count else None,
        "duration_s": duration_s,
        "rate_hz": (count - 1) / duration_s if duration_s else None,
        "shortest_interval_ms": float(steps_ms.min()) if len(steps_ms) else None,
        "longest_interval_ms": float(steps_ms.max()) if len(steps_ms) else None,
    }


# ---- Inspection of a stream of events: numbers, rates, and problems.


GAP_STEPS = 100
"""A gap is longer than this many median steps between events, ..."""
GAP_US = 10_000
"""... and than this [us]: shorter pauses are ordinary, since events come in bursts."""
HOT_FACTOR = 10
"""A hot pixel fires more often than this many times the 99.9 % quantile of all pixels."""
HOT_LISTED = 5
"""Hot pixels listed by position."""


def describe_events(events: Events, width: int, height: int) -> dict[str, Any]:
    """Return counts, span, rates and tick of `events`; None for what a few events cannot tell."""
    count, on = len(events), int(np.count_nonzero(events["p"]))
    first = int(events["t"].min()) if count else None
    last = int(events["t"].max()) if count else None
    duration_s = (last - first) / 1e6 if first is not None and last is not None else None
    rate_hz = count / duration_s if duration_s else None
    return {
        "count": count,
        "on": on,
        "off": count - on,
        "on_share": on / count if count else None,
        "first_us": first,
        "last_us": last,
        "duration_s": duration_s,
        "rate_hz": rate_hz,
        "rate_per_pixel_hz": rate_hz / (width * height) if rate_hz else None,
        "tick_us": tick_us(events),
        "causes": causes_of(events),
    }


def causes_of(events: Events) -> dict[str, int] | None:
    """Return the number of events of each cause, by its name; None: causes are not recorded."""
    if not has_causes(events):
        return None
    counts = np.bincount(events["cause"], minlength=len(CAUSES)).tolist()
    return dict(zip(CAUSES, counts, strict=True))


def tick_us(events: Events) -> int | None:
    """Return the greatest common divisor of all time differences [us], None if there are none."""
    if not len(events):
        return None
    return int(np.gcd.reduce(events["t"] - events["t"][0])) or None


def oddities_of(events: Events, width: int, height: int) -> list[str]:
    """Return gaps in time and hot pixels of sorted `events`, a line each."""
    if not len(events):
        return []
    return [line for line in (_gaps(events), _hot(events, width, height)) if line]


def _gaps(events: Events) -> str:
    steps = np.diff(events["t"])
    moving = steps[steps > 0]
    if not len(moving):
        return ""
    limit = max(GAP_US, GAP_STEPS * float(np.median(moving)))
    gaps = np.flatnonzero(steps > limit)
    if not len(gaps):
        return ""
    longest = int(np.argmax(steps))
    return (
        f"{_number_of(len(gaps), 'gap')} over {limit / 1000:g} ms, the longest of"
        f" {steps[longest] / 1000:g} ms after {seconds(int(events['t'][longest]) * 1000)} s"
    )


def _hot(events: Events, width: int, height: int) -> str:
    # of the pixels that fired, as a sensor may be stated to be of any size
    pixels, counts = np.unique(pixels_of(events, width), return_counts=True)
    hot = np.flatnonzero(counts > HOT_FACTOR * max(_quantile(counts, width * height, 0.999), 1.0))
    if not len(hot):
        return ""
    top = hot[np.argsort(-counts[hot], kind="stable")][:HOT_LISTED]
    listed = ", ".join(
        f"({pixels[i] % width}, {pixels[i] // width}): {counts[i]:,} events" for i in top
    )
    more = f" and {len(hot) - len(top):,} more" if len(hot) > len(top) else ""
    return f"{_number_of(len(hot), 'hot pixel')} (x, y): {listed}{more}"


def _quantile(counts: NDArray[np.int64], pixels: int, share: float) -> float:
    """Return a quantile of the counts of so many pixels, of which all others have none."""
    ordered = np.sort(counts)
    place = share * (pixels - 1)
    below = int(place)
    ranks = np.array([below, min(below + 1, pixels - 1)]) - (pixels - len(counts))
    low, high = np.where(ranks >= 0, ordered[np.maximum(ranks, 0)], 0)
    return float(low + (high - low) * (place - below))


def _number_of(count: int, what: str) -> str:
    return f"{count:,} {what}" + "s" * (count != 1)

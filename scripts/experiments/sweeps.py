r"""Edges that sweep over a bright wall in a real recording, timed by the exposure that they blur.

While the shutter is open, a pixel that a dark thing uncovers gathers the light b of the thing up to
the passage of its edge, and that of the wall, a, from then on.  Its value m tells when the edge
passed, in an exposure from :math:`t_0` to :math:`t_1`,

.. math:: t = t_1 - \frac{m - b}{a - b}\,(t_1 - t_0)

(where it is covered, the other way round).  Times of a row lie on a straight line, whose slope is
taken to be that of all rows of a sweep.  The wall is the median of all frames; b is not known, as
the thing moves and shines: all is told for two values of it, between which it lies.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from writing import table

from adv2e.errors import DataError
from adv2e.events import Events
from experiments.clip import Simulator
from experiments.edges import Edges, Latencies, Passages, Values, apart, latencies
from experiments.recordings import Recording

BEHIND_DN = (1.0, 8.0)
"""Light of the thing: bounds [DN]."""
SHARES = (0.1, 0.9)
"""Of an exposure: values nearer to its ends are not used."""
FEWEST = 8
"""Pixels of a row that are needed."""
LEAD_US = 6000.0
"""Events this long before the passage are counted to it [us]."""
HALF_WIDTH_PX = 1.4
"""Of the rendered edges: limbs of the balls of a Newton's cradle at rest change in 3 px [px]."""
RATE_HZ = 4000.0
"""Frames a second of the rendered edges: simulators see all of their motion."""


class Sweep(NamedTuple):
    """Where an edge blurs an exposure: frame, first and last columns and rows, polarity."""

    frame: int
    columns: tuple[int, int]
    rows: tuple[int, int]
    polarity: int

    def __str__(self) -> str:
        sign = "ON" if self.polarity else "OFF"
        return (
            f"{self.frame},{self.columns[0]}:{self.columns[1]},{self.rows[0]}:{self.rows[1]},{sign}"
        )


class SweepType(click.ParamType):
    """``FRAME,X0:X1,Y0:Y1,ON`` or ``OFF``."""

    name = "SWEEP"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> Sweep:
        """Return the sweep."""
        if isinstance(value, Sweep):
            return value
        try:
            frame, columns, rows, sign = str(value).split(",")
            (x0, x1), (y0, y1) = ((int(v) for v in one.split(":")) for one in (columns, rows))
            return Sweep(int(frame), (x0, x1), (y0, y1), {"ON": 1, "OFF": 0}[sign])
        except (KeyError, ValueError):
            self.fail(f"{value!r}: must be FRAME,X0:X1,Y0:Y1,ON or OFF, such as 2,16:45,152:159,ON")


class Timed(NamedTuple):
    """A sweep with its passages, light of the wall [DN], and scatter of single pixels [us]."""

    passages: Passages
    wall: float
    scatter_us: float


def exposures_of(folder: Path, frames: int) -> Values:
    """Return start and end of each exposure [us], from ``exposures.txt``.

    Raises
    ------
    DataError
        There is no such file, or it has not a line for each frame.
    """
    path = folder / "exposures.txt"
    if not path.is_file():
        raise DataError(
            f"{path}: no such file; passages need the exposures, a line a frame: name, start and"
            " end [s]"
        )
    lines = [one.split("#")[0].split() for one in path.read_text("utf-8").splitlines()]
    try:
        found = np.array([[1e6 * float(value) for value in one[1:]] for one in lines if one])
    except ValueError:
        found = np.empty((0, 2))
    if found.shape != (frames, 2) or (found[:, 0] >= found[:, 1]).any():
        raise DataError(f"{path}: must be {frames} lines, one a frame: name, start and end [s]")
    return found


def timed(frames: Values, exposures_us: Values, sweep: Sweep, behind_dn: float) -> Timed:
    """Return when the edge of a sweep passed the pixels whose values tell it.

    Parameters
    ----------
    frames : (frames, rows, columns)
        Light [DN].
    exposures_us : (frames, 2)
        Start and end of each [us].
    sweep : Sweep
    behind_dn : float
        Light of the thing [DN].

    Raises
    ------
    DataError
        It is outside of the recording, or no row of it tells enough.
    """
    x, y = (np.arange(low, high + 1) for low, high in (sweep.columns, sweep.rows))
    rows, columns = frames.shape[1:]
    inside = 0 <= sweep.frame < len(frames) and x.size and y.size
    if not inside or min(x[0], y[0]) < 0 or x[-1] >= columns or y[-1] >= rows:
        raise DataError(
            f"sweep {sweep}: not within {len(frames)} frames of {columns}x{rows} pixels"
        )
    part = np.ix_(y, x)
    wall = np.median(frames, axis=0)[part]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (frames[sweep.frame][part] - behind_dn) / (wall - behind_dn)
    share = share if sweep.polarity else 1.0 - share
    start, end = exposures_us[sweep.frame]
    time = end - share * (end - start)
    used = (share >= SHARES[0]) & (share <= SHARES[1]) & (wall > 2 * BEHIND_DN[1])
    used &= used.sum(axis=1, keepdims=True) >= FEWEST
    if not used.any():
        raise DataError(f"sweep {sweep}: no row has {FEWEST} pixels that the edge blurs")
    when = np.full(frames.shape[1:], np.nan)
    when[part] = np.where(used, time, np.nan)
    line, _ = straight(when)
    return Timed(
        Passages(
            time_us=line, last=np.zeros(when.shape, np.bool_),
            band=np.where(np.isfinite(when), 0, -1), polarity=(sweep.polarity,), lead_us=LEAD_US,
        ),
        wall=float(np.median(wall)), scatter_us=float(np.sqrt(np.nanmean((when - line) ** 2))),
    )  # fmt: skip


def straight(time_us: Values) -> tuple[Values, float]:
    """Return times on straight lines along the rows, of one slope for all, and that [us/px].

    Parameters
    ----------
    time_us : (rows, columns)
        NaN where unknown, and there in the result.
    """
    known = np.isfinite(time_us)
    count = np.maximum(1, known.sum(axis=1, keepdims=True))
    place = np.broadcast_to(np.arange(time_us.shape[1]), time_us.shape)
    middle = np.where(known, place, 0).sum(axis=1, keepdims=True) / count
    level = np.where(known, time_us, 0.0).sum(axis=1, keepdims=True) / count
    away = np.where(known, place - middle, 0.0)
    slope = float(np.nansum(away * (time_us - level)) / (away**2).sum())
    return np.where(known, level + slope * away, np.nan), slope


def passed_by(events: Events, sweep: Sweep, passages: Passages) -> tuple[Latencies, float]:
    """Return the latencies of a sweep's events, and the speed of its first ones [px/s].

    A passage ends with the first event of the other polarity: that is of the next edge.
    """
    x0, x1, y0, y1 = *sweep.columns, *sweep.rows
    kept, first = [], np.full(passages.band.shape, np.nan)
    near = (events["x"] >= x0) & (events["x"] <= x1) & (events["y"] >= y0) & (events["y"] <= y1)
    events = events[near]
    for y, x in np.argwhere(passages.band == 0):
        mine = events[(events["x"] == x) & (events["y"] == y)]
        mine = mine[mine["t"] >= passages.time_us[y, x] - passages.lead_us]
        ours = mine["p"] == sweep.polarity
        if not ours.any():
            continue
        mine, ours = mine[np.argmax(ours) :], ours[np.argmax(ours) :]
        kept.append(mine[: len(ours) if ours.all() else np.argmin(ours)])
        first[y, x] = mine["t"][0]
    stream = np.concatenate(kept) if kept else events[:0]
    return latencies(stream, passages, 0), 1e6 / abs(straight(first)[1])


def since_first(of: Latencies, half: int | None = None) -> Values:
    """Return how long after the first event of their passage the others come [us].

    `half`: of every second passage only, from this one on (0 or 1).
    """
    first = np.flatnonzero(of.number == 1)
    passage = np.cumsum(of.number == 1) - 1
    used = of.number > 1
    if half is not None:
        used &= passage % 2 == half
    return np.asarray((of.of - of.of[first][passage])[used])


def report(
    real: Recording,
    exposures_us: Values,
    sweeps: Sequence[Sweep],
    simulators: Sequence[Simulator],
) -> tuple[str, dict[str, Any]]:
    """Return what sweeps of a recording tell, beside rendered edges of the same speed.

    Raises
    ------
    DataError
        See :func:`timed`.
    """
    frames = np.array([np.asarray(frame.image, np.float64) for frame in real.source.frames()])
    passed, bursts, numbers = [], [], {}
    for sweep in sweeps:
        for behind in BEHIND_DN:
            one = timed(frames, exposures_us, sweep, behind)
            found, speed = passed_by(real.events, sweep, one.passages)
            low, middle, high = 1e-3 * np.percentile(found.numbered(1), (10, 50, 90))
            passed.append([
                f"{sweep}, {behind:g} DN", found.pixels, f"{speed:.0f}", f"{one.wall:.0f}",
                f"{1e-3 * one.scatter_us:.1f}", f"{middle:.1f} ({low:.1f} to {high:.1f})",
            ])  # fmt: skip
        delays = since_first(found)
        every = {f"{sweep}: measured": np.sort(delays).tolist()}
        floor = apart(since_first(found, 0), since_first(found, 1))
        bursts.append([*every, *_cells(found, delays)[:2], f"{floor:.0f}"])
        for simulator in simulators:
            for behind in BEHIND_DN:
                name = f"{simulator.name}, {behind:g} DN"
                of = _rendered(simulator, sweep, speed, (behind, one.wall))
                bursts.append([name, *_cells(of, delays)])
                every[name] = np.sort(since_first(of)).tolist()
        numbers[str(sweep)] = every
    text = [
        f"## {real.name}: measured",
        "Passages by the blur of an exposure, for two values of the light of the thing that moves.",
        table(
            ["", "pixels", "speed [px/s]", "wall [DN]", "scatter [ms]",
             "first event after the passage [ms]"], passed,
        ),
        "Events of a passage after its first one, and those of rendered edges of the same speed"
        f" between that light and the wall, {RATE_HZ:g} frames a second. Measured: the distance is"
        " that between halves.",
        table(["", "events a passage", "since the first [ms]", "distance [us]"], bursts),
    ]  # fmt: skip
    return "\n\n".join(text), numbers


def _cells(of: Latencies, measured: Values) -> list[str]:
    """Return events a passage, delays, and the distance of these to measured ones."""
    delays = since_first(of)
    if not len(delays):
        return [f"{of.mean_count:.1f}", "none", ""]
    low, middle, high = 1e-3 * np.percentile(delays, (10, 50, 90))
    spread = f"{middle:.1f} ({low:.1f} to {high:.1f})"
    return [f"{of.mean_count:.1f}", spread, f"{apart(delays, measured):.0f}"]


def _rendered(
    simulator: Simulator, sweep: Sweep, speed: float, pair: tuple[float, float]
) -> Latencies:
    """Return what a simulator makes of a rendered edge of that speed between these lights."""
    stop_s = 40.0 / speed
    edges = Edges(
        pairs=(pair,), speed=speed, stop_s=stop_s, end_s=stop_s + 0.06, columns=40,
        half_width=HALF_WIDTH_PX,
    )  # fmt: skip
    events = simulator.events(edges.clip(RATE_HZ), 0)
    return latencies(events, edges.passages(), 0 if sweep.polarity else 1)

"""Tables and the picture of a timing test."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from writing import load_pyplot, save_figure, table

from adv2e.events import Events
from experiments.edges import After, Band, Latencies, Passages, Values, after_stop, apart, latencies

FEWEST = 0.3
"""Latencies of events are told where this share of the passages have such an event."""

TRUTH = "truth"


@dataclass(frozen=True)
class Row:
    """A simulator's events, or the truth's: by seeds, then by edges.

    Attributes
    ----------
    name, nature : str
    passed : list of list of Latencies
    stopped : list of list of After
    """

    name: str
    nature: str
    passed: list[list[Latencies]]
    stopped: list[list[After]]

    def latencies(self, band: int, number: int | None = None) -> Values:
        """Return latencies of an edge [us], of all seeds; of all events if `number` is None."""
        return np.concatenate(
            [one[band].of if number is None else one[band].numbered(number) for one in self.passed]
        )

    def has(self, band: int, number: int) -> float:
        """Return the share of the passages that have a `number`-th event."""
        return len(self.latencies(band, number)) / sum(one[band].pixels for one in self.passed)


def row_of(name: str, nature: str, streams: Sequence[Events], passages: Passages) -> Row:
    """Return what streams of several seeds come to."""
    bands = range(len(passages.polarity))
    return Row(
        name, nature,
        [[latencies(one, passages, band) for band in bands] for one in streams],
        [[after_stop(one, passages, band) for band in bands] for one in streams],
    )  # fmt: skip


@dataclass(frozen=True)
class Part:
    """One kind of truth: the edges, the truth's row and those of the simulators."""

    title: str
    about: str
    bands: list[Band]
    truth: Row
    rows: list[Row]

    @property
    def pairs(self) -> list[tuple[str, list[int]]]:
        """Levels of light, and the edges between them."""
        found: dict[str, list[int]] = {}
        for k, band in enumerate(self.bands):
            found.setdefault(f"{band.dark:g}-{band.bright:g} DN", []).append(k)
        return list(found.items())

    def distances(self, row: Row, bands: Sequence[int], number: int | None) -> list[float]:
        """Return Wasserstein-1 distances to the truth [us]: the mean over edges, by pairs of seeds.

        Of the truth's own row, between different seeds: the floor.
        """
        every = itertools.product(range(len(row.passed)), range(len(self.truth.passed)))
        pairs = [(a, b) for a, b in every if row is not self.truth or a < b]

        def of(one: Latencies) -> Values:
            return one.of if number is None else one.numbered(number)

        return [
            float(
                np.mean(
                    [
                        apart(of(row.passed[a][band]), of(self.truth.passed[b][band]))
                        for band in bands
                    ]
                )
            )
            for a, b in pairs
        ]

    def tables(self) -> str:
        """Return all tables."""
        parts = [f"## {self.title}", self.about]
        for number in self._told():
            parts += [
                f"Latency of event {number} after the passage [ms]: median (10 to 90 %).",
                self._by_edge(lambda row, band, number=number: _spread(row, band, number)),
            ]
        for number, what in ((1, "the first event"), (None, "all events")):
            parts += [
                f"Wasserstein-1 distance of the latencies of {what} to the truth's [us], mean of ON"
                " and OFF edges and of pairs of seeds, ± half the range of the pairs. Truth:"
                " between its own seeds.",
                self._by_pair(
                    lambda row, bands, number=number: _mean(self.distances(row, bands, number), 0)
                ),
            ]
        parts += [
            "Events a passage, ON / OFF.",
            self._by_pair(lambda row, bands: " / ".join(
                f"{np.mean([one[band].mean_count for one in row.passed]):.2f}" for band in bands
            )),
            "Events after the stop: share of those of the last pixels, number for each line of an"
            " edge (± half the range of the seeds), decay time [ms]. Mean of ON and OFF edges.",
            self._by_pair(_stopped),
        ]  # fmt: skip
        return "\n\n".join(parts)

    def _told(self) -> list[int]:
        """Return the first event, and the last of the next two that the truth has at all edges."""
        edges = range(len(self.bands))
        others = [k for k in (3, 2) if all(self.truth.has(b, k) >= FEWEST for b in edges)]
        return [1, *others[:1]]

    def _by_edge(self, cell: Callable[[Row, int], str]) -> str:
        head = [
            f"{name}, {'ON' if self.bands[band].polarity else 'OFF'}"
            for name, bands in self.pairs for band in bands
        ]  # fmt: skip
        columns = [band for _, bands in self.pairs for band in bands]
        rows = [
            [row.name, *(cell(row, band) for band in columns)] for row in [self.truth, *self.rows]
        ]
        return table(["", *head], rows)

    def _by_pair(self, cell: Callable[[Row, list[int]], str]) -> str:
        rows = [
            [row.name, *(cell(row, bands) for _, bands in self.pairs)]
            for row in [self.truth, *self.rows]
        ]
        return table(["", *(name for name, _ in self.pairs)], rows)

    def numbers(self) -> dict[str, Any]:
        """Return all numbers."""
        return {row.name: self._numbers(row) for row in [self.truth, *self.rows]}

    def _numbers(self, row: Row) -> dict[str, Any]:
        edges = {}
        for k, band in enumerate(self.bands):
            name = f"{band.dark:g}-{band.bright:g} {'ON' if band.polarity else 'OFF'}"
            edges[name] = {
                "events a passage": [one[k].mean_count for one in row.passed],
                "latency_us": {
                    str(number): {
                        "share": row.has(k, number),
                        "percentiles 10 50 90": _percentiles(row.latencies(k, number)),
                    }
                    for number in range(1, 6)
                },
                "distance_us": {
                    what: [_plain(v) for v in self.distances(row, [k], number)]
                    for what, number in (("first", 1), ("all", None))
                },
                "after the stop": [
                    {key: _plain(value) for key, value in vars(one[k]).items()}
                    for one in row.stopped
                ],
            }
        return {"nature": row.nature, "edges": edges}


def _plain(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _percentiles(values: Values) -> list[float] | None:
    return np.percentile(values, (10, 50, 90)).tolist() if len(values) else None


def _spread(row: Row, band: int, number: int) -> str:
    if row.has(band, number) < FEWEST:
        return ""
    low, middle, high = np.percentile(row.latencies(band, number), (10, 50, 90)) * 1e-3
    return f"{middle:.2f} ({low:.2f} to {high:.2f})"


def _mean(values: Sequence[float], digits: int) -> str:
    there = [value for value in values if np.isfinite(value)]
    if not there:
        return ""
    half = 0.5 * (max(there) - min(there))
    spread = f" ± {half:.{digits}f}" if len(there) > 1 else ""
    return f"{np.mean(there):.{digits}f}{spread}"


def _stopped(row: Row, bands: list[int]) -> str:
    means = [[one[band] for band in bands] for one in row.stopped]
    share = np.nanmean([[one.share for one in seed] for seed in means])
    count = _mean([float(np.mean([one.count for one in seed])) for seed in means], 1)
    decays = [one.decay_us for seed in means for one in seed if np.isfinite(one.decay_us)]
    decay = f"{1e-3 * np.mean(decays):.1f}" if decays else "none"
    return f"{100 * share:.0f} %, {count}, {decay}"


def draw(parts: Sequence[Part], path: Path) -> None:
    """Draw latencies of all events by brightness, simulators side by side, a column each part.

    Bars from 10 to 90 %, thick from 25 to 75 %, dots at the median; the truth's bar is drawn
    through as a band.  Below them the events after the stop.
    """
    pyplot = load_pyplot()
    count = max(len(part.pairs) for part in parts)
    widest = max(len(part.rows) for part in parts)
    figure, axes = pyplot.subplots(
        count + 1, len(parts), squeeze=False, layout="constrained", sharex="col",
        figsize=(1.6 + len(parts) * (1.0 + 0.42 * widest), 2.3 * (count + 1)),
    )  # fmt: skip
    for part, column in zip(parts, axes.T, strict=True):
        rows = [part.truth, *part.rows]
        for (name, bands), axis in zip(part.pairs, column, strict=False):
            _panel(axis, part, rows, bands)
            axis.set_title(f"{part.title}: {name}", fontsize=9)
        _after(column[-1], part, rows)
        column[-1].set_xticks(range(len(rows)), [row.name for row in rows], rotation=60, ha="right")
    for axis in axes[:-1, 0]:
        axis.set_ylabel("since the passage [ms]", fontsize=8)
    axes[-1, 0].set_ylabel("events after the stop", fontsize=8)
    axes[0, 0].legend(fontsize=7, loc="upper left", bbox_to_anchor=(0.1, 1.0))  # right of the bars
    for axis in axes.ravel():
        axis.tick_params(labelsize=8)
    save_figure(figure, path)


COLOURS = {1: "tab:red", 0: "tab:blue"}


def _panel(axis: Any, part: Part, rows: Sequence[Row], bands: Sequence[int]) -> None:
    for band in bands:
        polarity = part.bands[band].polarity
        for place, row in enumerate(rows):
            values = row.latencies(band) * 1e-3
            if not len(values):
                continue
            x = place + (-0.16 if polarity else 0.16)
            p10, p25, p50, p75, p90 = np.percentile(values, (10, 25, 50, 75, 90))
            if row is part.truth:
                axis.axhspan(p25, p75, color=COLOURS[polarity], alpha=0.10, lw=0)
                axis.axhline(p50, color=COLOURS[polarity], lw=0.6, ls=":")
            label = ("ON" if polarity else "OFF") if row is part.truth else None
            axis.plot([x, x], [p10, p90], color=COLOURS[polarity], lw=1.0)
            axis.plot([x, x], [p25, p75], color=COLOURS[polarity], lw=4.0, label=label)
            axis.plot(x, p50, "o", color="black", ms=3.0)
    axis.axhline(0.0, color="grey", lw=0.6)


def _after(axis: Any, part: Part, rows: Sequence[Row]) -> None:
    shades = load_pyplot().get_cmap("viridis")(np.linspace(0.0, 0.85, len(part.pairs)))
    for k, (name, bands) in enumerate(part.pairs):
        for place, row in enumerate(rows):
            counts = [np.mean([seed[band].count for band in bands]) for seed in row.stopped]
            x = place + 0.18 * (k - (len(part.pairs) - 1) / 2)
            axis.bar(x, np.mean(counts), 0.17, color=shades[k], label=name if not place else None)
            axis.plot([x] * len(counts), counts, ".", color="black", ms=2.5)
    axis.set_title(f"{part.title}: events of a line after the stop", fontsize=9)
    axis.set_ylim(top=1.25 * axis.get_ylim()[1])  # room for the legend
    axis.legend(fontsize=7, ncols=len(part.pairs), loc="upper center")
    axis.axhline(0.0, color="grey", lw=0.6)

#!/usr/bin/env python
"""What leak and shot noise as v2e declares them miss of measured noise.

FOLDER holds the noise files of IEBCS (see ``real/iebcs.py``); CRADLE_FOLDER a recording
with frames in the DAVIS240C layout, whose still pixels are used.  Prints Markdown tables::

    python scripts/real/noise.py noise-iebcs davis346-emlb-cradle
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import numpy as np
from writing import one_line_errors, table

from adv2e import simulate
from adv2e.config import Config, load_config
from adv2e.diagnosis.tables.characterise import characterise, problem_of
from adv2e.diagnosis.tables.noise_problem import NoiseProblem
from adv2e.diagnosis.tables.problem import Settings, read_declared
from adv2e.diagnosis.tables.table import Table, parse_table
from adv2e.reports.result import Diagnosis
from real.cradle import still_pixels, still_rates, top_share
from real.iebcs import Level, read_levels
from real.noise_shares import compared_intervals, iebcs_shares, three_ways, two_halves, values_of

DECLARED = "v2e"
OPEN = 0.25
"""Relative error of a rate for what intervals leave open: the length, pixels without one."""
SIDE = 50
CHECK_S = 4.0
"""Rates are told of so long, after as long again, in which references forget how they began."""
CHECKED = (
    ("leak 2 + 6 l", ("pixel.leak={rate_hz: 2, photo_rate_hz: 6, jitter: 0}",)),
    ("leak 3, shot noise 4", ("pixel.leak={rate_hz: 3, jitter: 0}", "pixel.shot_noise.rate_hz=4")),
    ("photoreceptor noise 0.06", ("pixel.photoreceptor_noise.rms=0.06",)),
    (
        "the same behind 200 Hz, leak 1",
        (
            "pixel.leak={rate_hz: 1, jitter: 0}",
            "pixel.photoreceptor_noise.rms=0.06",
            "pixel.source_follower.cutoff_hz=200",
            "pixel.thresholds.off=0.25",
        ),
    ),
)


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.argument("cradle_folder", required=False, type=click.Path(path_type=Path))
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
@click.option(
    "--picture",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.png",
    help="Draw the distributions of intervals here; needs Matplotlib.",
)
@one_line_errors()
def main(folder: Path, cradle_folder: Path | None, seed: int, picture: Path | None) -> None:
    """Fit noise at two light levels, judge at the third."""
    levels = read_levels(folder)
    errors, found = three_ways(iebcs_shares(levels), max(level.lux for level in levels))
    print(errors, end="\n\n")
    for lux, parts in found.items():
        for part in parts:
            print(f"{f'without {lux} lux' if lux else 'all'}, {part.model}: {values_of(part)}")
    print(f"\n{compared_intervals(levels, found, seed, picture)}", end="\n\n")
    if cradle_folder is not None:
        judged, rates, last = two_halves(still_pixels(cradle_folder))
        print(f"{judged}\n\n{rates}\n\n{last.model}: {values_of(last)}", end="\n\n")
    print(measured_rates(levels), end="\n\n")
    print(per_pixel(levels), end="\n\n")
    measured = iebcs_table(levels)
    for text in rotations(measured, seed):
        print(text, end="\n\n")
    print(closed_forms(measured), end="\n\n")
    if cradle_folder is not None:
        for text in cradle(cradle_folder, seed):
            print(text, end="\n\n")


def iebcs_table(levels: list[Level]) -> Table:
    """Return mean and median rates of the levels, with documented column names."""
    lines = [
        "illuminance_lux,on_rate_hz,off_rate_hz,on_median_hz,off_median_hz,pixels,duration_s,"
        "least_hz"
    ]
    for level in levels:
        # one pixel with two events, so with an interval
        least = float(np.sqrt(2.0 / level.pixels)) / level.duration_s
        rates = [level.mean_hz("on"), level.mean_hz("off")]
        rates += [level.median_hz("on"), level.median_hz("off")]
        cells = [level.lux, *rates, level.pixels, level.duration_s, least]
        lines.append(",".join(f"{cell:.6g}" for cell in cells))
    return parse_table("\n".join(lines), "IEBCS noise files")


def measured_rates(levels: list[Level]) -> str:
    """Return the rates with what pixels without an interval leave open."""
    rows = []
    for level in levels:
        cells: list[str] = [f"{level.lux:g}", f"{level.duration_s:.1f}"]
        for polarity in ("on", "off"):
            low, high = level.bounds_hz(polarity)
            mean, typical = level.mean_hz(polarity), level.median_hz(polarity)
            cells += [f"{mean:.2g} ({low:.2g} to {high:.2g})", f"{typical:.2g}"]
        off = level.mean_hz("off") * level.lux
        cells.append(f"{off:.2g}" if off > 1e-6 else f"below {0.0025 * level.lux:.2g}")
        rows.append(cells)
    head = ["light [lux]", "length [s]", "ON mean", "ON median", "OFF mean", "OFF median"]
    head.append("OFF x light")
    return table(head, rows)


def per_pixel(levels: list[Level]) -> str:
    """Return how ON intervals are spread over the pixels: measured, and simulated.

    Simulated with v2e's parameters, and with leak, shot noise and one hot pixel in a hundred that
    meet this level's own mean and median.
    """
    rows = []
    white = max(level.lux for level in levels)
    for level in levels:
        streams = {"measured": level.intervals["on"]}
        for name, sets in (("v2e", []), ("rates of this level", fitted_here(level, white))):
            config = load_config([DECLARED], ["sampling.L=1", *sets])
            events = still(config, 255.0 * level.lux / white, level.duration_s)
            part = events[events["p"] == 1]
            at = part["y"].astype(np.int64) * SIDE + part["x"]
            counts = np.bincount(at, minlength=SIDE**2)
            streams[name] = np.maximum(counts - 1, 0)
        for name, intervals in streams.items():
            quantiles = np.quantile(intervals, (0.5, 0.9, 0.99, 1.0))
            rows.append(
                [
                    f"{level.lux:g}",
                    name,
                    f"{(intervals > 0).mean():.3f}",
                    *(f"{q:.0f}" for q in quantiles),
                    f"{top_share(intervals):.2f}",
                ]
            )
    head = ["light [lux]", "", "pixels with any", "median", "90 %", "99 %", "most", "busiest 1 %"]
    return table(head, rows)


def fitted_here(level: Level, white: float) -> list[str]:
    """Return the keys that give a level its own rates."""
    off, on = level.median_hz("off"), level.median_hz("on")
    shot = 2.0 * off / (1.0 - 0.75 * level.lux / white)
    hot = max(level.mean_hz("on") - on, 0.0) / 0.01
    leak = max(on - off, 0.0) if on > 2.0 * off else 0.0  # beside more noise leak hardly shows
    return [
        f"pixel.leak.rate_hz={leak:.6f}",
        f"pixel.shot_noise.rate_hz={shot:.6f}",
        "pixel.hot_pixels.fraction=0.01",
        f"pixel.hot_pixels.rate_hz={hot:.6f}",
    ]


def rotations(measured: Table, seed: int) -> Iterator[str]:
    """Yield the verdict, and what every single effect does at each level held out."""
    found = characterise(measured, read_declared([DECLARED]), Settings(error=OPEN, seed=seed))
    yield f"IEBCS: {found.sentence}"
    yield tried(found)
    rows = []
    for lux in measured.texts("illuminance_lux"):
        settings = Settings(error=OPEN, seed=seed, judge=[f"illuminance_lux={lux}"])
        part = characterise(measured, read_declared([DECLARED]), settings)
        best = min((r for r in part.rejected if r.held_out), key=lambda r: r.held_out or 0.0)
        before = part.errors[0].before.value
        after = before * (best.held_out or 1.0)
        values = ", ".join(f"{k.split('.', 1)[1]} {v:.3g}" for k, v in best.parameters.items())
        rows.append([lux, part.verdict, f"{before:.2f}", best.name, values, f"{after:.2f}"])
    head = ["judged at [lux]", "verdict", "error of v2e", "least error with", "values", "error"]
    yield table(head, rows)


def tried(found: Diagnosis) -> str:
    """Return the held-out error with each set of effects that was tried."""
    before = found.errors[0].before.value
    rows = [["as declared", f"{before:.2f}"]]
    rows += [[r.name, f"{before * r.held_out:.2f}"] for r in found.rejected if r.held_out]
    after = " + ".join(effect.name for effect in found.effects)
    if after:
        rows.append([f"**{after}**", f"{found.errors[0].after.value:.2f}"])
    return table(["with", "held-out error, ln"], rows)


def closed_forms(measured: Table) -> str:
    """Return predicted rates beside those of simulated constant light."""
    rows = []
    for name, sets in CHECKED:
        config = load_config(
            [],
            [
                "pixel.leak=null",
                "pixel.shot_noise=null",
                "pixel.thresholds.mismatch=0",
                "pixel.initial_reference=settled",
                "sampling.L=1",
                *sets,
            ],
        )
        problem = problem_of(measured, read_declared([], sets), Settings())
        assert isinstance(problem, NoiseProblem)
        for share in (0.1, 1.0):
            rates = problem.rates({}, np.array([share * 3000.0]))
            events = still(config, 255.0 * share, 2.0 * CHECK_S)
            events = events[events["t"] >= 1e6 * CHECK_S]
            on = np.count_nonzero(events["p"] == 1) / SIDE**2 / CHECK_S
            off = np.count_nonzero(events["p"] == 0) / SIDE**2 / CHECK_S
            formula = f"{rates.on_mean[0]:.3g} / {rates.off[0]:.3g}"
            rows.append([name, f"{share:g}", formula, f"{on:.3g} / {off:.3g}"])
    return table(["effects [Hz]", "light", "formula ON / OFF", "simulated ON / OFF"], rows)


def still(config: Config, dn: float, duration_s: float) -> np.ndarray:
    """Return the events of 50x50 pixels at constant light."""
    frame = np.full((SIDE, SIDE), dn / 255.0)
    return np.concatenate(list(simulate([frame] * 2, [0.0, duration_s], config)))


def cradle(folder: Path, seed: int) -> Iterator[str]:
    """Yield the rates of still pixels, and the verdict."""
    rates = still_rates(folder)
    rows = []
    for row in rates:
        cells = [f"{row['light_dn']:.1f}", f"{row['pixels']:.0f}"]
        for polarity in ("on", "off"):
            cells += [f"{row[f'{polarity}_rate_hz']:.3f}", f"{row[f'{polarity}_top']:.2f}"]
        rows.append([*cells, f"{row['off_rate_hz'] * row['light_dn']:.2f}"])
    head = ["grey [DN]", "pixels", "ON [Hz]", "busiest 1 %", "OFF [Hz]", "busiest 1 %"]
    head.append("OFF x grey")
    yield table(head, rows)
    columns = [name for name in rates[0] if not name.endswith("_top")]
    lines = [",".join(columns)]
    lines += [",".join(f"{row[name]:.6g}" for name in columns) for row in rates]
    measured = parse_table("\n".join(lines), folder.name)
    found = characterise(measured, read_declared([DECLARED]), Settings(white=255.0, seed=seed))
    yield f"{folder.name}: {found.sentence}"
    yield tried(found)


if __name__ == "__main__":
    main()

#!/usr/bin/env python
"""What measured latencies of two cameras say of the pixel's circuit.

FOLDER holds ``latency_summary.csv``: medians read from the figures that NIST published
(github.com/usnistgov/pixel_latency_eventcameras; R. Chassagnol et al., "Pixel Latency Measurements
of Event Cameras", IEEE TIM 74, 2025, doi:10.1109/TIM.2025.3623767).  Prints Markdown tables::

    python scripts/real/latency.py latency-nist
"""

from __future__ import annotations

import csv
import sys
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import numpy as np
from writing import one_line_errors, table

from adv2e import simulate
from adv2e.config import Config, from_dict
from adv2e.diagnosis.tables.characterise import characterise
from adv2e.diagnosis.tables.problem import Settings, read_declared
from adv2e.diagnosis.tables.table import Table, parse_table
from adv2e.errors import DataError
from adv2e.reports.result import Diagnosis

COARSEST = 0.05
"""Medians whose reading error is above this share of them are left out."""
CONTRASTS = (0.5, 1.0, 2.0, 3.0)
DEFAULT = ["lens=none", "bias=0"]


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
@one_line_errors()
def main(folder: Path, seed: int) -> None:
    """Fit the latencies of one camera, judge on the other."""
    measured = read(folder / "latency_summary.csv")
    print(departures(measured), end="\n\n")
    print(verdicts(measured, seed), end="\n\n")
    print(simulated(measured, seed), end="\n\n")


def read(path: Path) -> Table:
    """Return the medians that could be read well enough, with documented column names."""
    columns = "irradiance_W_m2,latency_us,latency_error_us,polarity,bias,camera,lens"
    lines = [columns]
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from None
    for row in rows:
        if not row["median_us"]:
            continue
        error = 0.5 * float(row["us_per_px"])
        if error > COARSEST * float(row["median_us"]):
            continue
        kept = ("polarity", "bias_config", "camera", "lens")
        cells = [row["irradiance_W_m2"], row["median_us"], f"{error:g}", *(row[k] for k in kept)]
        lines.append(",".join(cells))
    return parse_table("\n".join(lines), path.name)


def departures(measured: Table) -> str:
    """Return where the latency departs from 1/E: its ratio to that, from the lowest light."""
    chosen = subset(measured, DEFAULT)
    light, latency = chosen.numbers("irradiance_W_m2"), chosen.numbers("latency_us")
    levels = np.unique(light)
    rows = []
    for camera in ("CAM1", "CAM2"):
        for polarity, name in (("1", "ON"), ("0", "OFF")):
            keep = np.array(chosen.matching(f"camera={camera}", "--where"))
            keep &= chosen.matching(f"polarity={polarity}", "--where")
            at = dict(zip(light[keep], latency[keep], strict=True))
            start = levels[0] * at[levels[0]]
            cells = [f"{at[e]:.0f} ({e * at[e] / start:.1f})" if e in at else "" for e in levels]
            rows.append([camera, name, *cells])
    head = ["camera", "polarity", *(f"{e:g} W/m²" for e in levels)]
    return table(head, rows)


def verdicts(measured: Table, seed: int) -> str:
    """Return the verdicts: each camera fitted, judged by light levels or by the other camera."""
    rows = []
    for fitted, other in (("CAM2", "CAM1"), ("CAM1", "CAM2")):
        for judged in ("light levels", other):
            for contrast in CONTRASTS if judged != other else (1.0,):
                found = one(measured, fitted, judged, contrast, seed)
                rows.append([fitted, judged, f"{contrast:g}", *cells_of(found)])
    head = ["fitted", "judged on", "step [ln]", "verdict", "effect", "value (95 %)", "as well"]
    head += ["error before", "after"]
    return table(head, rows)


def one(measured: Table, fitted: str, judged: str, contrast: float, seed: int) -> Diagnosis:
    """Return what one camera's table says."""
    where, judge = list(DEFAULT), []
    if judged.startswith("CAM"):
        judge = [f"camera={judged}"]
    else:
        where.append(f"camera={fitted}")
    settings = Settings(where=where, judge=judge, contrast=contrast, seed=seed)
    return characterise(measured, read_declared(), settings)


def cells_of(found: Diagnosis) -> list[str]:
    """Return verdict, effects, values, alternatives and errors."""
    values = []
    for effect in found.effects:
        for key, value in effect.parameters.items():
            low, high = effect.interval[key]
            values.append(f"{key.split('.')[-1]} {value:.4g} ({low:.4g} to {high:.4g})")
    error = found.errors[0]
    return [
        found.verdict,
        " + ".join(effect.name for effect in found.effects),
        ", ".join(values),
        ", ".join(found.alternatives),
        f"{error.before.value:.3f}",
        f"{error.after.value:.3f}",
    ]


def simulated(measured: Table, seed: int) -> str:
    """Return measured latencies beside those of the simulated circuit, before and after."""
    found = one(measured, "CAM2", "CAM1", 1.0, seed)
    chosen = subset(measured, [*DEFAULT, "polarity=1"])
    light = np.unique(chosen.numbers("irradiance_W_m2"))
    curve = next(c for c in found.curves if c.title.endswith("ON, bias 0"))
    first = {e: k for k, e in reversed(list(enumerate(curve.x)))}
    latency = simulate_steps(from_dict(found.model, "model"), light, 1.0)
    rows = []
    for k, e in enumerate(light):
        at = {}
        for camera in ("CAM1", "CAM2"):
            part = subset(chosen, [f"camera={camera}"])
            values = dict(
                zip(part.numbers("irradiance_W_m2"), part.numbers("latency_us"), strict=True)
            )
            at[camera] = f"{values[e]:.1f}" if e in values else ""
        before, formula = (m.middle[first[e]] for m in (curve.before, curve.after))
        rows.append(
            [
                f"{e:g}",
                at["CAM2"],
                at["CAM1"],
                f"{before:.1f}",
                f"{formula:.1f}",
                f"{latency[k]:.0f}",
            ]
        )
    head = ["light [W/m²]", "CAM2", "CAM1", "1/E", "found, formula", "found, simulated"]
    return table(head, rows)


def simulate_steps(config: Config, light: np.ndarray, contrast: float) -> np.ndarray:
    """Return the latency of the first ON event [us] in the kernel, a pixel a light level."""
    pixel = config.pixel
    pixel = replace(
        pixel,
        log_response=replace(pixel.log_response, linear_below=0.0, floor=1e-9),
        thresholds=replace(pixel.thresholds, mismatch=0.0),
        leak=None,
        shot_noise=None,
    )
    config = replace(config, pixel=pixel, sampling=replace(config.sampling, L=1))
    bright = (255.0 * light / light.max())[None, :]
    frames = [bright * np.exp(-contrast)] * 2 + [bright] * 2
    start, length = 0.01, 1e-6
    frames = [frame.astype(np.float64) / 255.0 for frame in frames]
    times = [0.0, start, start + length, start + 0.1]
    events = np.concatenate(list(simulate(frames, times, config)))
    return np.array([events["t"][events["x"] == k].min() - 1e6 * start for k in range(light.size)])


def subset(measured: Table, conditions: list[str]) -> Table:
    """Return the rows that meet all conditions."""
    for condition in conditions:
        measured = measured.kept(measured.matching(condition, "--where"))
    return measured


if __name__ == "__main__":
    main()

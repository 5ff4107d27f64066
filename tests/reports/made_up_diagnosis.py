"""Diagnoses made up for the tests of the reports: no recording stands behind them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adv2e.reports.result import (
    Band,
    Curve,
    Detectable,
    Diagnosis,
    ErrorRow,
    Estimate,
    Finding,
    Masked,
    Rejected,
    ResidualMap,
    Signature,
    Snapshot,
    Total,
)

MODEL = {
    "seed": 3,
    "frames": {"encoding": "linear"},
    "pixel": {
        "thresholds": {"on": 0.21, "off": 0.2, "mismatch": 0.03},
        "low_pass": {"cutoff_hz": 187.123456, "dark_cutoff_hz": 21.8},
        "source_follower": None,
        "refractory": {"period_us": 6012.34},
        "leak": {"rate_hz": np.float64(0.1), "photo_rate_hz": 0.0},
    },
}


def _band(middle, spread):
    return Band(middle, middle - spread, middle + spread)


def _intervals_curve():
    edges = np.geomspace(100.0, 1e6, 41)
    centre = np.sqrt(edges[1:] * edges[:-1])
    before = 4000 * np.exp(-(np.log(centre / 5000) ** 2) / 3)
    after = before * (centre > 6000) * 1.2
    measured = np.random.default_rng(1).poisson(after).astype(float)
    return Curve(
        "Time between events",
        "time from an event to the next of the same pixel [us]",
        "events a bin",
        edges,
        measured,
        _band(before, 2 * np.sqrt(before) + 1),
        _band(after, 2 * np.sqrt(after) + 1),
        x_log=True,
        y_log=True,
    )


def _lag_curve():
    light = np.array([2.0, 5, 12, 30, 70, 150, 240])
    before, after = 0.2 + 30 / light, 1.9 + 28 / light
    measured = after * np.array([1.02, 0.97, 1.0, 1.03, 0.99, np.nan, 1.01])
    return Curve(
        "Lag behind the scene",
        "light [DN]",
        "median lag [ms]",
        light,
        measured,
        _band(before, 0.1 * before),
        _band(after, 0.1 * after),
        x_log=True,
    )


def _phase_curve():
    edges = np.linspace(0, 1, 26)
    level = np.full(25, 1.0)
    measured = 1 + 0.05 * np.sin(np.arange(25))
    return Curve(
        "Rate over the time between two frames",
        "place between two frames, as a share of the frame interval",
        "rate relative to its mean",
        edges,
        measured,
        _band(level + 0.15 * np.cos(np.arange(25) / 4), 0.04),
        _band(level, 0.03),
    )


def _spectrum_curve():
    f = np.linspace(1, 1000, 5000)
    base = 1e5 / (1 + (f / 80) ** 2)
    noise = np.random.default_rng(0).exponential(size=f.size)
    return Curve(
        "Spectrum of the event rate",
        "frequency [Hz]",
        "power [events² / Hz]",
        f,
        base * noise,
        Band(base * 0.7, base * 0.02, base * 3.7),
        Band(base * 0.72, base * 0.03, base * 3.9),
        x_log=True,
        y_log=True,
    )


def _map(rows=65, columns=87):
    draws = np.random.default_rng(2).normal(size=(2, rows, columns))
    before, after = draws[0], draws[1] * 1.05
    y, x = np.mgrid[:rows, :columns]
    before = before + 4.5 * np.exp(-((x - columns / 3) ** 2 + (y - rows / 2) ** 2) / 150) - 0.5
    before[:2], after[:2] = np.nan, np.nan
    before[20:26, 60:66] = after[20:26, 60:66] = np.nan
    return ResidualMap("Events a pixel, measured minus simulated", before, after)


def _signatures():
    rows = [
        ("shortest 1 % of times", "time between events", 6104.0, 870.0, 6090.0, 41.2, 0.1),
        ("share below 1 ms", "time between events", 0.0, 0.113, 0.0, -38.0, float("nan")),
        ("ON share", "levels", 0.513, 0.498, 0.511, 3.4, 0.4),
        ("events", "levels", 309285.0, 524995.0, 311020.0, -22.0, -0.3),
        ("alternation", "order", 0.71, 0.42, 0.66, 9.0, 3.2),
    ]
    rows += [
        (f"lag in light class {n}", "lag", 0.3 + n, 0.2 + n, 0.3 + n, 0.2 * n, 0.1 * n)
        for n in range(20)
    ]
    meaning = "Where two events of a pixel follow each other at once, no dead time is at work."
    units = {"time between events": "ms", "levels": "events", "lag": "ms"}
    kinds = {"time between events": "time", "levels": "count"}
    return [
        Signature(
            name, group, meaning, *values, units.get(group, "of 1"), kinds.get(group, "other")
        )
        for name, group, *values in rows
    ]


def snapshot(width=87, height=65):
    """Return events of 10 ms, twice as many as declared."""
    draw = np.random.default_rng(3)
    shape = 2, height, width
    few, many, after = (draw.poisson(mean, shape) for mean in (0.1, 0.2, 0.1))
    return Snapshot(0.12, 0.01, few, many, after)


def everything() -> Diagnosis:
    """Return a diagnosis that has something of all."""
    return Diagnosis(
        verdict="explained",
        remark="With this change nothing is left that these data show.",
        recording="office_zigzag.zip",
        declared="declared.yaml",
        effects=[
            Finding(
                "refractory",
                {"pixel.refractory.period_us": 6012.34},
                {"pixel.refractory.period_us": (5503.0, 6498.0)},
            ),
            Finding(
                "low_pass",
                {"pixel.low_pass.cutoff_hz": 187.123456},
                {"pixel.low_pass.cutoff_hz": (172.0, 204.0)},
            ),
        ],
        alternatives=["reset_overshoot"],
        nuisances={"pixel.thresholds.on": 0.21, "frames.encoding": "linear"},
        rejected=[
            Rejected(
                "flicker",
                "no line in the spectrum beyond chance",
                {"frames.flicker.frequency_hz": 100.0, "frames.flicker.depth": 0.002},
                0.998,
            ),
            Rejected("hot_pixels", "no pixel fires by itself"),
        ],
        errors=[
            ErrorRow(
                "distance of the streams smoothed in time (mean of 2, 10, 50 and 100 ms)",
                Estimate(1.384, (1.31, 1.46)),
                Estimate(0.312, (0.29, 0.34)),
                Estimate(0.27, (0.26, 0.28)),
            ),
            ErrorRow(
                "voxel grid, shared window",
                Estimate(246.0, (231.0, 262.0)),
                Estimate(121.0, (115.0, 127.0)),
                Estimate(118.0, (112.0, 124.0)),
            ),
            ErrorRow(
                "difference of the event counts [%]", Estimate(70.0), Estimate(0.9), Estimate(1.1)
            ),
        ],
        global_p_before=0.0002,
        global_p_after=0.34,
        signatures=_signatures(),
        curves=[_intervals_curve(), _lag_curve(), _phase_curve(), _spectrum_curve()],
        maps=[_map()],
        detectable=[
            Detectable("refractory", "pixel.refractory.period_us", 740.0, "us"),
            Detectable("leak", "pixel.leak.rate_hz", 0.31, "Hz"),
            Detectable("event_loss", "readout.loss.fraction", 0.052, "-"),
            Detectable("dead_pixels", "pixel.dead_pixels.fraction", None, "-"),
        ],
        masked=[
            Masked("clipped parts of the frames (above 250 DN)", 0.034),
            Masked("hot pixels", 0.0006),
        ],
        split="Blocks of 0.5 s: 8 for fitting, 6 for judging, 2 for the numbers above.",
        notes=["Interpolation between frames changes the error by at most 0.04."],
        model=MODEL,
        facts={"sensor": "346x260", "simulations": "412", "version": "0.1.0", "seed": "3"},
        declared_values={
            "pixel.refractory.period_us": 500.0,
            "pixel.low_pass.cutoff_hz": 300.0,
            "pixel.thresholds.on": 0.2,
        },
        defaults=["pixel.low_pass.cutoff_hz"],
        totals=[
            Total("ON events", "events", 158_661.0, Estimate(261_448.0), Estimate(158_932.0)),
            Total(
                "time from an event to the next of its pixel, median",
                "ms",
                9.1,
                Estimate(4.2, (4.1, 4.3)),
                Estimate(9.0, (8.9, 9.2)),
            ),
        ],
        snapshot=snapshot(),
    )


def nothing() -> Diagnosis:
    """Return a diagnosis that has nothing that can be left out."""
    return replace(
        everything(),
        verdict="consistent",
        remark="The recording is what the declared model makes.",
        effects=[],
        alternatives=[],
        nuisances={},
        rejected=[],
        errors=[],
        global_p_before=float("nan"),
        global_p_after=float("nan"),
        signatures=[],
        curves=[],
        maps=[],
        detectable=[],
        masked=[],
        split="",
        notes=[],
        model={},
        facts={},
        declared_values={},
        totals=[],
        snapshot=None,
    )


def unfinished() -> Diagnosis:
    """Return what is known while a second effect is looked for."""
    whole = everything()
    return replace(
        whole,
        verdict="unfinished",
        still="searching: fitting leak",
        effects=whole.effects[:1],
        alternatives=[],
        errors=[],
        detectable=[],
    )


HOSTILE = 'a < b & "c" > \'d\' </script></title></svg><img src="http://x.y/z">\x00\n# é \udc80'
"""Text that would break pages, records and comments if it were not escaped."""


def _odd_curve(x, y, *, x_log=False, y_log=False):
    y = np.asarray(y, dtype=float)
    band = Band(y, y - 1.0, y + np.inf)
    x = np.asarray(x, dtype=float)
    return Curve(HOSTILE, HOSTILE, HOSTILE, x, y, band, _band(y, 0.0), x_log=x_log, y_log=y_log)


def strange() -> Diagnosis:
    """Return a diagnosis of odd values: not numbers, single points, huge and tiny ones."""
    nan, inf = float("nan"), float("inf")
    path = "pixel.a_users_own.key"
    return replace(
        everything(),
        verdict="not_identifiable",
        remark=HOSTILE,
        recording=HOSTILE,
        declared=HOSTILE,
        effects=[
            Finding(HOSTILE, {path: [0.12, np.float32(0.5)], "frames.encoding": HOSTILE}, {}),
            Finding("leak", {"pixel.leak.rate_hz": 1e-300}, {"pixel.leak.rate_hz": (0.0, inf)}),
        ],
        alternatives=[HOSTILE, "photo_leak"],
        nuisances={path: nan, HOSTILE: None},
        rejected=[Rejected(HOSTILE, HOSTILE, {HOSTILE: True}, nan)],
        errors=[
            ErrorRow(HOSTILE, Estimate(0.0, (0.0, 0.0)), Estimate(inf), Estimate(nan, (nan, nan))),
            ErrorRow("huge", Estimate(1e300, (0.0, 1.1e300)), Estimate(-1e-300), Estimate(nan)),
        ],
        global_p_before=0.0,
        global_p_after=1.0,
        signatures=[
            Signature(HOSTILE, HOSTILE, HOSTILE, nan, inf, -inf, nan, inf, HOSTILE),
            Signature("s", "g", "m", 1e300, 1e-300, 0.0, -inf, 1e12, "u"),
        ],
        curves=[
            _odd_curve([1.0], [2.0]),
            _odd_curve([0.0], [0.0], x_log=True, y_log=True),
            _odd_curve([0.0, 1.0], [5.0], y_log=True),
            _odd_curve([], []),
            _odd_curve([1, 2, 3], [nan, nan, nan]),
            _odd_curve([1, 2, 3, 4], [1e300, 1e-300, nan, -1e300]),
            _odd_curve([1e-200, 1, 1e200], [1e-200, 1e200, inf], x_log=True, y_log=True),
            _odd_curve([0, 1, 10, 100], [0, 3, 4], x_log=True, y_log=True),
            _odd_curve([1e6, 1e6 + 1e-3], [7, 7 + 1e-12]),
        ],
        maps=[
            ResidualMap(HOSTILE, np.full((3, 4), nan), np.array([[inf, -inf, 0.0, nan]] * 3)),
            ResidualMap("one pixel", np.zeros((1, 1)), np.ones((1, 1))),
        ],
        detectable=[Detectable(HOSTILE, HOSTILE, nan, HOSTILE)],
        masked=[Masked(HOSTILE, nan)],
        split=HOSTILE,
        notes=[HOSTILE],
        declared_values={path: [np.float32(0.1), nan], "pixel.leak.rate_hz": None},
        totals=[Total(HOSTILE, HOSTILE, nan, Estimate(inf, (nan, inf)), Estimate(-1e300))],
        snapshot=Snapshot(nan, 1e-300, *np.zeros((3, 2, 1, 1), np.int64)),
        model={"pixel": {"thresholds": {"on": np.float32(0.25)}, "leak": None}},
        facts={HOSTILE: HOSTILE},
    )

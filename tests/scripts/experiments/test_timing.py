"""Latencies, what comes after a stop, and distances are those that are known in closed form."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from experiments import sweeps, timing, truth
from experiments.edge_tables import row_of
from experiments.edges import WINDOW_US, Edges, Passages, after_stop, apart, latencies
from experiments.simulators import named
from scipy.stats import wasserstein_distance
from writing import load_pyplot

from adv2e import load_config, simulate
from adv2e.errors import DataError, MissingExtraError
from adv2e.events import make_events, sort_events
from adv2e.sources import open_source

STEP_LN, LEVEL, CORNER_HZ = 1.1, 0.2, 40.0
CROSSINGS_US = -1e6 * np.log(1 - np.arange(1, 6) * LEVEL / STEP_LN) / (2 * np.pi * CORNER_HZ)
"""When a first-order response to a step of STEP_LN has gone k LEVEL."""


def passages_of(time_us, polarity=(1,), **options):
    time_us = np.array(time_us, float)
    given = {"lead_us": 1000.0, "stop_us": 50_000.0, "end_us": 200_000.0, **options}
    everywhere = np.ones(time_us.shape, bool)
    return Passages(
        time_us, everywhere, np.zeros(time_us.shape, np.int64), polarity=polarity, **given
    )


def test_latencies_of_a_step_are_the_closed_form():
    """The pixel of adv2e, one corner at all light; each pixel has its step at another time."""
    steps_us = [20_000, 23_456, 31_007]
    times = sorted({0, 120_000, *(t + s for t in steps_us for s in (0, 1))})
    light = [[[10.0 if t <= s else 10.0 * np.exp(STEP_LN) for s in steps_us]] for t in times]
    corner = [f"pixel.low_pass.{name}={CORNER_HZ}" for name in ("cutoff_hz", "dark_cutoff_hz")]
    sets = ["sampling.L=1", "pixel.log_response.linear_below=0", "frames.full_scale=255", *corner]
    config = load_config(["ideal"], sets)
    frames = np.array(light, np.float32)
    events = np.concatenate(list(simulate(frames, [1e-6 * t for t in times], config)))
    found = latencies(events, passages_of([steps_us]), 0)
    assert found.pixels == 3
    for number, expected in enumerate(CROSSINGS_US, 1):
        assert found.numbered(number) == pytest.approx([expected] * 3, abs=2.0)
    assert found.mean_count == len(CROSSINGS_US)


def test_events_of_others_are_not_counted():
    passed = [[20_000.0, np.nan], [30_000.0, 30_000.0]]
    passages = passages_of(passed, polarity=(1, 0))
    passages.band[1, 1] = 1
    rows = [
        (18_000, 0, 0, 1),  # before it can be felt
        (19_500, 0, 0, 1),
        (25_000, 0, 0, 0),  # of the other sign
        (26_000, 0, 0, 1),
        (26_000, 1, 0, 1),  # where no passage is known
        (31_000, 0, 1, 1),
        (31_000, 1, 1, 1),
        (32_000, 1, 1, 0),
        (20_001 + WINDOW_US, 0, 0, 1),  # too late
    ]
    events = sort_events(make_events(*np.array(rows, np.int64).T))
    on, off = (latencies(events, passages, band) for band in (0, 1))
    assert on.of.tolist() == [-500, 6000, 1000]
    assert on.number.tolist() == [1, 2, 1]
    assert (on.pixels, off.pixels, off.of.tolist()) == (2, 1, [2000])


def test_the_decay_after_a_stop_is_found_beneath_other_events():
    rng = np.random.default_rng(3)
    passages = passages_of(np.full((40, 25), 10_000.0))
    decay = passages.stop_us + rng.exponential(5000.0, 400)
    before = rng.uniform(10_000.0, passages.stop_us, 1200)
    others = rng.uniform(0.0, passages.end_us, 4000)
    t = np.concatenate([decay, before, others]).astype(np.int64)
    x, y = rng.integers(0, 25, len(t)), rng.integers(0, 40, len(t))
    found = after_stop(sort_events(make_events(t, x, y, np.ones(len(t)))), passages, 0)
    assert found.count == pytest.approx(400 / 40, rel=0.15)
    assert found.decay_us == pytest.approx(5000, rel=0.25)
    assert found.share == pytest.approx(0.25, rel=0.15)
    alone = sort_events(make_events(others.astype(np.int64), x[-4000:], y[-4000:], np.ones(4000)))
    assert np.isnan(after_stop(alone, passages, 0).decay_us)


def test_the_distance_is_wasserstein_1():
    rng = np.random.default_rng(4)
    a, b = rng.exponential(3000.0, 300), rng.exponential(4000.0, 217)
    assert apart(a, b) == pytest.approx(wasserstein_distance(a, b))
    assert apart(a, a + 250.0) == pytest.approx(250.0)
    assert np.isnan(apart(a, a[:0]))


SMALL = Edges(pairs=((6.0, 18.0),), lines=2, stop_s=0.04, end_s=0.12, columns=20)


def test_light_is_half_way_at_the_passage_and_rests_after_the_stop():
    rows, columns = SMALL.pixels()
    time_us = SMALL.passages().time_us.ravel()
    known = np.isfinite(time_us)
    light = SMALL.light(rows, columns, 1e-6 * np.where(known, time_us, 0.0))
    assert light[known] == pytest.approx(12.0)
    end = SMALL.light(rows, columns, np.array([[SMALL.stop_s], [SMALL.end_s]]))
    assert np.array_equal(*end)
    on = SMALL.band_of(rows) == 0
    assert end[0][known & on].min() > 17.9
    assert end[0][known & ~on].max() < 6.1
    assert known.reshape(SMALL.size[::-1])[:, 10].all()
    clip = SMALL.clip(240.0)
    assert clip.frames[3].ravel() == pytest.approx(
        SMALL.light(rows, columns, 1e-9 * clip.times_ns[3])
    )


@pytest.mark.thorough
def test_the_dense_truth_is_the_filter_integrated_step_by_step(monkeypatch):
    """A column that the edge passes, and one at which it stops, by Euler steps of 1 us."""
    monkeypatch.setattr(truth, "MISMATCH", 0.0)
    events = truth.Dense(SMALL).events(0)
    passages = SMALL.passages()
    for row, column in ((0, 4), (2, 4), (1, int(SMALL.place(np.array(1), np.array(1.0))))):
        times = np.arange(0.0, SMALL.end_s, 1e-6)
        light = SMALL.light(np.array(row), np.array(column), times)
        rate = 2 * np.pi * (21.8 + (300.0 - 21.8) * light / 255.0)
        y = reference = float(np.log(light[0]))
        free, expected = None, []
        for t, x, w in zip(times, np.log(light), rate, strict=True):
            y += 1e-6 * w * (x - y)
            if free is not None and t >= free:
                reference, free = y, None
            if free is None and abs(y - reference) >= truth.LEVEL:
                expected.append(1e6 * t)
                free = t + 500e-6
        ours = events[(events["y"] == row) & (events["x"] == column)]
        assert len(ours) == len(expected) >= 2
        tolerance = 10.0 if np.isfinite(passages.time_us[row, column]) else 60.0
        assert ours["t"] == pytest.approx(expected, abs=tolerance)


def test_the_camera_sees_the_edges_and_its_pixel_can_be_told():
    camera = truth.Camera(SMALL, 240.0)
    assert camera.clip().frames == pytest.approx(SMALL.clip(240.0).frames, abs=0.01)
    pixel = load_config(["adv2e"], camera.told()).pixel
    assert pixel.low_pass.cutoff_hz == 120.0
    assert pixel.source_follower.cutoff_hz == 60.0
    assert pixel.dark_current.dn == 3.0


@pytest.mark.thorough
def test_a_filter_is_nearer_to_the_dim_truth_than_none():
    tell = []
    simulators = named(["ideal", "adv2e"], sets=["pixel.log_response.linear_below=0"])
    truths = [truth.Dense(SMALL).events(seed) for seed in range(2)]
    part = timing.part_of("t", "", SMALL, SMALL.clip(960.0), truths, simulators, tell.append)
    ideal, adv2e = (np.mean(part.distances(row, [0, 1], None)) for row in part.rows)
    assert adv2e < 0.2 * ideal
    of_ideal, of_adv2e, of_truth = (
        np.mean([one.count for seed in row.stopped for one in seed])
        for row in (*part.rows, part.truth)
    )
    assert of_ideal < 0.3 * of_truth
    assert of_adv2e == pytest.approx(of_truth, rel=0.25)
    assert "| truth |" in part.tables()
    json.dumps(part.numbers(), allow_nan=False)
    assert len(tell) == 2


def test_the_floor_is_between_different_seeds_of_the_truth():
    passages = passages_of([[20_000.0, 20_000.0]])
    streams = [make_events([20_000 + lag, 20_100 + lag], [0, 1], [0, 0], [1, 1]) for lag in (0, 70)]
    row = row_of("truth", "", streams, passages)
    part = timing.Part("t", "", SMALL.bands[:1], row, [])
    assert part.distances(row, [0], 1) == pytest.approx([70.0])


WALL, BEHIND = 45.0, 4.0


def blurred(polarity, level):
    """Return three frames, exposures of 20 ms, of a dark thing that goes over or off a wall."""
    edges = Edges(pairs=((BEHIND, WALL),), lines=4, columns=60, speed=1300.0, stop_s=1.0)
    rows, columns = edges.pixels()
    exposures = np.array([[-0.06, -0.04], [0.012, 0.032], [0.06, 0.08]])
    frames = []
    for start, end in exposures:
        times = np.linspace(start, end, 801)[:, None]
        light = edges.light(rows, columns, times).mean(axis=0).reshape(edges.size[::-1])
        frames.append(light[:4] if polarity else light[4:])
    # the wall is the median: what most frames show
    other = np.full_like(frames[1], WALL)
    stack = np.array([other, frames[1], other])
    return (
        stack + level * np.random.default_rng(2).standard_normal(stack.shape),
        1e6 * exposures,
        edges,
    )


@pytest.mark.parametrize("polarity", [1, 0])
def test_a_blurred_exposure_tells_passages(polarity):
    frames, exposures, edges = blurred(polarity, 1.0)
    sweep = sweeps.Sweep(1, (5, 45), (0, 3), polarity)
    found = sweeps.timed(frames, exposures, sweep, BEHIND)
    rows = np.arange(4) + (0 if polarity else 4)
    true = 1e6 * edges.passage(rows[:, None], np.arange(60)[None, :])
    known = np.isfinite(found.passages.time_us)
    assert known.sum() > 60
    assert np.abs(found.passages.time_us - true)[known].max() < 400
    assert sweeps.straight(found.passages.time_us)[1] == pytest.approx(1e6 / 1300.0, rel=0.1)
    assert found.wall == pytest.approx(WALL, abs=1.0)
    with pytest.raises(DataError, match="not within 3 frames of 60x4"):
        sweeps.timed(frames, exposures, sweep._replace(frame=3), BEHIND)
    with pytest.raises(DataError, match="no row has"):
        sweeps.timed(frames, exposures, sweep._replace(columns=(50, 59)), BEHIND)


def test_a_passage_ends_with_the_next_edge():
    passages = passages_of([[20_000.0, 21_000.0, 22_000.0]], lead_us=3000.0)
    rows = [(16_000, 0, 1), (19_000, 0, 1), (20_000, 0, 1), (23_000, 0, 0), (24_000, 0, 1),
            (19_500, 1, 0), (20_000, 1, 1), (25_500, 1, 1), (21_000, 2, 1)]  # fmt: skip
    t, x, p = np.array(rows).T
    events = sort_events(make_events(t, x, np.zeros(len(t)), p))
    sweep = sweeps.Sweep(0, (0, 2), (0, 0), 1)
    found, speed = sweeps.passed_by(events, sweep, passages)
    assert found.of.tolist() == [-1000, 0, -1000, 4500, -1000]
    assert sweeps.since_first(found).tolist() == [1000, 5500]
    assert sweeps.since_first(found, 1).tolist() == [5500]
    assert speed == pytest.approx(1000.0)


def test_a_sweep_is_written_as_it_is_read():
    text = "2,16:45,153:159,OFF"
    sweep = sweeps.SweepType().convert(text, None, None)
    assert sweep == (2, (16, 45), (153, 159), 0)
    assert str(sweep) == text
    done = CliRunner().invoke(timing.main, ["--sweep", "2,16:45,OFF"])
    assert done.exit_code == 2
    assert "must be FRAME,X0:X1,Y0:Y1,ON or OFF" in done.output


def test_exposures_must_be_those_of_the_frames(tmp_path):
    with pytest.raises(DataError, match="no such file"):
        sweeps.exposures_of(tmp_path, 2)
    path = tmp_path / "exposures.txt"
    path.write_text("# name start end\na.png 0.5 0.52\n\nb.png 0.54 0.56\n")
    assert sweeps.exposures_of(tmp_path, 2) == pytest.approx(
        1e6 * np.array([[0.5, 0.52], [0.54, 0.56]])
    )
    with pytest.raises(DataError, match="must be 3 lines"):
        sweeps.exposures_of(tmp_path, 3)
    path.write_text("a.png 0.5\nb.png 0.54\n")
    with pytest.raises(DataError, match=r"start and end \[s\]"):
        sweeps.exposures_of(tmp_path, 2)


def test_the_command_writes_tables_numbers_and_the_picture(tmp_path, monkeypatch):
    try:
        load_pyplot()
    except MissingExtraError as error:
        pytest.skip(str(error))
    monkeypatch.setattr(timing, "Edges", lambda **_: SMALL)
    monkeypatch.setattr(timing, "TOLD", ())
    monkeypatch.setattr(timing, "FLOW", ("sampling.L=2",))
    path = tmp_path / "t.md"
    done = CliRunner().invoke(
        timing.main, ["--quick", "--simulators", "ideal", "-o", str(path)], catch_exceptions=False
    )
    assert done.exit_code == 0, done.output
    numbers = json.loads(path.with_suffix(".json").read_text("utf-8"))
    assert list(numbers) == ["circuit, 240 frames/s", "camera, 240 frames/s"]
    assert list(numbers["camera, 240 frames/s"]) == [
        "truth",
        "ideal",
        "adv2e, told",
        "adv2e, told, flow",
    ]
    assert Path(path.with_suffix(".png")).stat().st_size > 10_000


def test_frames_for_other_tools_are_those_of_the_clip(tmp_path):
    timing.write_frames(SMALL, 240.0, tmp_path / "frames")
    clip, source = SMALL.clip(240.0), open_source(str(tmp_path / "frames"))
    for frame, t_ns, light in zip(source.frames(), clip.times_ns, clip.frames, strict=True):
        assert frame.t_ns == t_ns
        assert np.asarray(frame.image) * (255 / 65535) == pytest.approx(light, abs=0.01)

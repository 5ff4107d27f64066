"""Latency tables made by an ODE solver, or a formula of their own, with a known effect."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from adv2e.cli import main
from adv2e.config import load_config
from adv2e.diagnosis.tables.characterise import characterise, problem_of
from adv2e.diagnosis.tables.latency import CUTOFF, DARK_CURRENT, FOLLOWER, SLEW
from adv2e.diagnosis.tables.problem import Settings, read_declared
from adv2e.diagnosis.tables.selection import Selector
from adv2e.diagnosis.tables.table import measurements_of, parse_table
from adv2e.errors import DataError

LIGHT = np.array([1.0, 3.0, 10.0, 30.0, 100.0, 300.0])
CUTOFF_HZ = 3000.0  # at the highest light
STEP = 1.0
ON = 0.2


def ode_latency_us(light, follower_hz=None, slew=None, step=STEP, dark_hz=0.0, threshold=ON):
    """First crossing of the circuit's equations, integrated by scipy."""
    w1 = 2 * np.pi * (dark_hz + (CUTOFF_HZ - dark_hz) * light / LIGHT.max())
    w2 = None if follower_hz is None else 2 * np.pi * follower_hz

    def slope(t, state):
        rise = w1 * (step - state[0])
        if slew is not None:
            rise = min(rise, slew)
        return [rise, 0.0 if w2 is None else w2 * (state[0] - state[1])]

    def crossing(t, state):
        return state[0 if w2 is None else 1] - threshold

    crossing.terminal = True
    span = 20.0 * (1.0 / w1 + (1.0 / w2 if w2 else 0.0) + (step / slew if slew else 0.0))
    found = solve_ivp(
        slope, (0.0, span), [0.0, 0.0], events=crossing, rtol=1e-9, atol=1e-12, max_step=span / 200
    )
    return 1e6 * found.t_events[0][0]


def table(latency, light=LIGHT, noise=0.01, error=0.01, **columns):
    """A table with reading errors drawn once."""
    rng = np.random.default_rng(3)
    latency = np.asarray(latency) * np.exp(noise * rng.standard_normal(len(latency)))
    cells = {"irradiance_W_m2": light, "latency_us": latency, "latency_error_us": error * latency}
    cells.update(columns)
    lines = [",".join(cells)]
    lines += [",".join(str(cell) for cell in row) for row in zip(*cells.values(), strict=True)]
    return parse_table("\n".join(lines), "made.csv")


def verdict_of(measured, sets=(), **settings):
    return characterise(measured, read_declared([], sets), Settings(draws=60, **settings))


def simulated_us(step, threshold, sets=(), polarity=1, **values):
    """Latencies that the model predicts, (lights,), with white at the highest one."""
    columns = {"contrast_ln": np.broadcast_to(step, LIGHT.shape), "polarity": [polarity] * 6}
    measured = table(np.full(LIGHT.size, 1e4), **columns)
    problem = problem_of(measured, read_declared([], sets), Settings())
    keys = {"cutoff": CUTOFF, "follower": FOLLOWER, "slew": SLEW, "stray": DARK_CURRENT}
    key = f"pixel.thresholds.{'on' if polarity else 'off'}"
    fitted = {keys[name]: value for name, value in values.items() if value is not None}
    return np.exp(problem.predict({CUTOFF: CUTOFF_HZ, key: threshold, **fitted}))


@pytest.mark.parametrize(
    ("follower_hz", "slew"), [(None, None), (800.0, None), (None, 300.0), (2000.0, 900.0)]
)
@pytest.mark.parametrize("threshold", [0.05, 0.2, 0.9])
def test_simulated_latency_is_that_of_the_equations(follower_hz, slew, threshold):
    ours = simulated_us(STEP, threshold, follower=follower_hz, slew=slew)
    theirs = [ode_latency_us(e, follower_hz, slew, threshold=threshold) for e in LIGHT]
    np.testing.assert_allclose(ours, theirs, rtol=1e-4, atol=0.03)


@pytest.mark.parametrize("polarity", [1, 0], ids=["ON", "OFF"])
def test_one_pole_fires_after_the_logarithm_of_what_is_left(polarity):
    """Whatever else the pixel was declared to have: it rests, and is asked for one event."""
    busy = ["leak.rate_hz=50", "thresholds.mismatch=0.05", "photoreceptor_noise.rms=0.05"]
    sets = [f"pixel.{key}" for key in busy]
    ours = simulated_us(STEP, ON, sets=sets, polarity=polarity, stray=2.0)
    bright = 255.0 * LIGHT / LIGHT.max() + 2.0
    dim = 255.0 * LIGHT / LIGHT.max() * np.exp(-STEP) + 2.0
    corner = 2 * np.pi * CUTOFF_HZ * (bright if polarity else dim) / 255.0
    theirs = -1e6 * np.log(1.0 - ON / np.log(bright / dim)) / corner
    np.testing.assert_allclose(ours, theirs, rtol=1e-4, atol=0.03)


def test_a_threshold_above_the_step_is_never_crossed():
    """Then the latency is as long as is simulated."""
    found = simulated_us([0.1, *[0.3] * 5], 0.2, follower=2000.0)
    assert found[0] > 1e5
    assert found[1:].max() < 3e4


def test_two_equal_poles_are_solved():
    found = simulated_us(STEP, 0.5, follower=CUTOFF_HZ)[-1]
    turns = brentq(lambda t: 0.5 - (1 + t) * np.exp(-t), 0.0, 5.0)
    assert found == pytest.approx(1e6 * turns / (2 * np.pi * CUTOFF_HZ), rel=1e-3)


def test_nothing_missing_is_consistent():
    found = verdict_of(table([ode_latency_us(e) for e in LIGHT]))
    assert found.verdict == "consistent"
    assert found.effects == []
    assert found.errors[0].after == found.errors[0].before
    assert found.nuisances["pixel.low_pass.cutoff_hz"] == pytest.approx(CUTOFF_HZ, rel=0.03)


@pytest.mark.thorough
def test_a_second_pole_is_named_with_its_corner():
    found = verdict_of(table([ode_latency_us(e, follower_hz=800.0) for e in LIGHT]))
    (effect,) = found.effects
    assert effect.name == "source_follower"
    assert found.verdict in ("explained", "not_identifiable")
    low, high = effect.interval["pixel.source_follower.cutoff_hz"]
    assert low < 800.0 < high
    assert found.errors[0].after.value < 0.2 * found.errors[0].before.value


def test_a_dark_corner_is_a_dark_current_or_a_corner_in_the_dark():
    found = verdict_of(table([ode_latency_us(e, dark_hz=60.0) for e in LIGHT]))
    assert found.verdict in ("explained", "not_identifiable")
    assert {effect.name for effect in found.effects} <= {"low_pass", "dark_current"}


@pytest.mark.thorough
def test_a_slew_limit_shows_in_steps_of_several_sizes():
    steps = np.repeat([0.5, 1.0, 3.0], LIGHT.size)
    light = np.tile(LIGHT, 3)
    latency = [ode_latency_us(e, slew=900.0, step=s) for e, s in zip(light, steps, strict=True)]
    found = verdict_of(table(latency, light, contrast_ln=steps), ["pixel.thresholds.on=0.2"])
    assert [effect.name for effect in found.effects] == ["slew_limit"]
    assert found.verdict == "explained"


def test_a_constant_at_one_step_size_and_few_lights_is_not_identifiable():
    light = LIGHT[2:5]
    latency = np.repeat([ode_latency_us(e) + 60.0 for e in light], 2)
    measured = table(latency, np.repeat(light, 2), noise=0.05, error=0.05)
    found = verdict_of(measured)
    assert found.verdict == "not_identifiable"
    assert {"clock_offset", "source_follower"} <= {e.name for e in found.effects} | set(
        found.alternatives
    )


@pytest.mark.thorough
def test_latency_that_grows_with_light_is_unexplained():
    found = verdict_of(table(50.0 * LIGHT**0.4))
    assert found.verdict == "unexplained"
    assert found.effects == []


def test_a_declared_corner_that_is_wrong_is_a_finding():
    measured = table([ode_latency_us(e) for e in LIGHT])
    found = verdict_of(measured, ["pixel.low_pass.cutoff_hz=300"])
    assert found.effects[0].name == "low_pass"
    (value,) = found.effects[0].parameters.values()
    assert value == pytest.approx(CUTOFF_HZ, rel=0.05)


@pytest.mark.thorough
def test_the_same_seed_gives_the_same_report():
    measured = table([ode_latency_us(e, follower_hz=800.0) for e in LIGHT])
    assert verdict_of(measured, seed=4).effects == verdict_of(measured, seed=4).effects


@pytest.mark.thorough
def test_the_command_writes_a_report_and_a_model_that_loads(tmp_path):
    light = np.tile(LIGHT, 2)
    latency = [ode_latency_us(e, follower_hz=800.0) for e in light]
    measured = table(latency, light, camera=np.repeat(["A", "B"], LIGHT.size))
    path = tmp_path / "latency.csv"
    rows = [",".join(measured.columns), *(",".join(row) for row in measured.rows)]
    path.write_text("# made\n" + "\n".join(rows) + "\n")
    out = tmp_path / "out"
    arguments = ["characterise", str(path), "--judge", "camera=B", "-o", str(out)]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 0, result.output
    assert "source_follower" in result.output
    report = json.loads((out / "report.json").read_text())
    assert report["error"]["held_out"] is True
    assert report["error"]["after"] < report["error"]["before"]
    assert report["effects"][0]["name"] == "source_follower"
    config = load_config([out / "model.yaml"])
    fitted = report["effects"][0]["parameters"]["pixel.source_follower.cutoff_hz"]
    assert config.pixel.source_follower.cutoff_hz == fitted
    page = (out / "report.html").read_text()
    assert "<svg" in page
    assert "://" not in page
    assert report["table"] == str(path)
    again = CliRunner().invoke(main, arguments)
    assert again.exit_code == 1
    assert "--overwrite" in again.output


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "is empty"),
        ("irradiance_W_m2,latency_us\n", "no rows below the header"),
        ("irradiance_W_m2,latency_us\n1,2\n3\n", "t.csv:3: has 1 cells"),
        ("irradiance_W_m2,latency_us\n1,2\n2,x\n3,4\n", "t.csv:3: latency_us: must be a number"),
        ("irradiance_W_m2,latency_us\n1,2\n2,-1\n3,4\n", "t.csv:3: latency_us: must be above 0"),
        ("irradiance_W_m2,latency_us\n1,2\n2,\n3,4\n", "t.csv:3: latency_us: is empty"),
        ("irradiance_W_m2,latency_us\n1,2\n2,nan\n3,4\n", "finite"),
        ("irradiance_W_m2,irradiance_W_m2\n1,2\n", "twice"),
        ("irradiance_W_m2 latency_us polarity\n1 2 1\n", "no comma, semicolon or tab"),
        ("irradiance,latency_us\n1,2\n", "must have one of the columns irradiance_W_m2"),
        ("irradiance_W_m2,delay\n1,2\n", "latency_us"),
        ("irradiance_W_m2,latency_us,on_rate_hz\n1,2,3\n", "either"),
        ("irradiance_W_m2,latency_us\n1,2\n2,3\n", "at least 3"),
        ("illuminance_lux,on_rate_hz\n1,\n10,\n100,\n", "rows with a number have 0 different"),
        ("illuminance_lux,on_rate_hz\n1,2\n10,\n100,3\n", "on_rate_hz: rows with a number have 2"),
        ("irradiance_W_m2,latency_us,polarity\n1,2,up\n2,3,1\n3,4,1\n", "t.csv:2: polarity"),
    ],
)
def test_a_broken_table_is_one_line_with_its_place(tmp_path, text, complaint):
    path = tmp_path / "t.csv"
    path.write_text(text)
    result = CliRunner().invoke(main, ["characterise", str(path)])
    assert result.exit_code == 1
    assert result.output.count("\n") == 1
    assert complaint in result.output


def test_semicolons_with_decimal_commas_comments_and_other_units_are_read():
    text = "# lab\n\nlatency_ms;illuminance_lux;number;latency_sd_ms\n0,5;10;16;0,1\n0,2;20;;\n"
    measured = parse_table(text + "0,1;30;4;0,01\n", "t.csv")
    assert measured.numbers("latency_ms").tolist() == [0.5, 0.2, 0.1]
    assert measured.lines == (4, 5, 6)
    for value in ("0,1", "0,10", "0.1"):
        assert measured.matching(f"latency_ms={value}", "--where") == [False, False, True]


@pytest.mark.parametrize(
    ("option", "complaint", "status"),
    [
        (["--where", "camera=A"], "has no column 'camera'", 1),
        (["--judge", "latency_us=77"], "no row has latency_us = 77", 1),
        (["--where", "latency_us"], "must be COLUMN=VALUE", 2),
    ],
)
def test_conditions_that_select_nothing_are_told(tmp_path, option, complaint, status):
    path = tmp_path / "t.csv"
    path.write_text("irradiance_W_m2,latency_us\n1,9\n2,5\n3,3\n4,2\n")
    result = CliRunner().invoke(main, ["characterise", str(path), *option])
    assert result.exit_code == status
    assert complaint in result.output


def test_a_group_of_rows_that_is_only_judged_has_no_threshold():
    latency = [ode_latency_us(e) for e in np.tile(LIGHT, 2)]
    measured = table(latency, np.tile(LIGHT, 2), polarity=np.repeat([1, 0], LIGHT.size))
    with pytest.raises(DataError, match=r"--judge takes all rows of OFF: .*pixel\.thresholds\.off"):
        verdict_of(measured, judge=("polarity=0",))
    verdict_of(measured, ["pixel.thresholds.off=0.2"], judge=("polarity=0",))


@pytest.mark.parametrize("sets", [(), ("pixel.thresholds.on=0.3",)])
def test_steps_below_the_threshold_are_told(sets):
    measured = table([ode_latency_us(e, step=0.25) for e in LIGHT])
    with pytest.raises(
        DataError, match=r"steps of 0\.1 \(ln\), ON, do not reach the threshold of 0\."
    ):
        verdict_of(measured, sets, contrast=0.1)


def test_a_low_pass_that_was_declared_not_to_be_there_is_a_finding():
    found = verdict_of(table([ode_latency_us(e) for e in LIGHT]), ["pixel.low_pass=null"])
    assert "pixel.low_pass.cutoff_hz" not in found.nuisances
    (effect,) = found.effects
    assert effect.name == "low_pass"
    assert effect.parameters["pixel.low_pass.cutoff_hz"] == pytest.approx(CUTOFF_HZ, rel=0.05)
    follower = verdict_of(
        table(np.full(LIGHT.size, 200.0)),
        ["pixel.low_pass=null", "pixel.source_follower.cutoff_hz=178"],
    )
    assert follower.verdict == "consistent"
    assert follower.model["pixel"]["low_pass"] is None


def test_a_stated_error_takes_the_place_of_the_tables():
    measured = table([ode_latency_us(e) for e in LIGHT])
    found = verdict_of(measured, error=0.5)
    assert "as stated: 50 %" in found.notes[-1]
    assert found.errors[0].floor.value == pytest.approx(0.5)


def test_floors_are_what_the_errors_of_the_rows_make_of_the_true_model():
    """Tables of a true model, drawn again and again, of rows that are known by 1 to 30 %."""
    relative = np.where(np.arange(3 * LIGHT.size) % 3 == 0, 0.01, 0.3)
    relative[: LIGHT.size] = 0.3  # the dimmest levels hardly
    light = np.repeat(LIGHT, 3)
    ideal = np.repeat([ode_latency_us(e) for e in LIGHT], 3)
    draw = np.random.default_rng(8)
    squares, floors = [], []
    for _ in range(60):
        latency = ideal * np.exp(relative * draw.standard_normal(ideal.size))
        measured = table(latency, light, 0.0, latency_error_us=relative * latency)
        sets = [f"pixel.low_pass.cutoff_hz={CUTOFF_HZ}", "pixel.low_pass.dark_cutoff_hz=0"]
        problem = problem_of(measured, read_declared([], sets), Settings())
        selector = Selector(problem, Settings(draws=1))
        squares.append(selector.fitted(()).errors)
        floors.append(selector.floors)
    low, high = (np.quantile(np.sqrt(floors), q) for q in (0.05, 0.95))
    assert high > 5 * low
    ratio = np.sqrt(np.mean(squares, axis=0) / np.mean(floors, axis=0))
    np.testing.assert_allclose(ratio, 1.0, atol=0.35)


@pytest.mark.parametrize(("unit", "factor"), [("us", 1.0), ("ms", 1e-3), ("s", 1e-6)])
def test_errors_may_be_in_another_unit_than_latencies(unit, factor):
    latency = np.array([ode_latency_us(e) for e in LIGHT])
    lines = [f"irradiance_W_m2,latency_ms,latency_error_{unit}"]
    lines += [
        f"{e},{t / 1e3:.9g},{0.03 * t * factor:.9g}" for e, t in zip(LIGHT, latency, strict=True)
    ]
    held = measurements_of(parse_table("\n".join(lines), "t.csv"))
    np.testing.assert_allclose(held.error, 0.03, rtol=1e-6)


@pytest.mark.thorough
def test_an_offset_beyond_all_latencies_is_no_crash():
    found = verdict_of(table([ode_latency_us(e) for e in LIGHT]), ["frames.clock_offset_us=-99999"])
    assert np.isfinite(found.errors[0].before.value)


@pytest.mark.thorough
def test_two_keys_of_one_effect_are_one_finding():
    latency = [ode_latency_us(e, dark_hz=200.0) for e in LIGHT]
    sets = ["pixel.low_pass.cutoff_hz=300", "pixel.low_pass.dark_cutoff_hz=5"]
    found = verdict_of(table(latency), sets)
    names = [effect.name for effect in found.effects]
    assert len(names) == len(set(names))
    assert "low_pass and low_pass" not in found.sentence


def test_a_second_pole_that_shows_in_bright_light_alone_is_more_than_chance():
    """The brighter, the more it explains; the brightest is read badly, and wrongly where judged."""
    light = np.array([6.0, 46.0, 166.0, 277.0, 398.0])
    latency = np.array([ode_latency_us(one * 300.0 / 398.0, follower_hz=3000.0) for one in light])
    off = np.array([1.0, 1.0, 1.0, 1.0, 2.0])
    relative = np.array([0.01, 0.01, 0.01, 0.01, 0.2])
    lines = ["camera,irradiance_W_m2,latency_us,latency_error_us"]
    for camera, values in (("A", latency), ("B", latency * off * 0.93)):
        for one, value, share in zip(light, values, relative, strict=True):
            lines.append(f"{camera},{one},{value},{share * value}")
    measured = parse_table("\n".join(lines), "two.csv")
    found = characterise(measured, read_declared(), Settings(judge=["camera=B"], draws=40))
    assert found.verdict != "unexplained"
    named = {*(effect.name for effect in found.effects), *found.alternatives}
    assert "source_follower" in named
    assert found.errors[0].after.value < 0.5 * found.errors[0].before.value


def test_what_is_unexplained_says_how_near_the_best_comes():
    """Latency that rises with the light: no pole does that."""
    found = characterise(table(100.0 * LIGHT**0.3), read_declared(), Settings(draws=40))
    assert found.verdict == "unexplained"
    assert "No effect predicts light held out" in found.remark
    before = found.errors[0].before.value
    assert f"{before:.3g} before" in found.remark
    assert "with a constant" in found.remark

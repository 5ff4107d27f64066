"""Known light: its course, its leaps, the parts of it, and the table that tells it."""

import numpy as np
import pytest

from adv2e import simulate
from adv2e.config import load_config
from adv2e.diagnosis.configurations import of_frames_again, of_known_light, with_keys
from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.data.stimulus import (
    FILM_STEPS,
    LEAP_NS,
    Leaps,
    Seen,
    Stimulus,
    joined,
    refined,
)
from adv2e.diagnosis.known_light import read_known_light, read_stimulus
from adv2e.diagnosis.simulation.affordable import affordable
from adv2e.diagnosis.simulation.simulator import Simulator
from adv2e.errors import ConfigError, DataError
from adv2e.geometry import Rectangle, Size

SIZE = Size(6, 4)
CORNERS = "pixel.low_pass.cutoff_hz=100", "pixel.low_pass.dark_cutoff_hz=10"
NOISELESS = load_config(["ideal"], CORNERS)


@pytest.fixture
def table(tmp_path):
    """Return what writes a table of light, and gives its path."""

    def write(text):
        path = tmp_path / "stimulus.csv"
        path.write_text(text, "utf-8")
        return path

    return write


@pytest.fixture
def recording(tmp_path):
    """Return what writes events: times [us] and pixels, each 1500 times in turn, ON and OFF."""

    def write(first_us, last_us, size=SIZE, number=1500):
        random = np.random.default_rng(1)
        t = np.sort(random.integers(first_us, last_us + 1, number))
        t[0], t[-1] = first_us, last_us
        x, y = random.integers(0, size[0], number), random.integers(0, size[1], number)
        x[0], y[0] = size[0] - 1, size[1] - 1
        path = tmp_path / "events.txt"
        rows = zip(t, x, y, np.arange(number) % 2, strict=True)
        path.write_text("".join(f"{at / 1e6:.9f} {c} {r} {p}\n" for at, c, r, p in rows), "ascii")
        return path

    return write


def stimulus_of(*rows, region=None):
    times, *light = np.array(rows, float).T
    region = np.zeros((4, 6), np.intp) if region is None else region
    return Stimulus("a", np.rint(times * 1e9).astype(np.int64), np.stack(light, axis=1), region)


def test_light_is_a_line_between_rows_and_leaps_where_two_have_one_time(table):
    path = table("time_s,light_dn\n0,10\n1,30\n1,90\n2,90\n")
    found, part = read_stimulus(path, SIZE)
    assert part == Rectangle(0, 0, 6, 4)
    times = np.array([0.0, 0.25, 0.5, 1.0, 1.0 + 2e-7, 1.5]) * 1e9
    assert found.at(times)[:, 0] == pytest.approx([10, 15, 20, 30, 90, 90], rel=1e-6)
    (leaps,) = found.leaps.times_us
    assert leaps.tolist() == [1_000_000]


@pytest.mark.parametrize(
    ("text", "dn"),
    [
        ("time_ms;light\n0;0,5\n1000;1\n", [127.5, 255.0]),
        ("# a lamp\ntime_us\tlight_dn\n0\t4\n\n1000000\t8\n", [4.0, 8.0]),
    ],
)
def test_units_are_those_of_the_header(table, text, dn):
    found, _ = read_stimulus(table(text), SIZE)
    assert found.times_ns[[0, -1]].tolist() == [0, 1_000_000_000]
    assert found.light[[0, -1], 0].tolist() == dn


def test_instants_are_so_near_that_a_line_of_the_logarithm_is_the_line_of_the_light():
    times, light = np.array([0, 10**9]), np.array([[0.2, 100.0], [200.0, 3.0]])
    every = refined(times, light)
    assert every[[0, -1]].tolist() == [0, 10**9]
    assert len(every) < 1600
    fine = np.linspace(0, 1e9, 20_001)
    for column in light.T:
        log = np.log(np.interp(every, times, column))
        truth = np.log(np.interp(fine, times, column))
        assert np.abs(np.interp(fine, every, log) - truth).max() < 6e-5


def test_what_is_simulated_is_the_light_of_the_table_and_not_of_frames(table, recording):
    path = table("time_s,light_dn\n0,20\n0.1,20\n0.1,60\n0.2,60\n0.4,200\n0.4,15\n0.5,15\n")
    evidence = read_known_light(recording(0, 499_999), path)
    made = Simulator(evidence, 1).stream(of_known_light(NOISELESS), 0)
    ramp_s = np.arange(0.2, 0.4, 1e-4)
    times = [0.0, 0.1, 0.1 + 1e-7, *ramp_s, 0.4, 0.4 + 1e-7, 0.5]
    light = [20.0, 20.0, 60.0, *(60 + 700 * (ramp_s - 0.2)), 200.0, 15.0, 15.0]
    frames = [np.full((4, 6), dn / 255.0, np.float32) for dn in light]
    config = with_keys(NOISELESS, {"sampling.L": 1, "frames.full_scale": 1.0})
    fine = np.concatenate(list(simulate(frames, times, config)))
    assert len(made) == len(fine) > 200
    assert np.abs(made.t - fine["t"]).max() <= 20
    assert np.array_equal(made.on, fine["p"])


def test_regions_see_their_own_light(table, recording):
    path = table("time_s,light_dn 0 0 2 4,light_dn\n0,20,50\n0.1,20,50\n0.1,60,50\n0.5,60,50\n")
    evidence = read_known_light(recording(0, 499_999), path)
    made = Simulator(evidence, 1).stream(of_known_light(NOISELESS), 0)
    assert set((made.pixel % 6).tolist()) == {0, 1}
    assert np.all(made.on == 1)
    since = evidence.stimulus.leaps.since(evidence.stream)
    known = (evidence.stream.pixel % 6 < 2) & (evidence.stream.t >= 100_000)
    assert np.array_equal(since >= 0, known)
    assert np.array_equal(since[known], evidence.stream.t[known] - 100_000)


def test_light_of_a_rectangle_alone_is_a_recording_of_its_pixels(table, recording):
    path = table("time_s,light_dn 1 1 4 2\n0,20\n0.5,60\n")
    evidence = read_known_light(recording(0, 499_999, number=6000), path)
    assert (evidence.width, evidence.height) == (4, 2)
    assert len(evidence.stream) == pytest.approx(6000 * 8 / 24, rel=0.1)
    (masked,) = evidence.masked
    assert masked.share == pytest.approx(16 / 24, abs=0.03)
    light = evidence.light(of_known_light(load_config()))
    assert light.shape == (len(evidence.frames), 2, 4)
    assert light[[0, -1], 1, 3] == pytest.approx([20, 60])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time_s,light_dn\n0,1\n2,1\n1,1\n", r"csv:4: time_s: must not be before the row above"),
        ("time_s,light_dn\n0,1\n1,1\n1,2\n1,3\n2,1\n", r"csv:5: time_s: must not stand more than"),
        ("time_s,light_dn\n0,1\n1,-1\n", r"csv:3: light_dn: must be at least 0, got '-1'"),
        ("time_s,light_dn\n0,nan\n1,1\n", r"csv:2: light_dn: must be a finite number, got 'nan'"),
        ("time_s,light\n0,1\n1,2e3\n", r"csv:3: light: must be at most 255,000 DN, 1000 times"),
        ("time_s,light_dn\n0,\n1,1\n", r"csv:2: light_dn: is empty, must be a number"),
        ("time_s,light_dn\n0,1\n", r"csv: has 1 row, at least 2 are needed"),
        ("seconds,light_dn\n0,1\n1,1\n", r"needs one column time_s, time_ms or time_us"),
        ("time_s,dn\n0,1\n1,1\n", r"needs a column light_dn \(255 is white\) or light"),
        ("time_s,light,light_dn 0 0 1 1\n0,1,1\n1,1,1\n", r"all light in one unit"),
        ("time_s,light_dn,lux\n0,1,1\n1,1,1\n", r"column 'lux' is not known"),
        ("time_s,light_dn 0 0 7 1\n0,1\n1,1\n", r"'light_dn 0 0 7 1': .* inside the sensor of 6x4"),
        ("time_s,light_dn 0 0 7\n0,1\n1,1\n", r"'light_dn 0 0 7': must be first column"),
        (
            "time_s,light_dn 0 0 2 1,light_dn 1 0 2 1\n0,1,1\n1,1,1\n",
            r"'light_dn 1 0 2 1': the rectangle must not overlap another",
        ),
        (
            "time_s,light_dn 0 0 2 1,light_dn 4 0 2 1\n0,1,1\n1,1,1\n",
            r"the rectangles must fill the one about them",
        ),
    ],
)
def test_a_table_that_is_no_light_is_refused_in_a_line(table, text, said):
    with pytest.raises(DataError, match=said) as error:
        read_stimulus(table(text), SIZE)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("span", [(0, 600_000), (-100, 400_000)])
def test_events_of_unknown_light_are_refused(table, recording, span):
    path = table("time_s,light_dn\n0,20\n0.5,60\n")
    with pytest.raises(DataError, match=r"from 0\.000000 to 0\.500000 s, events .* come from"):
        read_known_light(recording(*span), path)


@pytest.mark.thorough
def test_of_too_many_pixels_some_in_even_distances_are_kept(table, recording, monkeypatch):
    path = table("time_s,light_dn\n0,20\n0.5,60\n")
    evidence = read_known_light(recording(0, 499_999, Size(200, 120), 300_000), path)
    monkeypatch.setattr("adv2e.diagnosis.simulation.affordable.AFFORDABLE_S", 0.03)
    kept = affordable(evidence, of_known_light(load_config()))
    assert (kept.width, kept.height) != (200, 120)
    assert 200 // kept.width == 120 // kept.height > 1
    assert kept.notes[-1].startswith("one pixel of each ")
    assert len(kept.stream) == pytest.approx(12.5 * kept.width * kept.height, rel=0.1)
    assert kept.seconds == evidence.seconds


def test_what_frames_do_is_not_there_for_known_light_and_comes_back_in_the_model():
    coupling = "readout.frame_coupling={amplitude: 0.1, tau_us: 300}"
    sets = "frames.exposure_us=900", coupling, "readout.tick_us=2"
    given = load_config(["davis346"], sets)
    known = of_known_light(given)
    assert (known.frames.exposure_us, known.sampling.L) == (0.0, 1)
    assert known.readout.frame_coupling is None
    assert known.readout.tick_us == 2.0
    found = with_keys(known, {"pixel.refractory.period_us": 7.0, "frames.clock_offset_us": 3.0})
    back = of_frames_again(found, given)
    expected = {"pixel.refractory.period_us": 7.0, "frames.clock_offset_us": 3.0}
    assert back == with_keys(given, expected)


def test_a_low_pass_in_steps_has_none_between_rows():
    with pytest.raises(ConfigError, match=r"update: must be exact where the light is known"):
        of_known_light(load_config(["paper"]))


def test_frames_are_made_when_they_are_asked_for():
    region = np.array([[0, 1], [1, 1]])
    seen = Seen(np.array([[1, 2], [3, 4], [5, 6]], np.float32), region)
    assert seen[1].tolist() == [[3, 4], [4, 4]]
    assert [frame.tolist() for frame in seen[1:]] == [[[3, 4], [4, 4]], [[5, 6], [6, 6]]]
    assert len(joined(seen, seen[:1])) == 4
    assert joined(seen, seen[:1])[3].tolist() == [[1, 2], [2, 2]]


def test_instants_looked_at_are_nearer_where_leaps_are():
    slow = stimulus_of((0, 10), (1, 20))
    assert np.diff(slow.looked_at_ns()).tolist() == [2_000_000] * 500
    rows = [(0, 10)]
    for k in range(1, 100):
        rows += [(0.004 * k, rows[-1][1]), (0.004 * k + LEAP_NS * 1e-9, 10 + 20 * (k % 2))]
    fast = stimulus_of(*rows)
    assert np.diff(fast.looked_at_ns()).mean() == pytest.approx(1_000_000, rel=0.01)


def test_time_since_a_leap_is_that_of_the_last_one():
    course = stimulus_of((0, 10), (0.1, 10), (0.1 + 1e-7, 30), (0.3, 30), (0.3 + 1e-7, 9), (1, 9))
    t = np.array([50_000, 100_000, 299_999, 300_010])
    stream = Stream(t, np.zeros(4, np.int32), np.ones(4, np.int8), 6, 4)
    assert course.leaps.since(stream).tolist() == [-1, 0, 199_999, 10]


def film(rows, size=SIZE):
    """Return a table of a film, each pixel a rectangle of its own, from (time, (rows, columns))."""
    names = [f"light_dn {x} {y} 1 1" for y in range(size.height) for x in range(size.width)]
    lines = [",".join(["time_s", *names])]
    lines += [",".join([f"{t:.9f}", *(f"{dn:.6f}" for dn in light.ravel())]) for t, light in rows]
    return "\n".join([*lines, ""])


def edge(t):
    """Return a bright edge that moves over the dark, (rows, columns) [DN]."""
    x, y = np.meshgrid(np.arange(SIZE.width), np.arange(SIZE.height))
    return 1.0 + 200.0 / (1.0 + np.exp(-3.0 * (20.0 * t - x - 0.3 * y)))


def test_a_film_is_followed_from_row_to_row(table, recording):
    times = np.linspace(0.0, 0.5, 251)
    path = table(film([(t, edge(t)) for t in times]))
    evidence = read_known_light(recording(0, 499_999), path)
    assert evidence.stimulus.steps == FILM_STEPS
    assert np.array_equal(evidence.stimulus.times_ns, np.rint(times * 1e9))
    made = Simulator(evidence, 1).stream(of_known_light(NOISELESS, FILM_STEPS), 0)
    # the line from row to row, in steps that are far finer
    fine_s = np.linspace(0.0, 0.5, 250 * 200 + 1)
    rows = np.stack([edge(t) for t in times])
    k = np.minimum((fine_s / 0.002).astype(int), 249)
    share = (fine_s / 0.002 - k)[:, None, None]
    frames = ((1.0 - share) * rows[k] + share * rows[k + 1]).astype(np.float32)
    config = with_keys(NOISELESS, {"sampling.L": 1, "frames.full_scale": 255.0})
    truth = np.concatenate(list(simulate(list(frames), fine_s, config)))
    assert len(made) == len(truth) > 300
    order = np.lexsort((made.t, made.pixel))
    by_pixel = np.lexsort((truth["t"], truth["y"] * SIZE.width + truth["x"]))
    assert np.abs(made.t[order] - truth["t"][by_pixel]).max() <= 3
    assert np.array_equal(made.on[order], truth["p"][by_pixel])


def test_rows_of_a_film_that_are_far_apart_have_more_between_them_as_it_changes(table):
    dark, lit = edge(0.0), edge(0.2)
    rows = [(0.0, dark), (0.101, dark), (0.101, lit), (0.4, lit), (0.4121, dark)]
    found, _ = read_stimulus(table(film(rows)), SIZE)
    assert found.times_ns.tolist() == [
        0, 101_000_000, 101_000_100, 400_000_000, 404_033_333, 408_066_667, 412_100_000,
    ]  # fmt: skip
    assert found.at([406_050_000])[0] == pytest.approx(0.5 * (dark + lit).ravel())
    assert {tuple(one.tolist()) for one in found.leaps.times_us} == {(101_000,)}


def test_a_lamp_over_many_pixels_is_no_film(table):
    found, _ = read_stimulus(table("time_s,light_dn,light_dn 0 0 2 2\n0,20,1\n1,60,200\n"), SIZE)
    assert found.steps == 1
    assert len(found.times_ns) > 100


def test_time_since_a_leap_is_that_of_its_own_region():
    random = np.random.default_rng(3)
    regions = [np.sort(random.integers(-500, 500, n)) for n in (0, 3, 40, 1, 0, 7)]
    region = random.integers(0, 6, 24)
    t = np.sort(random.integers(-700, 900, 4000))
    stream = Stream(t, random.integers(0, 24, 4000), np.ones(4000, np.int8), 6, 4)
    expected = [
        min((at - leap for leap in regions[region[pixel]] if leap <= at), default=-1)
        for at, pixel in zip(t.tolist(), stream.pixel, strict=True)
    ]
    assert Leaps(tuple(regions), region).since(stream).tolist() == expected
    assert set(Leaps((regions[0],) * 6, region).since(stream).tolist()) == {-1}

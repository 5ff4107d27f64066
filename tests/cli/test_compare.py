from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

import adv2e as package
from adv2e.comparison import resimulation
from adv2e.events import make_events, sort_events
from adv2e.formats.writing import open_sink

WIDTH, HEIGHT = 10, 8


def some_events(seed, count=2000, last=100_000):
    draw = np.random.default_rng(seed)
    x, y = draw.integers(0, WIDTH, count), draw.integers(0, HEIGHT, count)
    t = draw.choice(last, count, replace=False)
    return sort_events(make_events(t, x, y, draw.integers(0, 2, count)))


@pytest.fixture
def write(tmp_path):
    """Write events, and frames at the times given [ms], to a file."""

    def write_file(name, events, frames_ms=(), width=WIDTH, metadata=None):
        path = tmp_path / name
        size = {"width": width, "height": HEIGHT}
        with open_sink(path, **size, metadata=metadata or {}, with_frames=bool(frames_ms)) as sink:
            for t_ms in frames_ms:
                sink.write_frame(t_ms * 1_000_000, np.full((HEIGHT, width), t_ms, np.uint8))
            sink.write_events(events)
        return path

    return write_file


@pytest.fixture
def pair(write):
    measured = write("real.h5", some_events(1), range(0, 101, 20))
    return measured, write("made.h5", some_events(2))


@pytest.fixture
def simulation(monkeypatch):
    """Stand in for the simulation: events that depend on the seed, calls remembered."""
    calls = []

    def events_from_light(light, config, *, threads=None):
        calls.append(([float(image[0, 0]) for _, image in light], config, threads))
        yield some_events(config.seed + 100)

    monkeypatch.setattr(resimulation, "events_from_light", events_from_light)
    return calls


def test_the_table_shows_every_distance_with_its_floor(adv2e, pair):
    status, out, err = adv2e("compare", *pair)
    assert (status, err) == (0, "")
    assert "over 3 of 5 frame intervals, 0.02 to 0.08 s" in out
    row = next(line for line in out.splitlines() if line.startswith("bins_shared_window"))
    assert [float(value) > 0 for value in row.split()[1:]] == [True, True]
    assert "two_seeds" not in out


def test_json_holds_definitions_values_floors_and_windows(adv2e, pair):
    report = json.loads(adv2e("compare", *pair, "--json").out)
    measure = report["measures"]["relative_5_bins"]
    assert set(measure) == {"definition", "value", "floor", "per_window"}
    assert len(measure["per_window"]) == report["windows"]["used"] == 3
    assert measure["floor"]["two_seeds"] is None
    assert report["measured"]["file"].endswith("real.h5")


def test_a_window_in_seconds_replaces_frame_intervals(adv2e, pair):
    report = json.loads(adv2e("compare", *pair, "--json", "--window", "0.01").out)
    assert report["windows"]["kind"] == "windows of 0.01 s"
    assert report["windows"]["used"] == 9


def test_a_configuration_gives_the_floor_of_two_seeds(adv2e, pair, simulation):
    args = ("-c", "ideal", "--set", "frames.encoding=linear", "--seed", "5", "--threads", "1")
    report = json.loads(adv2e("compare", *pair, "--json", *args).out)
    assert report["measures"]["relative_5_bins"]["floor"]["two_seeds"] > 0
    assert [config.seed for _, config, _ in simulation] == [5, 6]
    assert simulation[0][0] == [0, 20, 40, 60, 80, 100]
    assert simulation[0][2] == 1


def test_an_effect_of_the_user_is_a_configuration(adv2e, pair, simulation, tmp_path):
    (tmp_path / "mine.py").write_text(
        "from adv2e.effects.hooks import Hooks\n"
        "class Delay(Hooks):\n"
        "    def drive(self, times_s):\n"
        "        return 0 * times_s\n"
    )
    assert adv2e("compare", *pair, "--effect", tmp_path / "mine.py").status == 0
    assert [config.seed for _, config, _ in simulation] == [0, 1]


def test_the_largest_seed_has_another_beside_it(adv2e, pair, simulation):
    args = ("-c", "ideal", "--set", "frames.encoding=linear", "--seed", str(2**64 - 1))
    assert adv2e("compare", *pair, *args).status == 0
    assert [config.seed for _, config, _ in simulation] == [2**64 - 1, 0]


def test_frames_of_a_file_of_ours_keep_their_encoding(adv2e, write, simulation):
    metadata = {"source": {"encoding": "srgb"}}
    measured = write("first.h5", some_events(1), (0, 50, 60), metadata=metadata)
    assert adv2e("compare", measured, measured, "-c", "adv2e").status == 0
    assert simulation[0][0] == [
        pytest.approx(255 * ((value / 255 + 0.055) / 1.055) ** 2.4 if value else 0)
        for value in (0, 50, 60)
    ]


def test_frames_from_elsewhere_make_windows_and_floor(adv2e, write, simulation, tmp_path):
    measured, simulated = write("real.h5", some_events(1)), write("made.h5", some_events(2))
    np.save(tmp_path / "frames.npy", np.zeros((6, HEIGHT, WIDTH), np.uint8))
    times = "".join(f"{0.02 * n:.6f}\n" for n in range(6))
    (tmp_path / "frames.timestamps.txt").write_text(times)
    files = (measured, simulated, "--frames", tmp_path / "frames.npy", "-c", "ideal")
    report = json.loads(adv2e("compare", *files, "--json").out)
    assert report["windows"]["edges_us"] == [20_000, 40_000, 60_000, 80_000]
    assert len(simulation[0][0]) == 6


@pytest.mark.filterwarnings("ignore:.*repeat another")
def test_the_function_is_the_command(adv2e, pair):
    words = ("--start", "0.02", "--stop", "0.09", "--crop", "2,1,6,5", "--window", "0.01")
    report = json.loads(adv2e("compare", *pair, *words, "--json").out)
    given = {"start_s": 0.02, "stop_s": 0.09, "crop": (2, 1, 6, 5), "window_s": 0.01}
    assert package.compare(*pair, **given) == report
    assert (report["measured"]["width"], report["simulated"]["height"]) == (6, 5)
    first = int(some_events(1)["t"][0])
    edges = report["windows"]["edges_us"]
    assert first + 20_000 <= edges[0] < first + 21_000
    assert edges[-1] <= first + 90_000


def test_frames_of_a_part_are_those_of_its_time(adv2e, pair):
    report = json.loads(adv2e("compare", *pair, "--start", "0.03", "--json").out)
    assert report["windows"]["edges_us"] == [40_000, 60_000, 80_000]


def test_the_unit_of_times_is_that_of_frames_from_elsewhere_too(adv2e, write, tmp_path):
    measured, simulated = write("real.h5", some_events(1)), write("made.h5", some_events(2))
    np.save(tmp_path / "frames.npy", np.zeros((6, HEIGHT, WIDTH), np.uint8))
    (tmp_path / "frames.timestamps.txt").write_text("".join(f"{20 * n}\n" for n in range(6)))
    frames = ("--frames", tmp_path / "frames.npy", "--time-unit", "ms")
    report = json.loads(adv2e("compare", measured, simulated, *frames, "--json").out)
    assert report["windows"]["edges_us"] == [20_000, 40_000, 60_000, 80_000]


def test_a_video_beside_events_has_times_of_its_own(adv2e, tmp_path):
    video = tmp_path / "film.avi"
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"MJPG"), 50, (WIDTH, HEIGHT))
    for _ in range(6):
        writer.write(np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    writer.release()
    for name, seed in (("real.txt", 1), ("made.txt", 2)):
        rows = [f"{t * 1000} {x} {y} {p}" for t, x, y, p in some_events(seed).tolist()]
        (tmp_path / name).write_text("\n".join(rows) + "\n")
    words = ("--frames", video, "--time-unit", "ns", "--size", f"{WIDTH}x{HEIGHT}", "--json")
    report = json.loads(adv2e("compare", tmp_path / "real.txt", tmp_path / "made.txt", *words).out)
    assert report["windows"]["edges_us"] == [20_000, 40_000, 60_000, 80_000]


def test_frames_beside_measured_events_are_never_scaled(adv2e, pair, simulation):
    status, out, err = adv2e("compare", *pair, "-c", "davis346")
    assert (status, out) == (1, "")
    assert err.count("\n") == 1
    assert "real.h5: events of 10x8 pixels, but the configuration says a sensor of 346x260" in err
    assert adv2e("compare", *pair, "-c", "davis346", "--set", "sensor=null").status == 0
    assert adv2e("compare", *pair, "--set", "sensor={width: 10, height: 8}").status == 0


def test_frames_from_elsewhere_come_to_the_sensor(adv2e, pair, simulation, tmp_path):
    np.save(tmp_path / "frames.npy", np.full((6, 3 * HEIGHT, 2 * WIDTH), 40, np.uint8))
    times = "".join(f"{0.02 * n:.6f}\n" for n in range(6))
    (tmp_path / "frames.timestamps.txt").write_text(times)
    light = ("--set", "frames.encoding=linear")
    words = (*pair, "--frames", tmp_path / "frames.npy", *light, "--set")
    assert adv2e("compare", *words, "sensor={width: 10, height: 8}").status == 0
    assert simulation[0][0] == [40.0] * 6
    status, _, err = adv2e("compare", *words, "seed=3")
    assert status == 1
    assert "20x24 pixels, but the events are of 10x8" in err


def test_a_floor_of_two_seeds_without_frames_says_what_to_give(adv2e, write):
    measured, simulated = write("real.h5", some_events(1)), write("made.h5", some_events(2))
    status, out, err = adv2e("compare", measured, simulated, "-c", "ideal")
    assert (status, out) == (1, "")
    assert "real.h5: holds no frames" in err
    assert "--frames" in err


def test_sizes_that_differ_are_refused_in_one_line(adv2e, write, pair):
    other = write("other.h5", some_events(2), width=WIDTH + 2)
    status, out, err = adv2e("compare", pair[0], other)
    assert (status, out) == (1, "")
    assert err.count("\n") == 1
    assert "12x8" in err
    assert "10x8" in err


def test_streams_on_different_clocks_are_refused_with_their_spans(adv2e, write, pair):
    later = some_events(2)
    later["t"] += 1_000_000_000
    status, _, err = adv2e("compare", pair[0], write("later.h5", later))
    assert status == 1
    assert err.count("\n") == 1
    assert "spans 1000.0" in err


@pytest.mark.parametrize("args", [["--window", "0"], ["--window", "x"], ["--set", "pixel.nope=1"]])
def test_a_wrong_command_line_has_status_2(adv2e, pair, args):
    assert adv2e("compare", *pair, *args).status == 2


def test_what_is_doubtful_in_a_file_is_told_unless_quiet(adv2e, write, pair):
    events = some_events(2)
    doubtful = write("twice.h5", np.repeat(events, 2))
    assert "twice.h5: 2000 events repeat" in adv2e("compare", pair[0], doubtful).err
    assert adv2e("compare", pair[0], doubtful, "-q").err == ""


def test_a_missing_file_has_status_1(adv2e, pair, tmp_path):
    status, _, err = adv2e("compare", pair[0], tmp_path / "none.h5")
    assert status == 1
    assert "none.h5" in err

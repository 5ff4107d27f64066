"""One wrong time or coordinate: a line that says so, or the numbers of all, in little memory."""

import json

import numpy as np
import pytest

from adv2e.cli import main
from adv2e.comparison import distances as module
from adv2e.comparison.distances import compact, distances, keys
from adv2e.comparison.windows import Windows, fixed_windows, holding_events
from adv2e.errors import DataError
from adv2e.events import cut, make_events, sort_events


def stream(seed, count=400, span=400_000, width=60, height=40):
    made = np.random.default_rng(seed)
    t = made.integers(0, span, count)
    # few rows and columns, some beside each other and some at the edges
    x = made.choice([0, 1, 2, 5, 7, 20, 22, 58, 59], count)
    y = made.choice([0, 3, 4, 9, 11, 12, 30, 38], count)
    assert x.max() < width
    assert y.max() < height
    return sort_events(make_events(t, x, y, made.integers(0, 2, count)))


def windows(stop=400_000, length=20_000):
    return Windows(
        "windows", tuple((t, t + length) for t in range(0, stop, length)), stop // length
    )


def test_windows_without_events_are_worth_what_they_were_worth():
    ours, theirs = (s[(s["t"] < 90_000) | (s["t"] > 250_000)] for s in map(stream, (1, 2)))
    found = distances(ours, theirs, windows(), 60, 40)
    still = ~holding_events(windows(), [ours, theirs])
    assert 3 < still.sum() < 16
    for n, window in enumerate(windows().used):
        one = Windows("one", (window,), 1)
        # the same with an event that is nowhere: every grid is made
        alone = distances(cut(ours, *window), cut(theirs, *window), one, 60, 40)
        for name in alone.per_window:
            if name != "error":
                assert found.per_window[name][n] == alone.per_window[name][0]
    assert found.per_window["bins_shared_window"][int(np.flatnonzero(still)[0])] == 0.0
    assert found.per_window["relative_5_bins"][int(np.flatnonzero(still)[0])] is None


@pytest.mark.parametrize("size", [(60, 40), (61, 39), (6000, 4000)])
def test_a_large_sensor_gives_the_numbers_of_all_its_pixels(monkeypatch, size):
    monkeypatch.setattr(module, "ENOUGH", 0)
    ours, theirs = stream(3), stream(4)
    (a, b), width, height = compact([ours, theirs], *size)
    assert width < 30
    assert height < 26
    within = (min(size[0], 62), min(size[1], 41))  # beyond, there is nothing
    whole = distances(ours, theirs, windows(), *within)
    found = distances(a, b, windows(), width, height)
    for name, value in whole.values.items():
        assert found.values[name] == pytest.approx(value, rel=1e-12), name


def test_too_many_pixels_with_events_are_refused():
    n = 3 * np.arange(5000)
    events = make_events(n, n, n, n % 2)
    with pytest.raises(DataError, match="events of 14999 columns and 14999 rows"):
        compact([events], 20_000, 20_000)


def test_more_windows_than_can_be_held_are_told():
    with pytest.raises(DataError, match=r"20,000,000 windows of 0\.05 s.*adv2e info.*--window"):
        fixed_windows(50_000, [(0, 10**12), (0, 10**12)])
    assert fixed_windows(50_000, [(0, 10**9)] * 2).total == 20_000


def test_times_so_far_apart_that_keys_would_run_over():
    events = make_events([0, 10**15], [0, 345], [0, 259], [1, 1])
    with pytest.raises(DataError, match="too far from each other"):
        keys(events, 346, 0, 10**15)


def write(path, *lines):
    path.write_text("".join(f"{line}\n" for line in lines))
    return str(path)


def test_compare_of_a_stray_time_says_so_at_once(tmp_path, capsys):
    path = write(tmp_path / "a.txt", "0.1 1 1 1", "0.2 2 2 0", "0.3 3 3 1", "1e6 1 1 1")
    with pytest.raises(SystemExit) as ended:
        main(["compare", path, path])
    told = capsys.readouterr().err
    assert ended.value.code == 1
    assert told.count("\n") == 1
    assert "19,999,998 windows" in told
    with pytest.raises(SystemExit) as ended:
        main(["compare", path, path, "--window", "1000", "--json"])
    assert ended.value.code == 0
    assert json.loads(capsys.readouterr().out)["measures"]["error"]["value"] == 0


@pytest.mark.parametrize("command", ["info", "compare", "render", "view"])
def test_a_stray_coordinate_is_named(tmp_path, capsys, command):
    path = write(tmp_path / "a.txt", "0.1 1 1 1", "0.2 30000 30000 0", "0.3 3 3 1")
    more = {"compare": [path], "render": ["-o", str(tmp_path / "o.png")]}
    more["view"] = ["-o", str(tmp_path / "o.html")]
    with pytest.raises(SystemExit) as ended:
        main([command, path, *more.get(command, [])])
    told = capsys.readouterr().err
    assert ended.value.code == 1
    assert told.count("\n") == 1
    assert f"{path}: a sensor of 30001x30001 pixels" in told
    assert "the event at 0.200000 s, x 30000, y 30000" in told


def test_a_stated_size_leaves_the_stray_coordinate_out(tmp_path, capsys):
    path = write(tmp_path / "a.txt", "346 260", "0.1 1 1 1", "0.2 30000 30000 0", "0.3 3 3 1")
    with pytest.raises(SystemExit) as ended:
        main(["info", path, "--json"])
    assert ended.value.code == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["width"], found["height"], found["events"]["count"]) == (346, 260, 2)


def test_a_film_of_a_stray_time_is_refused(tmp_path, capsys):
    path = write(tmp_path / "a.txt", "0.1 1 1 1", "0.2 2 2 0", "1e6 1 1 1")
    with pytest.raises(SystemExit) as ended:
        main(["render", path, "-o", str(tmp_path / "o.mp4")])
    told = capsys.readouterr().err
    assert ended.value.code == 1
    assert "has 29,999,997 pictures" in told
    assert "--max-pictures" in told
    assert not (tmp_path / "o.mp4").exists()


@pytest.mark.thorough
def test_an_hour_without_events_is_drawn_if_it_is_asked_for(tmp_path, capsys):
    path, film = write(tmp_path / "a.txt", "0 1 1 1", "0.1 2 2 0", "900 1 1 1"), tmp_path / "o.gif"
    for options, status in (
        (["--max-pictures", "1000"], 1),
        (["--stop", "1", "--max-pictures", "30"], 0),
        (["--speed", "900", "--max-pictures", "31", "--overwrite"], 0),
    ):
        with pytest.raises(SystemExit) as ended:
            main(["render", path, "-o", str(film), *options])
        assert (ended.value.code or 0, film.exists()) == (status, status == 0), options
        assert ("27,000 pictures" in capsys.readouterr().err) is (status == 1)


@pytest.mark.thorough
def test_windows_up_to_a_stray_time_are_refused(tmp_path, capsys):
    path = write(tmp_path / "a.txt", "0 1 1 1", "0.1 2 2 0", "1200 1 1 1")
    export = ["export", path, "-o", str(tmp_path / "grids"), "--to", "voxel", "--bins", "1"]
    with pytest.raises(SystemExit) as ended:
        main([*export, "--window", "33ms"])
    told = capsys.readouterr().err
    assert ended.value.code == 1
    assert "a.txt: no event in over 1,000 windows of 33 ms" in told
    assert not (tmp_path / "grids").exists()
    for more in (["--window", "4s"], ["--window", "1s", "--max-empty", "1200"]):
        with pytest.raises(SystemExit) as ended:
            main([*export, *more, "--overwrite"])
        assert not ended.value.code

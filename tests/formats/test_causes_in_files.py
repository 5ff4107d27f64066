"""Causes in files: as a column where the format has one, else beside; written, read and counted."""

import json

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

from adv2e import convert, load_config, read_events, render, simulate, write_events
from adv2e.causes import CAUSED_DTYPE, CAUSES, has_causes, with_cause
from adv2e.cli import main
from adv2e.errors import DataError, OutputError, UsageError
from adv2e.events import EVENT_DTYPE, make_events, sort_events
from adv2e.formats.causes import NAMES
from adv2e.formats.registry import FORMATS
from adv2e.formats.writing import open_sink

SIZE = 12, 9
NOISY = ["frames.encoding=linear", "pixel.leak.rate_hz=20", "pixel.shot_noise.rate_hz=40"]
OUTPUTS = ["out.h5", "dsec.h5", "out.npz", "out.csv", "out.txt", "out.zip", "out"]


def frames():
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    return [(90 + 70 * np.sin(0.4 * (x + y) - k)).astype(np.uint8) for k in range(12)]


@pytest.fixture
def clip(tmp_path):
    path = tmp_path / "clip.npy"
    np.save(path, np.array(frames()))
    return path


def made(**options):
    config = load_config([], NOISY, 3)
    return np.concatenate(list(simulate(frames(), 100, config, **options)))


def some(count, cause=None):
    draw = np.random.default_rng(count)
    t, x, y = np.sort(draw.integers(0, 10**6, count)), *draw.integers(0, 9, (2, count))
    causes = draw.integers(0, len(CAUSES), count) if cause is None else cause
    return with_cause(make_events(t, x, y, draw.integers(0, 2, count)), causes)


def run(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


@pytest.mark.parametrize("name", OUTPUTS)
@pytest.mark.quick_cases(1)
def test_what_is_converted_is_what_simulate_gives(name, clip, tmp_path):
    out, plain = tmp_path / name, tmp_path / f"plain_{name}"
    config = load_config([], NOISY, 3)
    given = {"fps": 100, "layout": "dsec" if name == "dsec.h5" else None}
    convert(clip, out, config, causes=True, preview=tmp_path / "seen.png", **given)
    convert(clip, plain, config, **given)
    found = read_events(out)
    assert found.events.dtype == CAUSED_DTYPE
    assert np.array_equal(found.events, made(causes=True))
    assert len(set(found.events["cause"])) == 3
    assert found.metadata["causes"] == list(CAUSES)
    assert not found.problems
    beside = tmp_path / f"{name}.causes.txt"
    if out.suffix in (".h5", ".npz", ".csv"):
        assert not beside.exists()
    if out.suffix == ".h5":
        with h5py.File(out) as file:
            column = file["events/causes"]
            assert column.dtype == np.uint8
            assert column.attrs["names"].split(",") == list(CAUSES)
            assert np.array_equal(column, found.events["cause"])
    elif out.suffix == ".npz":
        with np.load(out) as archive:
            assert archive["causes"].dtype == np.uint8
            assert np.array_equal(archive["causes"], found.events["cause"])
    elif out.suffix == ".csv":
        table = np.genfromtxt(out, int, delimiter=",", names=True)
        assert table.dtype.names == ("t", "x", "y", "p", "cause")
        assert np.array_equal(table["cause"], found.events["cause"])
    else:
        assert np.array_equal(np.loadtxt(beside, int), found.events["cause"])
    # all else is as without
    without = read_events(plain)
    assert without.events.dtype == EVENT_DTYPE
    assert all(np.array_equal(without.events[n], found.events[n]) for n in EVENT_DTYPE.names)
    assert "causes" not in without.metadata
    assert not (tmp_path / f"plain_{name}.causes.txt").exists()


def test_text_of_the_events_is_that_without_causes(clip, tmp_path):
    config = load_config([], NOISY, 3)
    convert(clip, tmp_path / "a.txt", config, fps=100, causes=True)
    convert(clip, tmp_path / "b.txt", config, fps=100)
    assert (tmp_path / "a.txt").read_bytes() == (tmp_path / "b.txt").read_bytes()


@pytest.mark.parametrize("count", [0, 1, 1 << 16, (1 << 16) + 7])
@pytest.mark.parametrize("name", ["a.h5", "a.npz", "a.csv", "a.txt"])
def test_events_of_ones_own_are_written_with_their_causes(count, name, tmp_path):
    events = some(count)
    given = events[::-1]
    write_events(tmp_path / name, given, (9, 9))
    found = read_events(tmp_path / name).events
    assert found.dtype == CAUSED_DTYPE
    assert np.array_equal(found, given[np.argsort(given["t"], kind="stable")])


@pytest.mark.parametrize("name", [found.name for found in FORMATS if found.writer])
def test_every_format_keeps_them_with_their_events_where_many_share_a_time(name, tmp_path):
    found = next(found for found in FORMATS if found.name == name)
    path = tmp_path / f"a{found.suffixes[0]}"
    events = some(4000)
    events["t"] //= 10_000  # forty at a time
    events = sort_events(events)
    _, first = np.unique(events[["t", "x", "y"]], return_index=True)
    events = events[np.sort(first)]  # some formats have one event a pixel and time
    chosen = {"layout": name} if found.is_hdf5 else {"format": name}
    with open_sink(path, width=9, height=9, metadata={}, causes=True, **chosen) as sink:
        for part in np.array_split(events, 7):
            sink.write_events(part)
    assert (tmp_path / f"{path.name}.causes.txt").exists() == (not found.causes)
    again = read_events(path).events
    assert np.array_equal(again["t"] - again["t"][0], events["t"] - events["t"][0])
    for field in ("x", "y", "p", "cause"):
        assert np.array_equal(again[field], events[field])


def test_numbers_that_are_no_causes_are_refused(tmp_path):
    with pytest.raises(DataError, match="events: cause: must be whole numbers from 0 to 6"):
        write_events(tmp_path / "a.h5", some(3, 9), (9, 9))
    assert not list(tmp_path.iterdir())


def test_the_command_writes_and_info_counts(clip, tmp_path):
    out = tmp_path / "out.h5"
    sets = [word for key in NOISY for word in ("--set", key)]
    given = ("--fps", 100, "--seed", 3, "-o", out, "--causes")
    assert run("convert", clip, *sets, *given).exit_code == 0
    counts = np.bincount(made(causes=True)["cause"], minlength=len(CAUSES))
    report = json.loads(run("info", out, "--json").stdout)
    assert report["events"]["causes"] == dict(zip(CAUSES, counts.tolist(), strict=True))
    line = f"signal {counts[0]:,}, leak {counts[1]:,}, shot_noise {counts[2]:,}"
    assert f"causes      {line}\n" in run("info", out).stdout
    write_events(tmp_path / "plain.h5", made(), SIZE)
    assert (
        json.loads(run("info", tmp_path / "plain.h5", "--json").stdout)["events"]["causes"] is None
    )
    assert "causes" not in run("info", tmp_path / "plain.h5").stdout


@pytest.mark.parametrize(("name", "other"), [("a.h5", "b.txt"), ("a.txt", "b.h5"), ("a", "b.zip")])
def test_a_file_of_events_is_written_to_another_with_its_causes(name, other, tmp_path):
    events = some(300)
    write_events(tmp_path / name, events[::-1] if name == "a.txt" else events, (9, 9))
    given = ("convert", tmp_path / name, "-o", tmp_path / other, "--crop", "2,1,5,8")
    assert run(*given, "--causes").exit_code == 0
    found = read_events(tmp_path / other)
    whole = read_events(tmp_path / name).events
    kept = whole[(whole["x"] >= 2) & (whole["x"] < 7) & (whole["y"] >= 1)]
    assert np.array_equal(found.events["cause"], kept["cause"])
    assert np.array_equal(found.events["t"], kept["t"])
    assert found.metadata["causes"] == list(CAUSES)
    # not unless it is asked for
    assert run(*given[:3], tmp_path / f"plain_{other}").exit_code == 0
    assert not has_causes(read_events(tmp_path / f"plain_{other}").events)


def test_a_file_of_events_without_causes_has_none_to_write(tmp_path):
    write_events(tmp_path / "a.txt", make_events([1], [2], [3], [1]), (9, 9))
    done = run("convert", tmp_path / "a.txt", "-o", tmp_path / "b.h5", "--causes")
    assert done.exit_code == 1
    assert "a.txt: its events have no causes" in done.output
    assert not (tmp_path / "b.h5").exists()


def test_standard_output_has_no_place_for_them(clip):
    done = run("convert", clip, "--fps", 100, "-o", "-", "--causes")
    assert done.exit_code == 2
    assert "--causes: standard output has no place for them" in done.output


def test_causes_of_other_events_are_not_left_beside(tmp_path):
    path = tmp_path / "a.txt"
    write_events(path, some(5), (9, 9))
    plain = make_events([1], [2], [3], [1])
    with pytest.raises(OutputError, match=r"a\.txt\.causes\.txt: exists, and would be taken for"):
        write_events(path, plain, (9, 9), overwrite=True)
    assert len(read_events(path).events) == 5
    with pytest.raises(OutputError, match="exists"):
        write_events(path, some(6), (9, 9))
    write_events(path, some(6), (9, 9), overwrite=True)
    assert np.array_equal(read_events(path).events["cause"], some(6)["cause"])


def test_an_error_leaves_neither(tmp_path):
    with (
        pytest.raises(RuntimeError),
        open_sink(tmp_path / "a.txt", width=9, height=9, metadata={}, causes=True) as sink,
    ):
        sink.write_events(some(4))
        raise RuntimeError
    assert not list(tmp_path.iterdir())
    with pytest.raises(UsageError), open_sink("-", width=9, height=9, metadata={}, causes=True):
        pass


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"0\n1\n", "fewer causes than events: 2"),
        (b"0\n1\n2\n3\n", "4 causes for 3 events"),
        (b"0\n1\n12\n", r"causes\.txt: must hold a digit on each line"),
        (b"0\n1\n9\n", "causes: must be whole numbers from 0 to 6"),
        (b"0\n1\n\xff\n", "causes: must be whole numbers from 0 to 6"),
        (b"", "fewer causes than events: 0"),
    ],
)
def test_causes_beside_that_do_not_fit(text, message, tmp_path):
    path = tmp_path / "a.txt"
    write_events(path, some(3), (9, 9))
    (tmp_path / "a.txt.causes.txt").write_bytes(text)
    with pytest.raises(DataError, match=message):
        read_events(path)


@pytest.mark.parametrize(
    ("column", "message"),
    [
        (np.array([0, 1], np.uint8), "fewer causes than events: 2"),
        (np.array([0, 1, 7]), "must be whole numbers from 0 to 6"),
        (np.array([0.0, 1, 2]), "must be whole numbers from 0 to 6"),
        (np.array([-1, 1, 2]), "must be whole numbers from 0 to 6"),
        (np.zeros((3, 1), np.uint8), r"events/causes must be a column, not of shape \(3, 1\)"),
    ],
)
def test_columns_that_do_not_fit(column, message, tmp_path):
    path = tmp_path / "a.h5"
    write_events(path, some(3), (9, 9))
    with h5py.File(path, "a") as file:
        del file["events/causes"]
        file["events/causes"] = column
    with pytest.raises(DataError, match=message):
        read_events(path)


def test_other_files_that_do_not_fit(tmp_path):
    csv, npz = tmp_path / "a.csv", tmp_path / "a.npz"
    csv.write_text("t,x,y,p,cause\n1,1,1,1,2\n2,1,1,1,1.5\n")
    with pytest.raises(DataError, match=r"a\.csv: cause: could not convert string '1\.5'"):
        read_events(csv)
    csv.write_text("t,x,y,p,cause\n1,1,1,1,2\n2,1,1,1,7\n")
    with pytest.raises(DataError, match="causes: must be whole numbers from 0 to 6"):
        read_events(csv)
    columns = dict.fromkeys("txyp", np.array([1, 2]))
    np.savez(npz, **columns, causes=np.array([1]))
    with pytest.raises(DataError, match="fewer causes than events: 1"):
        read_events(npz)
    np.savez(npz, **columns, causes=np.array([[1, 2]]))
    with pytest.raises(DataError, match=r"causes must be a column, not of shape \(1, 2\)"):
        read_events(npz)
    # elsewhere, or between other signs, it is a column among others
    for text in ("t;x;y;p;cause\n1;1;1;1;2\n", "cause,t,x,y,p\n2,1,1,1,1\n"):
        csv.write_text(text)
        assert not has_causes(read_events(csv).events)


def test_events_that_no_sensor_has_take_their_causes_along(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("0.1 1 1 1\n0.2 -3 1 1\n0.3 2 2 0\n0.25 3 3 0\n")
    (tmp_path / "a.txt.causes.txt").write_text("1\n2\n3\n4\n")
    assert read_events(path, crop_events=True).events["cause"].tolist() == [1, 4, 3]


def test_they_can_be_drawn(tmp_path):
    render(some(500), tmp_path / "a.png", size=(9, 9))
    assert (tmp_path / "a.png").stat().st_size > 1000


def test_names_are_those_of_the_table():
    assert NAMES.split(",") == list(CAUSES)

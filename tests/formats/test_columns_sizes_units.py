"""What files state, and what their events say of it: columns, units, sizes."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.formats.reading import read_events

COUNT = 400
DRAW = np.random.default_rng(0)
T = np.sort(DRAW.integers(0, 1_000_000, COUNT))
X, Y, P = (DRAW.integers(0, most, COUNT) for most in (240, 180, 2))
X[0], Y[0] = 239, 179
COLUMNS = {"t": T, "x": X, "y": Y, "p": P}


def text(path, order, t=None):
    held = COLUMNS | ({} if t is None else {"t": t})
    rows = zip(*(held[name].tolist() for name in order), strict=True)
    path.write_text("".join(" ".join(map(str, row)) + "\n" for row in rows))
    return path


@pytest.mark.parametrize("order", ["xypt", "xytp", "tpxy", "pxyt", "xtyp"])
@pytest.mark.parametrize("t", [T, T / 1e6])
def test_text_in_another_order_is_read_and_told(order, t, tmp_path):
    recording = read_events(text(tmp_path / "a.txt", order, t))
    assert recording.events.tolist() == list(
        zip(*map(np.ndarray.tolist, (T, X, Y, P)), strict=True)
    )
    names = " ".join({"t": "time", "p": "polarity"}.get(name, name) for name in order)
    assert recording.problems[0].startswith(f"columns are taken as {names}: column ")


def test_columns_that_may_be_two_things_are_refused(tmp_path):
    rows = "".join(f"{x} {x % 2} {x % 3 % 2} {x}\n" for x in range(100))
    (tmp_path / "a.txt").write_text(rows)
    with pytest.raises(DataError, match="98 of 100 polarities are other than -1, 0 and 1: are the"):
        read_events(tmp_path / "a.txt")


def test_what_lies_behind_the_beginning_is_judged_too(tmp_path):
    lines = [f"{t} 3 4 1\n" for t in range(10_000)] + [
        f"{t} 3 4 {t}\n" for t in range(10_000, 12_000)
    ]
    (tmp_path / "a.txt").write_text("".join(lines))
    with pytest.raises(DataError, match="2000 of 12000 polarities"):
        read_events(tmp_path / "a.txt")


def test_other_columns_of_tables_are_refused(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["events"] = np.stack([X, Y, P, T], axis=1)
    with pytest.raises(DataError, match="are the columns t x y p"):
        read_events(tmp_path / "a.h5")
    np.savez(tmp_path / "a.npz", t=X, x=Y, y=T % 500 // 500 + np.arange(COUNT), p=P)
    with pytest.raises(DataError, match=r"times go back \d+ times, and another column never does"):
        read_events(tmp_path / "a.npz")


@pytest.mark.parametrize("hour", [1, 2, 3, 11])
@pytest.mark.parametrize("layout", ["npz", "h5"])
def test_seconds_in_single_precision_stay_seconds(hour, layout, tmp_path):
    t = (3600 * hour + T / 1e5).astype(np.float32)
    path = tmp_path / f"a.{layout}"
    if layout == "npz":
        np.savez(path, t=t, x=X, y=Y, p=P)
    else:
        with h5py.File(path, "w") as file:
            for name, column in (COLUMNS | {"t": t}).items():
                file[f"events/{name}s"] = column
    recording = read_events(path)
    assert np.abs(recording.events["t"] / 1e6 - t).max() < 1e-6
    steps = f"{np.spacing(t[-1]) * 1e6:.3g}"
    assert f"times are of single precision: they have steps of up to {steps} us" in (
        recording.problems
    )


def test_milliseconds_in_single_precision_are_no_seconds(tmp_path):
    for begin in (0, 5_000_000):
        t = ((T + begin) / 1e3).astype(np.float32)
        np.savez(tmp_path / "a.npz", t=t, x=X, y=Y, p=P)
        (told,) = [p for p in read_events(tmp_path / "a.npz").problems if "unit" in p]
        assert "are taken as s" not in told


@pytest.mark.parametrize("name", ["timestamp_ns", "time_ns", "ts_ns"])
def test_names_tell_the_unit(name, tmp_path):
    np.savez(tmp_path / "a.npz", **{name: T * 1000}, x=X, y=Y, p=P)
    recording = read_events(tmp_path / "a.npz")
    assert recording.events["t"].tolist() == T.tolist()
    assert not any("unit" in problem for problem in recording.problems)


@pytest.mark.parametrize(
    ("unit", "scale"), [("nanoseconds", 1000), (b"us", 1), ("Milliseconds", 0)]
)
def test_attributes_tell_the_unit(unit, scale, tmp_path):
    t = T // 1000 if not scale else T * scale
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, column in (COLUMNS | {"t": t}).items():
            file[f"events/{name}s"] = column
        file["events/ts"].attrs["units"] = unit
    recording = read_events(tmp_path / "a.h5")
    assert recording.events["t"].tolist() == (T // 1000 * 1000 if not scale else T).tolist()
    assert not any("unit" in problem for problem in recording.problems)


SIZES = [
    ("sensor_shape", (200, 260)),
    ("sensor_resolution", (200, 260)),
    ("frame_shape", (200, 260, 3)),
    ("resolution", (260, 200)),
    ("sensor_size", (260, 200, 2)),
    ("geometry", "260x200"),
]


@pytest.mark.parametrize(("name", "value"), SIZES)
@pytest.mark.parametrize("where", ["", "events"])
@pytest.mark.parametrize("kind", ["attribute", "dataset"])
def test_sizes_are_taken_under_all_names(name, value, where, kind, tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for key, column in COLUMNS.items():
            file[f"events/{key}s"] = column
        group = file[where or "/"]
        if kind == "attribute":
            group.attrs[name] = value
        else:
            group[name] = value
    recording = read_events(tmp_path / "a.h5", time_unit="us")
    assert (recording.width, recording.height, recording.problems) == (260, 200, [])


@pytest.mark.parametrize(
    "sides", [{"width": 260, "height": 200}, {"sensor_width": 260, "sensor_height": 200}]
)
def test_sides_of_the_sensor(sides, tmp_path):
    np.savez(tmp_path / "a.npz", t_us=T, x=X, y=Y, p=P, **sides)
    assert (read_events(tmp_path / "a.npz").width, sides) == (260, sides)
    np.savez(tmp_path / "a.npz", t_us=T, x=X, y=Y, p=P, sensor_shape=(200, 260))
    recording = read_events(tmp_path / "a.npz")
    assert (recording.width, recording.height, recording.problems) == (260, 200, [])


@pytest.mark.parametrize(
    "comment", ["# size: 260x200", "# width 260\n# height 200", "# Sensor size: 260 x 200"]
)
def test_comments_state_sizes(comment, tmp_path):
    (tmp_path / "a.csv").write_text(f"{comment}\nt_us,x,y,p\n1,2,3,1\n")
    (tmp_path / "a.txt").write_text(f"{comment}\n0.1 2 3 1\n")
    for name in ("a.csv", "a.txt"):
        recording = read_events(tmp_path / name)
        assert (recording.width, recording.height, recording.problems) == (260, 200, [])


def test_a_json_file_of_others_states_the_size_and_no_unit(tmp_path):
    text(tmp_path / "a.txt", "txyp")
    (tmp_path / "a.txt.json").write_text('{"sensor_size": [260, 200]}')
    recording = read_events(tmp_path / "a.txt")
    assert (recording.width, recording.height) == (260, 200)
    assert int(recording.events["t"][-1]) == T[-1]


@pytest.mark.thorough
def test_a_size_that_events_contradict_is_an_error(adv2e, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for key, column in COLUMNS.items():
            file[f"events/{key}s"] = column
        file.attrs["sensor_resolution"] = (240, 180)
    told = adv2e("convert", "a.h5", "-o", "b.npz", "--time-unit", "us")
    assert told.status == 1
    assert "outside 180x240, which sensor_resolution states, of 400" in told.err
    assert "(a sensor of 240x180 holds them)" in told.err
    assert not (tmp_path / "b.npz").exists()
    assert adv2e("info", "a.h5").status == 0
    for command in (
        ("convert", "a.h5", "-o", "b.npz"),
        ("render", "a.h5", "-o", "b.png"),
        ("export", "a.h5", "-o", "b", "--to", "voxel", "--count", "100"),
        ("compare", "a.h5", "a.h5"),
    ):
        assert adv2e(*command).status == 1, command
        told = adv2e(*command, "--crop-events")
        assert told.status == 0, told.err
        assert "outside 180x240, which sensor_resolution states: left out" in told.err


def fine_grained(path, x, y):
    x, y = (np.rint(where * 32).astype(np.int16).view(np.uint16) for where in (x, y))
    np.savez(
        path, x=x, y=y, timestamp=(7_000_000 + T).astype(np.uint32), polarity=P.astype(np.uint8)
    )


def test_coordinates_in_parts_of_a_pixel_are_those_of_bs_ergb(tmp_path):
    x, y = DRAW.uniform(-0.4, 969.4, COUNT), DRAW.uniform(0, 624.4, COUNT)
    fine_grained(tmp_path / "a.npz", x, y)
    recording = read_events(tmp_path / "a.npz", size=(970, 625))
    assert recording.events["x"].tolist() == np.rint(np.rint(x * 32) / 32).astype(int).tolist()
    assert recording.events["y"].tolist() == np.rint(np.rint(y * 32) / 32).astype(int).tolist()
    assert recording.events["t"].tolist() == (7_000_000 + T).tolist()
    assert recording.problems == [
        "coordinates are in 1/32 of a pixel, as in BS-ERGB: rounded to pixels"
    ]


def test_such_names_alone_make_no_parts_of_a_pixel(tmp_path):
    np.savez(
        tmp_path / "a.npz", x=X.astype(np.uint16), y=Y.astype(np.uint16), timestamp=T, polarity=P
    )
    assert read_events(tmp_path / "a.npz").width == 240

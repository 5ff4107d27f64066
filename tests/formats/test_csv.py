import tempfile
from pathlib import Path

import numpy as np
import pytest
from damage import damages, read_or_refused
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.errors import DataError
from adv2e.events import make_events
from adv2e.formats.reading import read_events
from adv2e.formats.writing import write_events

CORNERS = make_events(
    [0, 0, 999, 1000, 2**24 + 1, 2**32 + 1, 1_468_941_032_229_165],
    [0, 345, 0, 345, 7, 10, 100], [0, 0, 259, 259, 3, 99, 100], [1, 0, 0, 1, 1, 0, 1],
)  # fmt: skip


@pytest.fixture
def read(tmp_path):
    def from_text(text, **options):
        (tmp_path / "a.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_events(tmp_path / "a.csv", **options)

    return from_text


def rows(recording):
    return recording.events.tolist()


@pytest.mark.parametrize("count", [0, 1, 7])
def test_lines_as_pandas_takes_them(tmp_path, count):
    pandas = pytest.importorskip("pandas")
    write_events(tmp_path / "a.csv", CORNERS[:count], (346, 260))

    table = pandas.read_csv(tmp_path / "a.csv")

    assert list(table.columns) == ["t", "x", "y", "p"]
    assert list(table.itertuples(index=False, name=None)) == CORNERS[:count].tolist()


@pytest.mark.parametrize("count", [1, 7])
def test_lines_as_faery_takes_them(tmp_path, count):
    faery = pytest.importorskip("faery")
    write_events(tmp_path / "a.csv", CORNERS[:count], (346, 260))

    stream = faery.events_stream_from_file(tmp_path / "a.csv", dimensions_fallback=(346, 260))

    assert stream.to_array().tolist() == CORNERS[:count].tolist()


@pytest.mark.parametrize("t", [-1, -999, -1000, -12_345_678])
def test_times_below_zero(tmp_path, t):
    write_events(tmp_path / "a.csv", make_events([t, 1], [0, 1], [0, 1], [1, 0]), (2, 2))

    assert (tmp_path / "a.csv").read_text() == f"t,x,y,p\n{t},0,0,1\n1,1,1,0\n"
    recording = read_events(tmp_path / "a.csv")
    assert (recording.layout, recording.events["t"].tolist()) == ("csv", [t, 1])


def test_without_the_description_beside_it_the_unit_is_a_guess(tmp_path):
    write_events(tmp_path / "a.csv", CORNERS[:2], (346, 260))
    assert read_events(tmp_path / "a.csv", time_unit="s").events["t"].tolist() == [0, 0]
    (tmp_path / "a.csv.json").unlink()

    assert "no unit is stated" in read_events(tmp_path / "a.csv").problems[0]


@pytest.mark.parametrize(
    "text",
    [
        "x,y,polarity,t_us\n3,2,1,1000\n4,5,0,2000\n",
        "t_ns;x;y;p\n1000000;3;2;1\n2000000;4;5;-1\n",
        "index,t_s,x,cause,y,p\n0,0.001,3,7,2,1\n1,2e-3,4,-,5,0\n",
        "\ufeff# made by hand\n# T_MS\tXs\tYs\tPol\r\n1\t3\t2\t1\r\n\r\n2\t4\t5\t0",
        '"t_us","x","y","p"\n1000,3,2,True\n2000,4,5,False\n',
    ],
)
def test_columns_are_found_by_their_names(read, text):
    assert rows(read(text)) == [(1000, 3, 2, 1), (2000, 4, 5, 0)]


def test_the_unit_that_the_user_says(read):
    assert rows(read("t,x,y,p\n0.5,1,1,1\n", time_unit="ms")) == [(500, 1, 1, 1)]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "must begin with a line that names the columns"),
        ("0.1,1,1,1\n", "must begin with a line that names the columns"),
        ("3,2,1,1000\n4,5,0,2000\n", "files of Metavision need x,y,p,t_us"),
        ("t,x,y,q\n", r"no column for polarity \(p, ps, pol, polarity, on\); it has t, x, y, q"),
        ("t,x,y,p\n1,2,3,1\n1,2,,1\n", "line 3: must be the 4 numbers that the heading names"),
        ("t,x,y,p\n1,2,3,1\n1,2,3,1,5\n", r"line 3: .* got '1,2,3,1,5'"),
        ("t_us,x,y,p\n1,2,3,yes\n", r"a\.csv line 2"),
        ("#\n\nt_us,x,y,p\n1e30,2,3,1\n", r"a\.csv line 4"),
    ],
)
def test_what_is_wrong_is_named(read, text, message):
    with pytest.raises(DataError, match=message):
        read(text)


@pytest.mark.parametrize("end", ["", "\n"])
@pytest.mark.parametrize(
    "text",
    [
        "%geometry:640,480\n3,2,1,1000\n4,5,0,2000",
        "%geometry:640,480\r\n3,2,1,1000\r\n4,5,0,2000",
        "%geometry:640,480\nx,y,p,t\n3,2,1,1000\n4,5,0,2000",
        "t,x@640,y@480,on\r\n1000,3,2,1\r\n2000,4,5,0",
        "t;x@640;y@480;on\n1000;3;2;1\n2000;4;5;0",
    ],
)
def test_forms_of_metavision_and_faery_state_columns_and_size(read, text, end):
    recording = read(text + end)
    assert rows(recording) == [(1000, 3, 2, 1), (2000, 4, 5, 0)]
    assert (recording.width, recording.height) == (640, 480)
    assert recording.problems == []


def test_a_file_of_metavision_without_events(read):
    assert read("%geometry:640,480\n").problems == ["no events"]
    with pytest.raises(DataError, match="must begin with a line that names the columns"):
        read("%geometry:640,480\nsome text\n")


def test_faery_writes_what_is_read(tmp_path):
    faery = pytest.importorskip("faery")
    events = np.zeros(300, faery.EVENTS_DTYPE)
    events["t"] = 1468941032229165 + np.arange(300) * 7
    events["x"], events["y"], events["on"] = (
        np.arange(300),
        np.arange(300) % 200,
        np.arange(300) % 2,
    )
    faery.events_stream_from_array(events, (640, 480)).to_file(tmp_path / "a.csv")

    recording = read_events(tmp_path / "a.csv")

    assert recording.events.tolist() == [tuple(event) for event in events.tolist()]
    assert (recording.width, recording.height, recording.problems) == (640, 480, [])


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    path = tmp_path_factory.mktemp("good") / "a.csv"
    write_events(path, CORNERS, (346, 260))
    return path.read_bytes()


@settings(max_examples=200, deadline=None)
@given(data=st.data())
@pytest.mark.thorough
def test_damaged_lines(good, data):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a.csv")
        path.write_bytes(data.draw(damages(good)))
        read_or_refused(path, 12)


def test_the_line_that_is_wrong_behind_many(read):
    lines = ["t_us,x,y,p", *(f"{n},{n % 300},7,1" for n in range(60_000))]
    recording = read("\n".join(lines))
    assert recording.events["t"].tolist() == list(range(60_000))

    lines[50_000] = "1,2,3"
    with pytest.raises(DataError, match="line 50001: must be the 4 numbers"):
        read("\n".join(lines))


def test_many_lines_are_formatted_as_numpy_does(tmp_path):
    draw = np.random.default_rng(0)
    most = 10 ** draw.integers(0, 16, 70_000)
    t = np.sort(draw.integers(-most, most))
    events = make_events(t, *draw.integers(0, 65536, (2, 70_000)), draw.integers(0, 2, 70_000))
    write_events(tmp_path / "a.csv", events, (65536, 65536))

    lines = (tmp_path / "a.csv").read_text().splitlines()[1:]

    assert lines == [f"{t},{x},{y},{p}" for t, x, y, p in events.tolist()]


@pytest.mark.parametrize("order", ["xypt", "txyp", "xytp", "ptxy"])
def test_columns_without_a_heading_that_tell_what_they_are_are_read_and_told(tmp_path, order):
    rng = np.random.default_rng(3)
    columns = {
        "t": np.sort(rng.integers(0, 10**6, 400)),
        "x": rng.integers(0, 64, 400),
        "y": rng.integers(0, 48, 400),
        "p": rng.integers(0, 2, 400),
    }
    path = tmp_path / "events.csv"
    rows = zip(*(columns[name].tolist() for name in order), strict=True)
    path.write_text("".join(f"{','.join(map(str, row))}\n" for row in rows))
    recording = read_events(path)
    for name, column in columns.items():
        np.testing.assert_array_equal(recording.events[name], column)
    (told,) = [line for line in recording.problems if "names the columns" in line]
    assert ",".join(order) in told
    path.write_text("t,x,y,p\n" + path.read_text() if order == "txyp" else "1,2,3,4\n" * 40)
    if order == "txyp":
        assert not [one for one in read_events(path).problems if "names the columns" in one]
    else:
        with pytest.raises(DataError, match="must begin with a line that names the columns"):
            read_events(path)

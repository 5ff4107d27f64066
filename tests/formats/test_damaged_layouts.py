"""Whatever the datasets of a layout of HDF5 hold: it is read, or a DataError."""

import tempfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.errors import DataError
from adv2e.events import make_events
from adv2e.formats.reading import read_events
from adv2e.formats.registry import layouts
from adv2e.formats.writing import open_sink

pytestmark = pytest.mark.thorough

TYPES = ["u1", "i1", "u2", "i8", "u8", "f2", "f8", "S3", "?", ">i4", "c8"]


def datasets_of(path):
    names = []
    with h5py.File(path) as file:
        file.visititems(lambda name, found: names.append(name) if hasattr(found, "shape") else None)
    return names


@pytest.fixture(scope="module", params=[*layouts(), "prophesee"])
def whole(request, tmp_path_factory):
    path = tmp_path_factory.mktemp(request.param) / "a.h5"
    events = make_events(np.arange(60) * 700, np.arange(60) % 16, np.arange(60) % 12, [1, 0] * 30)
    if request.param == "prophesee":
        with h5py.File(path, "w") as file:
            file["CD/events"] = events
            file.attrs["geometry"] = "16x12"
        return path
    with open_sink(
        path, width=16, height=12, metadata={}, layout=request.param, with_frames=True
    ) as sink:
        for n in range(3):
            sink.write_frame(20_000_000 * n, np.full((12, 16), n, np.uint8))
        sink.write_events(events)
    return path


def read_or_refuse(path):
    try:
        recording = read_events(path)
        list(recording.frames())
    except DataError as error:
        assert "\n" not in str(error)
    else:
        assert (recording.events["x"] < recording.width).all()


@settings(max_examples=100, deadline=None)
@given(data=st.data())
def test_one_dataset_is_another(whole, data):
    name = data.draw(st.sampled_from(datasets_of(whole)))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a.h5")
        path.write_bytes(whole.read_bytes())
        with h5py.File(path, "r+") as file:
            shape = file[name].shape
            shapes = [shape, (), (0,), (1,), shape[:1], (*shape, 2), (*shape, 1), (60,), (60, 4)]
            values = np.zeros(data.draw(st.sampled_from(shapes)), data.draw(st.sampled_from(TYPES)))
            if values.dtype.kind in "iuf":
                odd = [0, 1, 3, -1, 2**40, 2**62, np.inf, np.nan]
                with np.errstate(all="ignore"):
                    kept = np.array(data.draw(st.sampled_from(odd)), np.float64)
                    values[...] = kept.astype(values.dtype)
            del file[name]
            file[name] = values
        read_or_refuse(path)


@settings(max_examples=50, deadline=None)
@given(data=st.data())
def test_a_part_of_the_file_is_missing(whole, data):
    content = whole.read_bytes()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a.h5")
        path.write_bytes(content[: data.draw(st.integers(0, len(content) - 1))])
        read_or_refuse(path)

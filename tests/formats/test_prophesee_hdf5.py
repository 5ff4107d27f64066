"""HDF5 of Prophesee's tools: what h5py can read is read, what it cannot is refused."""

import h5py
import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.formats.reading import read_events

RECORD = np.dtype(
    {"names": ["x", "y", "p", "t"], "formats": ["u2", "u2", "i2", "i8"], "offsets": [0, 2, 4, 8]}
)


def records():
    events = np.zeros(3, RECORD)
    events["x"], events["y"] = [0, 1279, 5], [719, 0, 5]
    events["p"], events["t"] = [1, 0, 1], [3, 2**33, 2**33 + 1]
    return events


def test_without_the_codec_it_is_read(tmp_path):
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file.create_dataset("CD/events", data=records(), compression="gzip", chunks=True)
        file.attrs["geometry"] = "1280x720"
    recording = read_events(tmp_path / "a.hdf5")
    for name in "txyp":
        assert recording.events[name].tolist() == records()[name].tolist()
    assert (recording.layout, recording.width, recording.height) == ("prophesee", 1280, 720)
    assert recording.problems == []


def test_the_codec_is_named_with_what_helps(tmp_path):
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        made = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        made.set_chunk((16,))
        made.set_filter(0x8ECF, h5py.h5z.FLAG_OPTIONAL, ())
        group = file.create_group("CD")
        space = h5py.h5s.create_simple((3,), (h5py.h5s.UNLIMITED,))
        kind = h5py.h5t.py_create(RECORD)
        h5py.h5d.create(group.id, b"events", kind, space, made)
    with pytest.raises(
        DataError, match=r"a\.hdf5: CD/events: .*ECF \(filter 36559\).*metavision_file_to_dat -i"
    ) as caught:
        read_events(tmp_path / "a.hdf5")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("values", [np.zeros(3), np.zeros(3, [("x", "f8"), ("t", "i8")])])
def test_other_records_are_refused(tmp_path, values):
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file["CD/events"] = values
    with pytest.raises(DataError, match="CD/events must be records of the whole numbers x, y, p"):
        read_events(tmp_path / "a.hdf5")

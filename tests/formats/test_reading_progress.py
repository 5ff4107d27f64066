"""How far the reading is, as a caller is told."""

import zipfile

import h5py
import numpy as np
import pytest

from adv2e.formats import hdf5, npz, text
from adv2e.formats.reading import read_events

LINES = "".join(f"{0.001 * k:.9f} {k % 8} {k % 6} {k % 2}\n" for k in range(1000))


@pytest.fixture
def path(request, tmp_path):
    """A file of a thousand events."""
    path = tmp_path / request.param
    columns = np.loadtxt(LINES.splitlines()).T
    if request.param == "a.txt":
        path.write_text(LINES)
    elif request.param == "folder":
        path.mkdir()
        (path / "events.txt").write_text(LINES)
    elif request.param == "a.zip":
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("recording/events.txt", LINES)
    elif request.param == "a.npz":
        np.savez(path, **dict(zip(("t_s", "x", "y", "p"), columns, strict=True)))
    else:
        with h5py.File(path, "w") as file:
            for name, column in zip(("ts", "xs", "ys", "ps"), columns, strict=True):
                file[f"events/{name}"] = column if name == "ts" else column.astype(int)
    return path


@pytest.mark.parametrize("path", ["a.txt", "folder", "a.zip", "a.npz", "a.h5"], indirect=True)
def test_it_grows_to_the_whole_and_changes_nothing(path, monkeypatch):
    expected = read_events(path)
    monkeypatch.setattr(text, "_BLOCK", 1 << 12)
    monkeypatch.setattr(hdf5, "PART", 100)
    monkeypatch.setattr(npz, "_PART", 100)
    told = []
    found = read_events(path, progress=lambda done, total: told.append((done, total)))
    assert np.array_equal(found.events, expected.events)
    parts, totals = zip(*told, strict=True)
    assert len(parts) > 3
    assert list(parts) == sorted(set(parts))
    assert set(totals) == {parts[-1]}

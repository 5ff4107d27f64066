"""The other tools of scripts/benchmarks/speed.py, by stand-ins."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from benchmarks import settings, speed

SCRIPTS = Path(__file__).resolve().parents[3] / "scripts"


@pytest.fixture
def stand_in(monkeypatch):
    """Put a module with these attributes in place of another."""

    def put(name, **attributes):
        made = ModuleType(name)
        vars(made).update(attributes)
        monkeypatch.setitem(sys.modules, name, made)

    return put


@pytest.fixture
def tool(monkeypatch):
    """Import a tool's module anew, over the stand-ins, and forget it afterwards."""

    def load(name):
        monkeypatch.delitem(sys.modules, f"benchmarks.tools.{name}", raising=False)
        found = importlib.import_module(f"benchmarks.tools.{name}")
        del sys.modules[f"benchmarks.tools.{name}"]  # not by monkeypatch, which would bring it back
        return found

    return load


def test_v2e_rows_are_time_column_row_sign(stand_in, tool, tmp_path):
    class Emulator:
        def __init__(self, **given):
            assert given["pos_thres"] == 0.2
            assert given["device"] == "cpu"

        def generate_events(self, frame, t_s):
            assert frame.dtype == np.float32
            return np.array([[t_s, 3, 1, -1], [t_s, 2, 0, 1]]) if t_s else None

    stand_in("torch", set_num_threads=lambda count: None, __version__="0")
    stand_in("v2ecore")
    stand_in("v2ecore.emulator", EventEmulator=Emulator)
    v2e = tool("v2e")
    given = {"folder": str(tmp_path), "threads": 1, "arguments": {"pos_thres": 0.2}}
    events = v2e.simulator(given)(np.zeros((2, 4, 5), np.uint8), 100.0)
    assert [list(column) for column in v2e.columns(events)] == [
        [10_000, 10_000],
        [3, 2],
        [1, 0],
        [0, 1],
    ]


# The parameters of v2e's EventEmulator (SensorsINI/v2e, v2ecore/emulator.py); as there, the first
# frame makes no events, and a frame without events makes None.
V2E = """
import numpy as np

class EventEmulator:
    def __init__(
        self, pos_thres=0.2, neg_thres=0.2, sigma_thres=0.03, cutoff_hz=0.0, leak_rate_hz=0.1,
        refractory_period_s=0.0, shot_noise_rate_hz=0.0, photoreceptor_noise=False,
        leak_jitter_fraction=0.1, noise_rate_cov_decades=0.1, seed=0, output_folder=None,
        dvs_h5=None, dvs_aedat2=None, dvs_aedat4=None, dvs_text=None, show_dvs_model_state=None,
        save_dvs_model_state=False, output_width=None, output_height=None, device="cuda",
        cs_lambda_pixels=None, cs_tau_p_ms=None, hdr=False, scidvs=False,
        record_single_pixel_states=None, label_signal_noise=False,
    ):
        assert device == "cpu" and seed != 0 and sigma_thres > 0
        self.levels, self.before = (pos_thres, neg_thres), None

    def generate_events(self, new_frame, t_frame):
        assert new_frame.dtype == np.float32
        log = np.log(np.maximum(new_frame, 1))
        change, self.before = log - (log if self.before is None else self.before), log
        y, x = np.nonzero((change > self.levels[0]) | (change < -self.levels[1]))
        if not len(x):
            return None
        sign = np.sign(change[y, x])
        return np.stack([np.full(len(x), t_frame, np.float32), x, y, sign], axis=1)
"""


@pytest.fixture
def v2e_folder(tmp_path, monkeypatch):
    """A folder laid out as a checkout of v2e, which is forgotten afterwards."""
    package = tmp_path / "v2e" / "v2ecore"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "emulator.py").write_text(V2E)
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield package.parent
    for name in ("v2ecore", "v2ecore.emulator"):
        sys.modules.pop(name, None)


def test_v2e_is_taken_from_the_folder_named(stand_in, tool, v2e_folder, small):
    peers = speed.find_peers(sys.executable, v2e_folder, [])
    assert peers.v2e == v2e_folder
    stand_in("torch", set_num_threads=lambda count: None, __version__="0")
    runs = [given for given in settings.peer_arguments(peers, 1) if given[1] == "v2e"]
    assert [name for name, _, _ in runs] == ["v2e, noise off", "v2e, all effects"]
    v2e = tool("v2e")
    frames = np.load(small)
    for _, _, options in runs:
        t, x, y, p = v2e.columns(v2e.simulator(options)(frames, 240.0))
        assert t.size > 100
        assert np.isin(t, np.rint(np.arange(1, 25) / 240 * 1e6)).all()
        assert x.max() > 23 >= y.max()  # columns first: there are more
        assert set(p) == {0, 1}


def test_v2e_that_makes_no_events_leaves_empty_columns(tool, stand_in, v2e_folder):
    stand_in("torch", set_num_threads=lambda count: None, __version__="0")
    v2e = tool("v2e")
    still = np.full((5, 4, 6), 90, np.uint8)
    options = {"folder": str(v2e_folder), "threads": None, "arguments": {}}
    assert [column.size for column in v2e.columns(v2e.simulator(options)(still, 240.0))] == [0] * 4


def test_eventcv_columns_are_taken_by_name(stand_in, tool):
    table = np.array([[7, 5, 1000, 1], [6, 4, 2000, 0]], np.uint64)
    stream = SimpleNamespace(
        numpy=lambda: table, columns=("x", "y", "t", "p"), timestamp_scale_ms=0.001
    )
    stand_in("eventcv", simulate=lambda frames, fps, cutoff_hz: stream)
    eventcv = tool("eventcv")
    events = eventcv.simulator({"arguments": {"cutoff_hz": 300.0}})(np.zeros((2, 8, 8)), 240.0)
    assert [list(column) for column in eventcv.columns(events)] == [
        [1000, 2000],
        [7, 6],
        [5, 4],
        [1, 0],
    ]


def test_missing_tools_are_noted():
    notes = []
    peers = speed.find_peers(sys.executable, None, notes)
    for name in ("eventcv", "evlib"):
        if importlib.util.find_spec(name) is None:
            assert name not in peers.tools
            assert any(note.startswith(f"{name} took no part: ModuleNotFound") for note in notes)
    assert peers.v2e is None
    peers = speed.find_peers(sys.executable, SCRIPTS, notes)
    assert peers.v2e is None
    assert any(note.startswith("v2e took no part") for note in notes)

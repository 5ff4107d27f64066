from __future__ import annotations

import numpy as np
import pytest

from adv2e.comparison import resimulation
from adv2e.config import from_dict
from adv2e.errors import DataError
from adv2e.events import make_events
from adv2e.sources.frame import Frame


@pytest.fixture
def calls(monkeypatch):
    """What the simulation was given; it yields two chunks."""
    given = []

    def events_from_light(light, config, *, threads=None):
        given.append((list(light), config, threads))
        yield make_events([1, 2], [0, 0], [0, 0], [1, 1])
        yield make_events([3], [0], [0], [0])

    monkeypatch.setattr(resimulation, "events_from_light", events_from_light)
    return given


def frames():
    for n, dn in enumerate((51, 255)):
        yield Frame(np.full((2, 3), dn, np.uint8), t_ns=1_468_941_032_229_165_300 + n)


def test_frames_are_simulated_anew_for_each_seed(calls):
    simulate_events = resimulation.resimulator(frames, from_dict({}), "linear", (3, 2), threads=2)
    for seed in (3, 4):
        assert simulate_events(seed)["t"].tolist() == [1, 2, 3]
    assert [config.seed for _, config, _ in calls] == [3, 4]
    for light, _, threads in calls:
        assert [t_ns for t_ns, _ in light] == [1_468_941_032_229_165_300, 1_468_941_032_229_165_301]
        assert [image[0, 0] for _, image in light] == [51, 255]
        assert threads == 2


def test_auto_is_what_the_frames_are(calls):
    resimulation.resimulator(frames, from_dict({}), "gamma:2", (3, 2))(0)
    ((light, _, _),) = calls
    assert light[0][1][0, 0] == pytest.approx(255 / 25)


def test_a_configured_encoding_and_full_scale_win(calls):
    config = from_dict({"frames": {"encoding": "linear", "full_scale": 510}})
    resimulation.resimulator(frames, config, "srgb", (3, 2))(0)
    ((light, _, _),) = calls
    assert light[1][1][0, 0] == pytest.approx(127.5)


def test_frames_come_to_the_sensor_of_the_events(calls):
    config = from_dict({"sensor": {"width": 1, "height": 1, "fit": "stretch"}})
    resimulation.resimulator(frames, config, "linear", (1, 1))(0)
    ((light, _, _),) = calls
    assert [image.tolist() for _, image in light] == [[[51.0]], [[255.0]]]


def test_frames_of_another_size_than_the_events_are_refused(calls):
    for sensor, size in ((None, "3x2"), ({"width": 2, "height": 2}, "2x2")):
        simulate_events = resimulation.resimulator(
            frames, from_dict({"sensor": sensor}), "linear", (6, 4)
        )
        with pytest.raises(DataError, match=f"{size} pixels, but the events are of 6x4"):
            simulate_events(0)

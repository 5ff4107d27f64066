"""Libraries that others wrote, which read event files: what they get of one, as four columns."""

import numpy as np
import pytest

from adv2e.events import make_events


def faery(path):
    """Events as faery gets them, which also needs the geometry in the file."""
    stream = pytest.importorskip("faery").events_stream_from_file(path)
    events = stream.to_array()
    return stream.dimensions(), make_events(events["t"], events["x"], events["y"], events["p"])


def eventcv(path):
    """Events as EventCV's loader gets them."""
    stream = pytest.importorskip("eventcv").load(str(path))
    x, y, t, p = np.asarray(stream.numpy(), np.int64).reshape(-1, 4).T
    return tuple(stream.sensor_size), make_events(t, x, y, p)


def expelliarmus(encoding):
    """Return what reads events as expelliarmus gets them, which does not look at the geometry."""

    def read(path):
        wizard = pytest.importorskip("expelliarmus").Wizard(encoding=encoding)
        events = wizard.read(path)
        if events is None:  # there is none
            events = np.zeros(0, [(name, "i8") for name in "txyp"])
        return None, make_events(events["t"], events["x"], events["y"], events["p"])

    return read

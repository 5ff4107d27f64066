"""Libraries that others wrote, which read event files: what they get of one, as four columns."""

import numpy as np
import pytest

from adv2e.events import make_events, sort_events


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


def evlib(path):
    """Events as evlib gets them, sorted: it leaves those of one time in no certain order."""
    table = pytest.importorskip("evlib").load_events(str(path)).collect()
    t = table["t"].dt.total_microseconds().to_numpy()
    x, y, p = (table[name].to_numpy() for name in ("x", "y", "polarity"))
    return None, sort_events(make_events(t, x, y, p))


def expelliarmus(encoding):
    """Return what reads events as expelliarmus gets them, which does not look at the geometry."""

    def read(path):
        wizard = pytest.importorskip("expelliarmus").Wizard(encoding=encoding)
        events = wizard.read(path)
        if events is None:  # there is none
            events = np.zeros(0, [(name, "i8") for name in "txyp"])
        return None, make_events(events["t"], events["x"], events["y"], events["p"])

    return read


def event_stream(path):
    """Events as event_stream gets them; it leaves the rows as they are: from the bottom."""
    with pytest.importorskip("event_stream").Decoder(path) as decoder:
        size = decoder.width, decoder.height
        parts = list(decoder)
    names = zip("txyp", ("t", "x", "y", "on"), strict=True)
    columns = {ours: np.concatenate([np.zeros(0, "i8"), *(part[name] for part in parts)])
               for ours, name in names}  # fmt: skip
    columns["y"] = size[1] - 1 - columns["y"]
    return size, make_events(**columns)

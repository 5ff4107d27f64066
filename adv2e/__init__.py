"""Turn video into the events of an event camera (DVS), and compare them with real recordings.

============  ====================================================================================
simulate      frames in memory -> events, chunk by chunk
Camera        one frame after the other, of a simulator or live -> the events between them
convert       video, folder of images or recording -> a file of events
load_config   a configuration from files, names, mappings and single keys; its type is Config
read_events   a file of events -> Recording (events, sensor size, frames if there are any)
write_events  events -> a file
voxel_grid    events -> (bins, rows, columns), as networks take them
render        events -> pictures and films
view          events -> a page on which to play them in a browser
export        events -> training sets and voxel grids in a folder
batch         every sequence below a folder -> the same tree of events
compare       two recordings -> how far one is from the other
info          any input -> what it holds
sensor        configurations -> thresholds, latency, noise and bandwidth that their pixels have
diagnose      a real recording -> the effect that its simulation lacks
Recording     events, sensor size and frames: what read_events returns
EVENT_DTYPE   the record of an event: t [us], x, y, p (1 ON, 0 OFF)
============  ====================================================================================

What users can mend is an Adv2eError: ConfigError, DataError, OutputError, UsageError or
MissingExtraError.  What they may look at is an Adv2eWarning.

The method is that of Jiang, Zhou, Lin: "ADV2E: Bridging the Gap Between Analogue Circuit and
Discrete Frames in the Video-to-Events Simulator".

Examples
--------
>>> import numpy as np
>>> import adv2e
>>> frames = [np.full((180, 240), light, np.float32) for light in (0.1, 0.2, 0.4, 0.8)]
>>> events = np.concatenate(list(adv2e.simulate(frames, 100)))  # 100 frames a second
>>> events.dtype == adv2e.EVENT_DTYPE
True
>>> adv2e.voxel_grid(events, 5, (240, 180)).shape
(5, 180, 240)
"""

from __future__ import annotations

__version__ = "0.1.0"

__all__ = [
    "EVENT_DTYPE",
    "Adv2eError",
    "Adv2eWarning",
    "Camera",
    "Config",
    "ConfigError",
    "DataError",
    "MissingExtraError",
    "OutputError",
    "Recording",
    "UsageError",
    "__version__",
    "batch",
    "compare",
    "convert",
    "diagnose",
    "export",
    "info",
    "load_config",
    "read_events",
    "render",
    "sensor",
    "simulate",
    "view",
    "voxel_grid",
    "write_events",
]

TYPE_CHECKING = False  # as in `typing`, which takes longer to import than all else here
if TYPE_CHECKING:
    from adv2e.batches.run import batch
    from adv2e.comparison.compare import compare
    from adv2e.config import Config, load_config
    from adv2e.conversion.camera import Camera
    from adv2e.conversion.convert import convert
    from adv2e.conversion.simulation import simulate
    from adv2e.diagnosis.recordings import diagnose
    from adv2e.errors import (
        Adv2eError,
        Adv2eWarning,
        ConfigError,
        DataError,
        MissingExtraError,
        OutputError,
        UsageError,
    )
    from adv2e.events import EVENT_DTYPE
    from adv2e.exporting.export import export
    from adv2e.formats.reading import read_events
    from adv2e.formats.recording import Recording
    from adv2e.formats.writing import write_events
    from adv2e.inspection.inspect import info
    from adv2e.inspection.sensor import sensor
    from adv2e.rendering.render import render
    from adv2e.rendering.view import view
    from adv2e.representations.voxel_grid import voxel_grid

_HOMES = {
    "EVENT_DTYPE": "adv2e.events",
    "Adv2eError": "adv2e.errors",
    "Adv2eWarning": "adv2e.errors",
    "Camera": "adv2e.conversion.camera",
    "Config": "adv2e.config",
    "ConfigError": "adv2e.errors",
    "DataError": "adv2e.errors",
    "MissingExtraError": "adv2e.errors",
    "OutputError": "adv2e.errors",
    "Recording": "adv2e.formats.recording",
    "UsageError": "adv2e.errors",
    "batch": "adv2e.batches.run",
    "compare": "adv2e.comparison.compare",
    "convert": "adv2e.conversion.convert",
    "diagnose": "adv2e.diagnosis.recordings",
    "export": "adv2e.exporting.export",
    "info": "adv2e.inspection.inspect",
    "load_config": "adv2e.config",
    "read_events": "adv2e.formats.reading",
    "render": "adv2e.rendering.render",
    "sensor": "adv2e.inspection.sensor",
    "simulate": "adv2e.conversion.simulation",
    "view": "adv2e.rendering.view",
    "voxel_grid": "adv2e.representations.voxel_grid",
    "write_events": "adv2e.formats.writing",
}


def __getattr__(name: str) -> object:
    """Import the public names on first use, so that ``adv2e --help`` stays instant."""
    if name not in _HOMES:
        raise AttributeError(f"module 'adv2e' has no attribute {name!r}")
    from importlib import import_module  # noqa: PLC0415
    from inspect import isfunction  # noqa: PLC0415

    from adv2e.in_python import reworded  # noqa: PLC0415
    from adv2e.options import show_options  # noqa: PLC0415

    found = getattr(import_module(_HOMES[name]), name)
    globals()[name] = found = show_options(reworded(found)) if isfunction(found) else found
    return found


def __dir__() -> list[str]:
    return __all__

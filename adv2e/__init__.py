"""Video or image sequences in, event-camera (DVS) events out.

The package simulates the pixel of a dynamic vision sensor: frames are interpolated, taken to the
logarithm, passed through a first-order low-pass whose corner follows the brightness, and compared
with thresholds, with noise (Jiang, Zhou, Lin: "ADV2E: Bridging the Gap Between Analogue Circuit
and Discrete Frames in the Video-to-Events Simulator").
"""

from __future__ import annotations

__version__ = "0.1.0"

__all__ = [
    "EVENT_DTYPE",
    "Config",
    "__version__",
    "load_config",
    "read_events",
    "simulate",
    "write_events",
]

TYPE_CHECKING = False  # as in `typing`, which takes longer to import than all else here
if TYPE_CHECKING:
    from adv2e.config import Config, load_config
    from adv2e.conversion.simulation import simulate
    from adv2e.events import EVENT_DTYPE
    from adv2e.formats.reading import read_events
    from adv2e.formats.writing import write_events

_HOMES = {
    "EVENT_DTYPE": "adv2e.events",
    "Config": "adv2e.config",
    "load_config": "adv2e.config",
    "read_events": "adv2e.formats.reading",
    "simulate": "adv2e.conversion.simulation",
    "write_events": "adv2e.formats.writing",
}


def __getattr__(name: str) -> object:
    """Import the public names on first use, so that ``adv2e --help`` stays instant."""
    if name not in _HOMES:
        raise AttributeError(f"module 'adv2e' has no attribute {name!r}")
    from importlib import import_module  # noqa: PLC0415

    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__

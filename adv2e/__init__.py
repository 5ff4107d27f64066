"""Video or image sequences in, event-camera (DVS) events out.

The package simulates the pixel of a dynamic vision sensor: frames are interpolated, taken to the
logarithm, passed through a first-order low-pass whose corner follows the brightness, and compared
with thresholds, with noise (Jiang, Zhou, Lin: "ADV2E: Bridging the Gap Between Analogue Circuit
and Discrete Frames in the Video-to-Events Simulator").
"""

from __future__ import annotations

__version__ = "0.1.0"

__all__ = ["Config", "__version__", "load_config", "simulate"]

TYPE_CHECKING = False  # as in `typing`, which takes longer to import than all else here
if TYPE_CHECKING:
    from adv2e.config import Config, load_config
    from adv2e.conversion.simulation import simulate


def __getattr__(name: str) -> object:
    """Import the public names on first use, so that ``adv2e --help`` stays instant."""
    if name in ("Config", "load_config"):
        from adv2e import config  # noqa: PLC0415

        return getattr(config, name)
    if name == "simulate":
        from adv2e.conversion.simulation import simulate  # noqa: PLC0415

        return simulate
    raise AttributeError(f"module 'adv2e' has no attribute {name!r}")

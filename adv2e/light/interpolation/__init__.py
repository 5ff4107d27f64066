"""In-between frames, so that no pixel jumps too far between samples.

Each input interval is cut into L equal parts; the frame at l/L of it is made from the light of the
two frames around it, linear in time for every pixel (:mod:`.linear`) or along the motion
(:mod:`.flow`).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol

from numpy.typing import NDArray

from adv2e.errors import ConfigError
from adv2e.light.interpolation.linear import LinearUpsampler
from adv2e.light.interpolation.sequence import NOTHING, Beside


class Upsampler(Protocol):
    """Makes the frames inside one input interval."""

    def between(
        self, a: NDArray[Any], b: NDArray[Any], beside: Beside = NOTHING
    ) -> Iterator[NDArray[Any]]:
        """Yield the light at l/L of the way from `a` to `b`, l = 1..L; the last is `b` itself.

        Parameters
        ----------
        a, b : (rows, columns) float32 or float64
            Light of two neighbouring frames [DN], linear; left as they are.
        beside : Beside, optional
            The frames before and after them, which tell how paths bend; straight without.

        Yields
        ------
        light : (rows, columns)
            A new array each time, of the type of `a`; at last `b`.
        """
        ...


def make_upsampler(interpolation: str, L: int, *, threads: int = 1) -> Upsampler:
    """Return what makes `L` frames of each input interval.

    Parameters
    ----------
    interpolation : str
        ``linear`` or ``flow``.
    L : int
        Frames an interval, at least 1.
    threads : int
        In-between frames made at a time; they do not depend on it.

    Raises
    ------
    ConfigError
        `interpolation` is unknown or `L` below 1.
    """
    if L < 1:
        raise ConfigError(f"sampling.L: must be at least 1, got {L}")
    if interpolation == "linear":
        return LinearUpsampler(L)
    if interpolation == "flow":
        from adv2e.light.interpolation.flow import FlowUpsampler  # noqa: PLC0415 - compiled code

        return FlowUpsampler(L, threads=threads)
    raise ConfigError(f"sampling.interpolation: must be linear or flow, got {interpolation!r}")

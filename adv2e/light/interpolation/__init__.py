"""In-between frames, so that no pixel jumps too far between samples.

Each input interval is cut into L equal parts, or into fewer where little moves
(:mod:`.flow`).  The frame at l/L of it is made from the light of the two frames around it: linear
in time for every pixel (:mod:`.linear`), along the motion (:mod:`.flow`), or by a network
(:mod:`.network`).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Protocol

from numpy.typing import NDArray

from adv2e.config.model import Sampling
from adv2e.errors import ConfigError
from adv2e.light.interpolation.linear import NOTHING, Beside, LinearUpsampler

if TYPE_CHECKING:
    from adv2e.light.interpolation.flow import GivenFlow
    from adv2e.light.interpolation.onnx_file import Network


class Upsampler(Protocol):
    """Makes the frames inside one input interval."""

    def count(self, a: NDArray[Any], b: NDArray[Any], beside: Beside = NOTHING) -> int:
        """Return the number of frames of :meth:`between` in the same interval, at least 1."""
        ...

    def between(
        self, a: NDArray[Any], b: NDArray[Any], beside: Beside = NOTHING
    ) -> Iterator[NDArray[Any]]:
        """Yield the light at l/n of the way from `a` to `b`, l = 1..n; the last is `b` itself.

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


def make_upsampler(
    sampling: Sampling, *, threads: int = 1, given: GivenFlow | None = None
) -> Upsampler:
    """Return the upsampler for an interpolation: linear, along the motion, or by a network.

    `threads` in-between frames are made at a time; they do not depend on it.  `given` is the flow
    of interpolation: given, see :class:`.flow.Paths`.

    Raises
    ------
    ConfigError
        A network's file is not one that can be asked, or cannot make so many frames; flow is to be
        given, and is not.
    MissingExtraError
        A network is asked for, and what runs it is not installed.
    """
    if sampling.interpolation == "linear" or sampling.L == 1:
        return LinearUpsampler(sampling.L)
    # imported late: compiled code
    from adv2e.light.interpolation.flow import Paths  # noqa: PLC0415

    if (given is None) == (sampling.interpolation == "given"):
        raise ConfigError(
            "sampling.interpolation: given is for 'adv2e convert' of frames with flow beside them"
        )
    paths = Paths(sampling.L, sampling.max_motion_px, given)
    network = network_of(sampling)
    if network is None:
        from adv2e.light.interpolation.flow import FlowUpsampler  # noqa: PLC0415

        return FlowUpsampler(paths, threads=threads)
    from adv2e.light.interpolation.network import NetworkUpsampler  # noqa: PLC0415

    return NetworkUpsampler(network, paths, threads=threads)


def network_of(sampling: Sampling) -> Network | None:
    """Return the network that is asked for frames; None: none is, as where there are none between.

    Raises
    ------
    ConfigError, MissingExtraError
        As :func:`adv2e.light.interpolation.onnx_file.open_network`.
    """
    if sampling.model is None or sampling.L == 1:
        return None
    from adv2e.light.interpolation.onnx_file import open_network  # noqa: PLC0415 - few need it

    return open_network(sampling.model)

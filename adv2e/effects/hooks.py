"""Effects that need no compiled code: what they may change, from the frames to the file.

An effect is a class derived from :class:`Hooks`.  Each method stands at one place of the signal
path, and by default changes nothing there:

============== ===================================================================================
light          the light of the frames, and their times
gain           factors on the light at any time, between the frames too; corner, leak and shot
               noise follow them
drive          added to the log intensity x, before the poles (the corner does not follow it)
signal         added to the signal behind all poles
thresholds     factors on the ON and OFF thresholds
inject         events that happen by themselves, as those of a hot pixel do
events         the events on their way to the file
============== ===================================================================================

Its parameters are a section (:mod:`adv2e.parameters`) with units, ranges and, for those that a
diagnosis may fit, where to look (:class:`adv2e.parameters.Fit`).

Events must not depend on how a sequence is cut into chunks or spread over threads: random numbers
are functions of what they are for (:meth:`View.uniforms`), and `gain`, `drive`, `signal` and
`thresholds` are functions of time, which may be asked for in any order.
"""

from __future__ import annotations

import itertools
import re
import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from adv2e.events import Events, empty_events
from adv2e.kernel import rng
from adv2e.parameters import Section

Times = NDArray[np.float64]
"""(n,) times [s] on the camera's clock, increasing."""

LightFrame = tuple[int, NDArray[Any]]
"""Time [ns] and light [DN] (rows, columns) of a frame, float32 or float64."""

Frames = Iterator[LightFrame]
"""Frames of a recording as the pixel sees them, in the order of time."""

LONGEST_US = 100.0
"""Longest step in which the circuit is solved, and courses are followed unless they say more."""

INJECTED_DTYPE = np.dtype([("t", "<f8"), ("x", "<u2"), ("y", "<u2"), ("p", "u1")])
"""Events to be injected: time [s], column, row, polarity (1 ON, 0 OFF)."""

_OWN_STREAMS = 1 << 31


@dataclass(frozen=True)
class View:
    """Size, seed and start of a recording, as an effect gets them before it begins.

    Attributes
    ----------
    rows, columns : int
    seed : int
    start_s : float
        Time of the first frame, as it reaches the effect [s].
    """

    rows: int
    columns: int
    seed: int
    start_s: float

    def uniforms(self, purpose: str, pixel: ArrayLike, draw: ArrayLike = 0) -> Times:
        """Return uniform numbers in (0, 1), always the same for the same arguments and seed.

        Parameters
        ----------
        purpose : str
            What they are for; those for other purposes are independent.
        pixel, draw : int or array_like of int
            Number of the pixel (row * columns + column), and of the draw for that pixel; not
            negative.
        """
        stream = _OWN_STREAMS | zlib.crc32(purpose.encode())
        return rng.uniform_array(self.seed, stream, pixel, draw)


@dataclass(frozen=True, kw_only=True)
class NoParameters(Section):
    """The section of an effect without parameters."""


class Hooks:
    """One effect; every method changes nothing unless it is overridden.

    Parameters
    ----------
    parameters : Section, optional
        An instance of `Parameters`.
    **values
        In its place: values of the keys of `Parameters`.

    Attributes
    ----------
    name : str
        Of the effect; its section of the configuration is ``user.<name>``.  By default the name of
        the class in lower case with underscores, less ``_hooks`` at its end.
    stage : str
        ``frames``, ``pixel`` or ``readout``: the effect comes after the package's own of that
        stage, but before the tick of the time stamps, which is always last.
    Parameters : type
        The class of its section.
    source : mapping
        Name, file and SHA-256 of the code, where it was loaded from a file.
    step_us : float
        Longest time step that resolves `gain`, `drive`, `signal` and `thresholds` [us].  Events are
        simulated with none above 100 us; a diagnosis, which can do with longer ones elsewhere,
        keeps to this one, and takes two and a half of it for a first look.
    parameters : Section
    view : View
        Set before anything else is called.

    Raises
    ------
    ConfigError
        A value out of its range.
    """

    name: ClassVar[str] = ""
    stage: ClassVar[str] = "pixel"
    Parameters: ClassVar[type[Section]] = NoParameters
    source: ClassVar[Mapping[str, str]] = {}

    step_us: float = LONGEST_US
    view: View

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if "name" not in vars(cls):
            words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", cls.__name__).lower()
            cls.name = words.removesuffix("_hooks")

    def __init__(self, parameters: Section | None = None, /, **values: Any) -> None:
        self.parameters: Any = self.Parameters(**values) if parameters is None else parameters

    def begin(self, view: View) -> None:
        """Take notice of the recording that begins; forget the one before."""
        self.view = view

    def light(self, frames: Frames) -> Frames:
        """Return the frames, changed; of the same size, at increasing times.

        It may hold back as many as it needs, and must not write into those it is given.  Where it
        needs none that is still to come, :meth:`light_now` is enough.
        """
        return itertools.starmap(self.light_now, frames)

    def light_now(self, t_ns: int, light: NDArray[Any]) -> LightFrame:
        """Return a frame, changed: in the place of :meth:`light`, for cameras in a loop, too."""
        return t_ns, light

    def gain(self, times_s: Times) -> NDArray[Any] | None:
        """Return factors on the light, (n,) or (n, rows, columns), above 0."""
        return None

    def drive(self, times_s: Times) -> NDArray[Any] | None:
        """Return the addition to the log intensity [ln], (n,) or (n, rows, columns)."""
        return None

    def signal(self, times_s: Times) -> NDArray[Any] | None:
        """Return the addition to the signal behind all poles [ln], (n,) or (n, rows, columns)."""
        return None

    def thresholds(self, times_s: Times) -> tuple[NDArray[Any], NDArray[Any]] | None:
        """Return factors on the ON and OFF thresholds, each (n,) or (n, rows, columns), above 0."""
        return None

    def inject(self, start_s: float, stop_s: float) -> NDArray[Any]:
        """Return the events that happen by themselves from `start_s` on and before `stop_s`.

        Returns
        -------
        (n,) array of INJECTED_DTYPE
            Sorted by time.  Those that meet the dead time of a pixel are lost; neighbouring spans
            are asked for, each once.
        """
        return np.empty(0, INJECTED_DTYPE)

    def events(self, chunks: Iterable[Events]) -> Iterator[Events]:
        """Yield the events, changed; sorted within and across chunks.

        It may hold back as many as it needs (see :class:`adv2e.effects.reorder_buffer.InOrder`),
        and must not write into those it is given.  As :meth:`events_now` and :meth:`events_left`
        in its place, it is for cameras in a loop, too.
        """
        yield from map(self.events_now, chunks)
        yield self.events_left()

    def events_now(self, events: Events) -> Events:
        """Return those of the events so far that are to come out now, changed."""
        return events

    def events_left(self) -> Events:
        """Return the events that were held back, at the end."""
        return empty_events()

    @property
    def looks_ahead(self) -> bool:
        """True if frames, or events, are needed that are still to come."""
        return any(
            getattr(type(self), whole) is not getattr(Hooks, whole) for whole in ("light", "events")
        )

    def longest_step_us(self, start_s: float, stop_s: float) -> float:
        """Return the longest time step that resolves what it adds between two times [us].

        `step_us`, unless an effect that is quiet for a while says otherwise.
        """
        return self.step_us

    def passed(self, time_s: float) -> None:
        """Take notice that nothing before `time_s` will be asked for again."""

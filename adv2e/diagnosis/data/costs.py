"""About how long a simulation of a recording takes, told without simulating it.

Counted, not measured, so that what of a recording is looked at is the same on every machine.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from adv2e.config import Config
from adv2e.config.active_effects import active_hooks
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.data.light import lights
from adv2e.diagnosis.fitting.simulations import FINE
from adv2e.effects.composition import additions_of, begin
from adv2e.kernel.workspace import EXACT
from adv2e.light.interpolation.sequence import instant_ns
from adv2e.pixel.circuit import driver_of, make_circuit
from adv2e.pixel.steps import steps_of

# in one thread, with the statistics of the events [s]
INSTANT_S = 20e-9
"""Of one pixel and each frame that is made."""
EVENT_S = 400e-9
SECOND_S = 13e-6
"""Of one pixel and a second: what effects that are solved in steps of time add, over all that a
diagnosis tries."""
STEP_S = 3e-9
"""Of one pixel and each step of time that the declared model takes by itself."""
STEPPED = 10
"""Times as long as `INSTANT_S` where the low-pass is stepped, as the paper prints it."""


class Costs:
    """What simulations of parts of a recording cost.

    Parameters
    ----------
    evidence : Evidence
        The whole of it.
    declared : Config
        Its `sampling`, the form of its filter, and what of it is solved in steps of time decide.
    """

    def __init__(self, evidence: Evidence, declared: Config) -> None:
        low_pass = declared.pixel.low_pass
        is_stepped = low_pass is not None and low_pass.update != "exact"
        self._of_frame = INSTANT_S * (STEPPED if is_stepped else 1) * declared.sampling.L
        steps = steps_of_time(evidence, declared)
        self._of_second = SECOND_S + STEP_S * steps / evidence.simulated.seconds

    def of(self, part: Evidence) -> float:
        """Return about how long a simulation takes, in the mean of those of a diagnosis [s]."""
        shown = part.simulated
        of_pixel = self._of_frame * (len(shown.frames) - 1) + self._of_second * shown.seconds
        return of_pixel * part.width * part.height + EVENT_S * len(part.stream)


def steps_of_time(evidence: Evidence, declared: Config) -> int:
    """Return how many steps of time a pixel takes through a recording; 0: it takes none.

    Parameters
    ----------
    evidence : Evidence
        With its run-in.
    declared : Config
    """
    shown, config = evidence.simulated, _without_pictures(declared)
    hooks = active_hooks(config)
    additions, circuit = additions_of(hooks), make_circuit(config.pixel, config.sampling, 0)
    if driver_of(config.pixel, circuit, additions, "auto") != "run_stepped":
        return 0
    frames = zip(shown.times_ns, lights(shown, config), strict=True)
    # one at a time: all of them may be many
    seen = [(t_ns, float(light.max())) for t_ns, light in begin(hooks, frames, config.seed)]
    is_exact = circuit.update == EXACT
    pieces = 1 if is_exact and not circuit.printed else circuit.steps
    total = 0
    for start_ns, stop_ns, brightest in _parted(seen, config.sampling.L):
        limit, length_us = np.inf, 1e-3 * (stop_ns - start_ns)
        if additions is not None:
            limit = additions.longest_step_us(start_ns * 1e-9, stop_ns * 1e-9)
        steps = 1
        if is_exact:
            steps = steps_of(length_us / pieces, circuit, limit, brightest, FINE)
        total += pieces * steps
    return total


def _without_pictures(declared: Config) -> Config:
    """Return `declared` without what acts on the pictures alone: no step hangs on it, but time."""
    frames, readout = declared.frames, declared.readout
    if readout is not None and readout.frame_coupling is not None:
        # readouts come at the ends of exposures
        delay_us = readout.frame_coupling.delay_us + 0.5 * frames.exposure_us
        coupling = replace(readout.frame_coupling, delay_us=delay_us)
        readout = replace(readout, frame_coupling=coupling)
    bare = replace(
        frames, exposure_us=0.0, black_level_dn=0.0, black_depth_dn=0.0, shift_px=(0.0, 0.0)
    )
    return replace(declared, frames=bare, readout=readout)


def _parted(frames: Iterable[tuple[int, float]], count: int) -> Iterator[tuple[int, int, float]]:
    """Yield begin and end of the parts of each interval, so many, and the brightest light in it."""
    for (start_ns, dim), (stop_ns, lit) in pairwise(frames):
        instants = (instant_ns(start_ns, stop_ns, k, count) for k in range(count + 1))
        for begins_ns, ends_ns in pairwise(instants):
            yield begins_ns, ends_ns, max(dim, lit)

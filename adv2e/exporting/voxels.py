"""Voxel grids of windows, in the files that E2VID and its relatives train on.

================================ ==================================================================
NAME/event_tensor_%010d.npy      float32, (bins, rows, columns); (2 bins, ...) with split polarities
NAME/timestamps.txt              a line for each: its number and its time, the end of the window [s]
NAME/boundary_timestamps.txt     a line for each: its number, start and end of its window [s]
================================ ==================================================================

References
----------
.. [1] H. Rebecq et al., "High Speed and High Dynamic Range Video with an Event Camera", TPAMI 2021,
   doi:10.1109/TPAMI.2019.2963386; files as in github.com/uzh-rpg/rpg_e2vid and rpg_ramnet.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from adv2e.exporting.windows import Slice
from adv2e.representations.voxel_grid import (
    Grid,
    own_window,
    robust,
    signed_grid,
    split_grid,
    z_scored,
)

NORMALISATIONS: dict[str, Callable[[Grid], Grid]] = {
    "none": lambda grid: grid,
    "e2vid": z_scored,
    "event_cnn_minimal": robust,
}
"""By name: as counted; zero mean and unit deviation of the cells that are not zero; ``RobustNorm``.

``LegacyNorm`` of event_cnn_minimal is that of e2vid.
"""


@dataclass(frozen=True)
class VoxelSettings:
    """Settings of voxel grids.

    Attributes
    ----------
    bins : int
        Temporal bins.
    normalise : str
        One of `NORMALISATIONS`.
    polarity : {'signed', 'split'}
        One grid in which ON counts +1 and OFF -1; or one of ON above one of OFF.
    span : {'events', 'window'}
        The first and the last bin are at the first and the last event, as E2VID has it, or at the
        ends of the window.
    """

    bins: int = 5
    normalise: str = "none"
    polarity: str = "signed"
    span: str = "events"

    def grid(self, part: Slice, size: tuple[int, int]) -> Grid:
        """Return the grid of a window."""
        whole = part.start_us, part.stop_us
        window = own_window(part.events) if self.span == "events" else whole
        make = signed_grid if self.polarity == "signed" else split_grid
        return NORMALISATIONS[self.normalise](make(part.events, self.bins, size, window))


def write_voxels(
    slices: Iterator[Slice], size: tuple[int, int], folder: Path, settings: VoxelSettings
) -> int:
    """Write the grids of all windows; return how many."""
    folder.mkdir()
    number = 0
    with ExitStack() as stack:
        times, bounds = (
            stack.enter_context((folder / name).open("w", encoding="ascii", newline="\n"))
            for name in ("timestamps.txt", "boundary_timestamps.txt")
        )
        for part in slices:
            grid = settings.grid(part, size).astype(np.float32)
            np.save(folder / f"event_tensor_{number:010d}.npy", grid, allow_pickle=False)
            start, stop = (f"{t / 1e6:.6f}" for t in (part.start_us, part.stop_us))
            times.write(f"{number} {stop}\n")
            bounds.write(f"{number} {start} {stop}\n")
            number += 1
    return number

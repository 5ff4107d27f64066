"""FireNet: reconstructs images from events, with 37,777 parameters; from scratch, or pretrained.

Convolution, gated recurrent unit, residual block, unit, block, and a convolution of one pixel.
Events go in as signed grids of 5 temporal bins, each window between its own first and last event.
FireNet gets them z-scored over the cells that are not zero; FireNet+, which is the same net trained
on other events, gets them as they are.

Weights are not part of this repository.  ``firenet.pth`` and ``firenet_plus.pth`` are the files
``model.pth`` in ``pretrained/FireNet`` and ``pretrained/FireNet+`` of github.com/ercanburak/EVREAL.
They are for measuring alone.  Needs PyTorch, which this project itself never does.

References
----------
.. [1] C. Scheerlinck et al., "Fast Image Reconstruction with an Event Camera", WACV 2020.
.. [2] T. Stoffregen et al., "Reducing the sim-to-real gap for event cameras", ECCV 2020,
   arXiv:2003.09078.
"""

from __future__ import annotations

import pathlib
import re
import sys
import types
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.events import Events
from adv2e.representations.voxel_grid import own_window, signed_grid, z_scored
from networks import damage_told, torch_module

Images = NDArray[np.float32]
"""(windows, rows, columns), 0 black and 1 white."""

NETWORKS = {"FireNet": "firenet.pth", "FireNet+": "firenet_plus.pth"}
"""Pretrained nets, and the files of their weights."""
BINS, CHANNELS = 5, 16
PARAMETERS = 37_777
_PUBLISHED = (
    (r"^net\.", ""),
    (r"^head\.conv\.", "head."),
    (r"^head\.recurrent_block\.", "G1."),
    (r"^resblocks\.0\.conv\.", "R1."),
    (r"^resblocks\.0\.recurrent_block\.", "G2."),
    (r"^resblocks\.1\.", "R2."),
    (r"\.conv2d\.", "."),
)
"""From the names of either checkpoint to those of :func:`firenet`."""


def firenet() -> Any:
    """Return the net with weights by chance.

    As its authors have it, gates begin orthogonal and without bias.  It takes grids (batch, bins,
    rows, columns) and the state that it returned before, None for zeros; it returns images (batch,
    1, rows, columns), about 0 black and 1 white, and the next state.
    """
    return _class(torch_module())()


@cache
def _class(torch: Any) -> Any:
    nn = torch.nn

    def gate() -> Any:
        layer = nn.Conv2d(2 * CHANNELS, CHANNELS, 3, padding=1)
        nn.init.orthogonal_(layer.weight)
        nn.init.zeros_(layer.bias)
        return layer

    class Unit(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.reset_gate, self.update_gate, self.out_gate = gate(), gate(), gate()

        def forward(self, x: Any, before: Any) -> Any:
            both = torch.cat([x, before], 1)
            update = torch.sigmoid(self.update_gate(both))
            reset = torch.sigmoid(self.reset_gate(both))
            out = torch.tanh(self.out_gate(torch.cat([x, before * reset], 1)))
            return before * (1 - update) + out * update

    class Block(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.conv1 = nn.Conv2d(CHANNELS, CHANNELS, 3, padding=1)
            self.conv2 = nn.Conv2d(CHANNELS, CHANNELS, 3, padding=1)

        def forward(self, x: Any) -> Any:
            return torch.relu(self.conv2(torch.relu(self.conv1(x))) + x)

    class FireNet(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.head = nn.Conv2d(BINS, CHANNELS, 3, padding=1)
            self.G1, self.R1, self.G2, self.R2 = Unit(), Block(), Unit(), Block()
            self.pred = nn.Conv2d(CHANNELS, 1, 1)

        def forward(self, grid: Any, state: Any = None) -> Any:
            x = torch.relu(self.head(grid))
            first, second = (torch.zeros_like(x),) * 2 if state is None else state
            first = self.G1(x, first)
            second = self.G2(self.R1(first), second)
            return self.pred(self.R2(second)), (first, second)

    return FireNet


class Network:
    """A pretrained net.

    Parameters
    ----------
    name : str
        One of `NETWORKS`.
    folder : Path
        Where its weights are.

    Raises
    ------
    DataError
        The file does not hold exactly the parameters of this net.
    MissingExtraError
        PyTorch is not installed.
    """

    def __init__(self, name: str, folder: Path) -> None:
        self.name = name
        self._net = firenet()
        path = folder / NETWORKS[name]
        state = {_named(key): value for key, value in _weights(path).items()}
        try:
            self._net.load_state_dict(state, strict=True)
        except RuntimeError as error:
            raise DataError(f"{path}: not the weights of {name}: {error}") from None

    def images(self, windows: Iterable[Events], size: tuple[int, int]) -> Images:
        """Return what the net makes of the events of successive windows, from a state of zeros.

        Values beyond black and white are clipped.

        Parameters
        ----------
        windows : iterable of (events,) arrays
            Sorted, inside the sensor.
        size : (int, int)
            Columns and rows.
        """
        return reconstructed(self._net, (self.grid(events, size) for events in windows))

    def grid(self, events: Events, size: tuple[int, int]) -> NDArray[np.float32]:
        """Return what goes into the net, (bins, rows, columns)."""
        return grid_of(events, size, scored=self.name == "FireNet")


def grid_of(events: Events, size: tuple[int, int], *, scored: bool = True) -> NDArray[np.float32]:
    """Return the 5 bins of a window between its own first and last event, (bins, rows, columns).

    Parameters
    ----------
    events : (events,) array
        Sorted, inside the sensor.
    size : (int, int)
        Columns and rows.
    scored : bool
        Z-scored over the cells that are not zero.
    """
    grid = signed_grid(events, BINS, size, own_window(events))
    return (z_scored(grid) if scored else grid).astype(np.float32)


def reconstructed(net: Any, grids: Iterable[NDArray[np.float32]]) -> Images:
    """Return what a recurrent net makes of successive grids, from a state of zeros, clipped."""
    torch = torch_module()
    state, made = None, []
    with torch.inference_mode():
        for grid in grids:
            image, state = net(torch.from_numpy(grid[None]), state)
            made.append(image[0, 0].numpy())
    return np.clip(np.array(made, np.float32), 0.0, 1.0)


def _named(key: str) -> str:
    for pattern, other in _PUBLISHED:
        key = re.sub(pattern, other, key)
    return key


def _weights(path: Path) -> Any:
    """Return the tensors of a checkpoint, of whose other objects no code is run."""
    torch = torch_module()
    stub = types.ModuleType("parse_config")
    stub.ConfigParser = type("ConfigParser", (), {"__module__": "parse_config"})  # type: ignore[attr-defined]
    with (
        patch.dict(sys.modules, {"parse_config": stub}),
        damage_told(f"{path}: no checkpoint of PyTorch"),
        torch.serialization.safe_globals([stub.ConfigParser, pathlib.PosixPath]),
    ):
        return torch.load(path, map_location="cpu", weights_only=True)["state_dict"]

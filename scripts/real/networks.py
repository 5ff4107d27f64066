"""FireNet and FireNet+: what pretrained networks reconstruct from events, for measuring alone.

Both are one net of 37,777 parameters: convolution, gated recurrent unit, residual block, unit,
block, and a convolution of one pixel.  Events go in as signed grids of 5 temporal bins, each window
between its own first and last event.  FireNet gets them z-scored over the cells that are not zero,
FireNet+ as they are.

Weights are not part of this repository.  ``firenet.pth`` and ``firenet_plus.pth`` are the files
``model.pth`` in ``pretrained/FireNet`` and ``pretrained/FireNet+`` of github.com/ercanburak/EVREAL.
Needs PyTorch, which this project itself never does.

References
----------
.. [1] C. Scheerlinck et al., "Fast Image Reconstruction with an Event Camera", WACV 2020.
.. [2] T. Stoffregen et al., "Reducing the sim-to-real gap for event cameras", ECCV 2020,
   arXiv:2003.09078.
.. [3] Z. Wang et al., "Image Quality Assessment: From Error Visibility to Structural Similarity",
   IEEE Transactions on Image Processing 13(4), 2004, doi:10.1109/TIP.2003.819861.
"""

from __future__ import annotations

import importlib
import pathlib
import re
import sys
import types
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError, MissingExtraError
from adv2e.events import Events
from adv2e.representations.voxel_grid import own_window, signed_grid, z_scored

Images = NDArray[np.float32]
"""(windows, rows, columns), 0 black and 1 white."""

NETWORKS = {"FireNet": "firenet.pth", "FireNet+": "firenet_plus.pth"}
BINS, CHANNELS = 5, 16
PARAMETERS = 37_777
_OF_FIRENET = (
    (r"^net\.", ""),
    (r"^head\.conv\.", "head."),
    (r"^head\.recurrent_block\.", "G1."),
    (r"^resblocks\.0\.conv\.", "R1."),
    (r"^resblocks\.0\.recurrent_block\.", "G2."),
    (r"^resblocks\.1\.", "R2."),
    (r"\.conv2d\.", "."),
)
"""From the names of either checkpoint to those of :func:`layers`."""


def torch_module() -> Any:
    """Return PyTorch.

    Raises
    ------
    MissingExtraError
        It is not installed.
    """
    try:
        return importlib.import_module("torch")
    except ImportError as error:
        raise MissingExtraError("a frozen network", "torch") from error


def layers(torch: Any) -> Any:
    """Return the layers of the net, with weights by chance."""
    nn = torch.nn

    def unit() -> Any:
        gates = ("reset_gate", "update_gate", "out_gate")
        return nn.ModuleDict(
            {one: nn.Conv2d(2 * CHANNELS, CHANNELS, 3, padding=1) for one in gates}
        )

    def block() -> Any:
        steps = ("conv1", "conv2")
        return nn.ModuleDict({one: nn.Conv2d(CHANNELS, CHANNELS, 3, padding=1) for one in steps})

    return nn.ModuleDict(
        {
            "head": nn.Conv2d(BINS, CHANNELS, 3, padding=1),
            "G1": unit(), "R1": block(), "G2": unit(), "R2": block(),
            "pred": nn.Conv2d(CHANNELS, 1, 1),
        }
    )  # fmt: skip


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
        self._torch = torch_module()
        self._layers = layers(self._torch)
        path = folder / NETWORKS[name]
        state = {_named(key): value for key, value in _weights(self._torch, path).items()}
        try:
            self._layers.load_state_dict(state, strict=True)
        except RuntimeError as error:
            raise DataError(f"{path}: not the weights of {name}: {error}") from None
        assert sum(one.numel() for one in self._layers.parameters()) == PARAMETERS

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
        torch = self._torch
        states = {name: torch.zeros(1, CHANNELS, size[1], size[0]) for name in ("G1", "G2")}
        made = []
        with torch.inference_mode():
            for events in windows:
                x = torch.from_numpy(self.grid(events, size)[None])
                x = torch.relu(self._layers["head"](x))
                for number in "12":
                    x = self._unit(f"G{number}", x, states)
                    x = self._block(f"R{number}", x)
                made.append(self._layers["pred"](x)[0, 0].numpy())
        return np.clip(np.array(made, np.float32), 0.0, 1.0)

    def grid(self, events: Events, size: tuple[int, int]) -> NDArray[np.float32]:
        """Return what goes into the net, (bins, rows, columns)."""
        grid = signed_grid(events, BINS, size, own_window(events))
        return (z_scored(grid) if self.name == "FireNet" else grid).astype(np.float32)

    def _unit(self, name: str, x: Any, states: dict[str, Any]) -> Any:
        torch, gates, before = self._torch, self._layers[name], states[name]
        both = torch.cat([x, before], 1)
        update = torch.sigmoid(gates["update_gate"](both))
        reset = torch.sigmoid(gates["reset_gate"](both))
        out = torch.tanh(gates["out_gate"](torch.cat([x, before * reset], 1)))
        states[name] = before * (1 - update) + out * update
        return states[name]

    def _block(self, name: str, x: Any) -> Any:
        relu, steps = self._torch.relu, self._layers[name]
        return relu(steps["conv2"](relu(steps["conv1"](x))) + x)


def _named(key: str) -> str:
    for pattern, other in _OF_FIRENET:
        key = re.sub(pattern, other, key)
    return key


def _weights(torch: Any, path: Path) -> Any:
    """Return the tensors of a checkpoint, of whose other objects no code is run."""
    stub = types.ModuleType("parse_config")
    stub.ConfigParser = type("ConfigParser", (), {"__module__": "parse_config"})  # type: ignore[attr-defined]
    before = sys.modules.get("parse_config")
    sys.modules["parse_config"] = stub
    try:
        with torch.serialization.safe_globals([stub.ConfigParser, pathlib.PosixPath]):
            return torch.load(path, map_location="cpu", weights_only=True)["state_dict"]
    except (KeyError, RuntimeError, EOFError) as error:
        raise DataError(f"{path}: no checkpoint of PyTorch: {error}") from None
    finally:
        if before is None:
            del sys.modules["parse_config"]
        else:
            sys.modules["parse_config"] = before


def similarity(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Return the mean structural similarity of two images between 0 and 1.

    As [3]: means, variances and covariance under a Gaussian of 1.5 pixels (11 x 11), constants
    0.01**2 and 0.03**2.  1 for equal images.
    """
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)

    def mean(image: NDArray[Any]) -> NDArray[Any]:
        return cv2.GaussianBlur(image, (11, 11), 1.5)

    at_a, at_b = mean(a), mean(b)
    spread = mean(a * a) - at_a**2 + mean(b * b) - at_b**2
    both = mean(a * b) - at_a * at_b
    light = (2 * at_a * at_b + 1e-4) / (at_a**2 + at_b**2 + 1e-4)
    return float(np.mean(light * (2 * both + 9e-4) / (spread + 9e-4)))


def likeness(image: NDArray[Any], frame: NDArray[Any]) -> float:
    """Return the correlation of an image with a frame's light [DN], under a logarithm of DN + 5."""
    return float(np.corrcoef(np.ravel(image), np.log(np.ravel(frame) + 5.0))[0, 1])

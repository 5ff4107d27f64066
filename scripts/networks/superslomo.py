"""Super SloMo (Jiang et al., CVPR 2018, doi:10.1109/CVPR.2018.00938), written anew in PyTorch.

One U-Net finds the flow between two frames.  From it follow first flows from the wanted instant to
both frames; a second U-Net corrects them and says which frame shows each pixel.  Names and shapes
of the weights are those of https://github.com/avinashpaliwal/Super-SloMo, and of v2e.

Three things are as they were in training, which the programs of today do not always repeat:

- A mean is subtracted from the frames, and added again at the end: 0.428 for the grey weights of
  v2e, 0.429, 0.431 and 0.397 for the red, green and blue of the original.  Both programs leave it
  out where they run without a GPU.
- A frame of N columns is sampled at x (N - 1) / N for the flow x - column.  PyTorch did so before
  version 1.3, when these weights were trained.  Newer versions sample at x - 0.5 by default, which
  is the same in the middle of a frame and half a pixel aside at its borders.
- The network's own enlargements treat pixels as areas (``align_corners=False``), as PyTorch has
  done by default since version 0.4.

What lies outside a frame counts as the mean.  Each output is an average of input pixels and this
mean, so it is in [0, 1] by itself.
"""

from __future__ import annotations

import datetime
import hashlib
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from adv2e.errors import DataError
from networks import damage_told
from networks.exporting import Network, sample

MULTIPLE = 32
"""Of rows and columns: they are halved five times."""
MEANS = {1: (0.428,), 3: (0.429, 0.431, 0.397)}
"""Of the frames that the weights were trained on, by the number of channels."""
_DOWN = ((32, 64, 5), (64, 128, 3), (128, 256, 3), (256, 512, 3), (512, 512, 3))
_UP = ((512, 512), (512, 256), (256, 128), (128, 64), (64, 32))


def _convolution(inputs: int, outputs: int, size: int) -> nn.Conv2d:
    return nn.Conv2d(inputs, outputs, size, padding=size // 2)


def _leaky(values: Tensor) -> Tensor:
    return functional.leaky_relu(values, 0.1)


class _Pair(nn.Module):
    """Two convolutions; the second one also sees what was skipped, if there is any."""

    def __init__(self, inputs: int, outputs: int, size: int, skipped: int = 0) -> None:
        super().__init__()
        self.conv1 = _convolution(inputs, outputs, size)
        self.conv2 = _convolution(outputs + skipped, outputs, size)

    def forward(self, values: Tensor, skipped: Sequence[Tensor] = ()) -> Tensor:
        values = _leaky(self.conv1(values))
        return _leaky(self.conv2(torch.cat((values, *skipped), 1)))


class _UNet(nn.Module):
    """Five times smaller, five times larger, with a short cut at each size."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.conv1 = _convolution(inputs, 32, 7)
        self.conv2 = _convolution(32, 32, 7)
        for k, (before, after, size) in enumerate(_DOWN, 1):
            self.add_module(f"down{k}", _Pair(before, after, size))
        for k, (before, after) in enumerate(_UP, 1):
            self.add_module(f"up{k}", _Pair(before, after, 3, skipped=after))
        self.conv3 = _convolution(32, outputs, 3)

    def forward(self, values: Tensor) -> Tensor:
        values = _leaky(self.conv2(_leaky(self.conv1(values))))
        skipped = []
        for k in range(1, len(_DOWN) + 1):
            skipped.append(values)
            values = self.get_submodule(f"down{k}")(functional.avg_pool2d(values, 2))
        for k in range(1, len(_UP) + 1):
            large = functional.interpolate(
                values, scale_factor=2.0, mode="bilinear", align_corners=False
            )
            values = self.get_submodule(f"up{k}")(large, [skipped.pop()])
        return _leaky(self.conv3(values))


def _warp(frame: Tensor, flow: Tensor) -> Tensor:
    return sample(frame, flow, ends=(frame.shape[2], frame.shape[3]), outside="zeros")


class SuperSloMo(nn.Module):
    """Both networks and what lies between them; `mean` has one number for each channel."""

    def __init__(self, mean: Sequence[float]) -> None:
        super().__init__()
        channels = len(mean)
        self.flow = _UNet(2 * channels, 4)
        self.refinement = _UNet(4 * channels + 8, 5)
        self.register_buffer("mean", torch.tensor(mean).reshape(1, channels, 1, 1))

    def forward(self, img0: Tensor, img1: Tensor, timestep: Tensor) -> Tensor:
        """Return the frame at an instant between two frames."""
        t = timestep.reshape(1, 1, 1, 1)
        frame0, frame1 = img0 - self.mean, img1 - self.mean
        flows = self.flow(torch.cat((frame0, frame1), 1))
        forth, back = flows[:, :2], flows[:, 2:]
        to0 = t * (t * back - (1 - t) * forth)
        to1 = (1 - t) * ((1 - t) * forth - t * back)
        seen = (frame0, frame1, forth, back, to1, to0, _warp(frame1, to1), _warp(frame0, to0))
        refined = self.refinement(torch.cat(seen, 1))
        visible = torch.sigmoid(refined[:, 4:])
        weight0, weight1 = (1 - t) * visible, t * (1 - visible)
        sum_of_both = weight0 * _warp(frame0, to0 + refined[:, :2]) + weight1 * _warp(
            frame1, to1 + refined[:, 2:4]
        )
        return sum_of_both / (weight0 + weight1) + self.mean


def load(checkpoint: Path, mean: float | None) -> Network:
    """Return the network with the weights of a checkpoint.

    Parameters
    ----------
    checkpoint : Path
        Holds the weights of the first U-Net under ``state_dictFC``, and those of the second under
        ``state_dictAT``.
    mean : float or None
        Subtracted from all channels; None for what the weights were trained with.
    """
    raw = checkpoint.read_bytes()
    content = _unpickled(checkpoint, raw)
    states = {}
    for key in ("state_dictFC", "state_dictAT"):
        states[key] = content.get(key) if isinstance(content, Mapping) else None
        if not isinstance(states[key], Mapping):
            raise DataError(f"{checkpoint}: has no {key}: is it a checkpoint of Super SloMo?")
    first = states["state_dictFC"].get("conv1.weight")
    inputs = first.shape[1] if isinstance(first, Tensor) and first.ndim == 4 else 2
    if inputs not in (2, 6):
        raise DataError(
            f"{checkpoint}: state_dictFC: conv1.weight takes {inputs} channels, not 2 (grey) or 6"
            " (colour)"
        )
    means = MEANS[inputs // 2]
    network = SuperSloMo(means if mean is None else [mean] * len(means)).eval()
    parts = {"state_dictFC": network.flow, "state_dictAT": network.refinement}
    for key, part in parts.items():
        _check(f"{checkpoint}: {key}", states[key], part.state_dict())
        part.load_state_dict(states[key])
    metadata = {"source": checkpoint.name, "sha256": hashlib.sha256(raw).hexdigest()}
    metadata["mean"] = " ".join(f"{value:g}" for value in network.mean.flatten().tolist())
    return Network(network, network, len(means), MULTIPLE, metadata)


def _unpickled(checkpoint: Path, raw: bytes) -> Any:
    """Return what a checkpoint holds; nothing in it is run."""
    with (
        damage_told(f"{checkpoint}: is no checkpoint of PyTorch"),
        torch.serialization.safe_globals([datetime.datetime]),  # it tells when it was made
    ):
        return torch.load(io.BytesIO(raw), map_location="cpu", weights_only=True)


def _check(where: str, found: Mapping[str, object], wanted: Mapping[str, Tensor]) -> None:
    for name in wanted:
        if name not in found:
            raise DataError(f"{where}: has no {name}")
    for name, weights in found.items():
        if name not in wanted:
            raise DataError(f"{where}: {name} does not belong to Super SloMo")
        shape = tuple(getattr(weights, "shape", ()))
        if not isinstance(weights, Tensor) or shape != wanted[name].shape:
            raise DataError(f"{where}: {name} is of shape {shape}, not {tuple(wanted[name].shape)}")
        if not weights.isfinite().all():
            raise DataError(f"{where}: {name} has numbers that are not finite")

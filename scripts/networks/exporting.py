"""Writes a network as one file of ONNX, which is compared with it before it gets its name."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import click
import cv2
import numpy as np
import onnxruntime
import torch
from numpy.typing import NDArray
from onnx_ir.passes.common import ClearMetadataAndDocStringPass
from torch import Tensor, nn
from torch.nn import functional

from adv2e.errors import OutputError
from adv2e.files.staging import Staging

TOLERANCE = 1e-4
"""Most that a pixel of the file and of the network may differ by; white is 1."""
SCENES = ((128, 192, 3), (192, 128, 3), (128, 192, 80))
"""Rows and columns of the frames that both are run on, and how far these move [pixels]."""
_OPSET = 18
"""The oldest that the exporter makes, so that older runtimes read the file too."""


@dataclass(frozen=True)
class Network:
    """A network that is exported.

    Parameters
    ----------
    module : Module
        Takes two frames and the instant between them.
    reference : callable
        Takes the same, and is run to check the file.
    channels : int
    multiple : int
        Rows and columns must be multiples of it.
    metadata : mapping
        Of the file, besides what each has.
    """

    module: nn.Module
    reference: Callable[[Tensor, Tensor, Tensor], Tensor]
    channels: int
    multiple: int
    metadata: Mapping[str, str]


def export(load: Callable[[], Network], source: Path, output: Path, *, overwrite: bool) -> None:
    """Load a network from `source` and write it."""
    with Staging(overwrite, [source]) as staging:
        temporary = staging.file(output)
        network = load()
        staging.prepare()
        _write(network, temporary)
        difference = largest_difference(network, temporary)
        if not difference <= TOLERANCE:
            raise OutputError(
                f"{output}: not written: ONNX and PyTorch differ by up to {difference:.2g}, more"
                f" than {TOLERANCE:g}"
            )
    click.echo(
        f"{output}: {'grey' if network.channels == 1 else 'RGB'}, rows and columns are multiples of"
        f" {network.multiple}; ONNX and PyTorch differ by {difference:.2g} at most"
    )


def _write(network: Network, path: Path) -> None:
    rows, columns = (multiple * network.multiple for multiple in (2, 3))
    frame = torch.linspace(0, 1, network.channels * rows * columns)
    frame = frame.reshape(1, network.channels, rows, columns)
    free = {2 + k: network.multiple * torch.export.Dim(f"n{k}") for k in (0, 1)}
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # tells of packages that nobody needs
    with torch.no_grad(), warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # of PyTorch, about its own code
        traced = torch.export.export(
            network.module,
            (frame, frame.flip(3), torch.tensor([0.4])),
            dynamic_shapes=(free, free, None),
        )
        program = torch.onnx.export(
            traced,
            dynamo=True,
            verbose=False,
            opset_version=_OPSET,
            input_names=["img0", "img1", "timestep"],
            output_names=["output"],
        )
    assert program is not None
    ClearMetadataAndDocStringPass()(program.model)  # they hold paths of this machine
    program.model.metadata_props.update(
        {"encoding": "srgb", "multiple": str(network.multiple), **network.metadata}
    )
    program.save(path, external_data=False)


def largest_difference(network: Network, path: Path) -> float:
    """Return by how much a pixel of a file and of the network differ at most; NaN counts."""
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    differences = []
    for rows, columns, speed in SCENES:
        img0, img1 = _frames(network.channels, rows, columns, speed)
        for instant in (0.25, 0.7):
            given = {"img0": img0, "img1": img1, "timestep": np.array([instant], np.float32)}
            (found,) = session.run(None, given)
            with torch.no_grad():
                wanted = network.reference(*map(torch.from_numpy, given.values())).numpy()
            differences.append(np.abs(found - wanted).max())
    return float(np.max(differences))


def _frames(channels: int, rows: int, columns: int, speed: int) -> Iterator[NDArray[np.float32]]:
    """Yield two frames of random blobs that move to the left."""
    noise = np.random.default_rng(1).random((channels, rows, columns + speed), np.float32)
    blobs = np.stack([cv2.GaussianBlur(one, (0, 0), 16.0) for one in noise])
    blobs = (blobs - blobs.min()) / np.ptp(blobs)
    for part in (blobs[..., :columns], blobs[..., speed:]):
        yield np.ascontiguousarray(part[None])


def sample(frame: Tensor, flow: Tensor, ends: tuple[int, int], outside: str) -> Tensor:
    """Return what a frame holds at each pixel's own place plus the flow, interpolated linearly.

    Parameters
    ----------
    frame, flow : Tensor
        (1, channels, rows, columns) and (1, 2, rows, columns); the flow is columns, then rows.
    ends : tuple of int
        The row and column that mean the last ones: what is sampled is stretched about the first.
    outside : str
        What surrounds the frame: ``zeros``, or its ``border``.
    """
    rows, columns = frame.shape[2:]
    x = torch.arange(columns) + flow[:, 0]
    y = torch.arange(rows)[:, None] + flow[:, 1]
    places = torch.stack((x * (2 / ends[1]) - 1, y * (2 / ends[0]) - 1), 3)
    return functional.grid_sample(frame, places, padding_mode=outside, align_corners=True)

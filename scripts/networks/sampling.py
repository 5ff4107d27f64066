"""Frames sampled where a flow leads."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional


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

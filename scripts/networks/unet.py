"""A small U-Net with group normalisation, for trainings of minutes on one core.

It has 489,154 parameters for six channels and two classes.  It is normalised over groups of
channels, not over a batch: with batches of a few pictures the means of batch normalisation are too
rough to test with.  Needs PyTorch.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from typing import Any

from networks import torch_module

CHANNELS = 16, 32, 64, 128
_GROUPS = 8


def unet(classes: int, channels: int = 6) -> Any:
    """Return the net with weights by chance.

    It takes pictures (batch, channels, rows, columns), sides multiples of 8, and returns scores
    (batch, classes, rows, columns).
    """
    return _class(torch_module())(classes, channels)


@cache
def _class(torch: Any) -> Any:
    nn, functional = torch.nn, torch.nn.functional

    def pair(before: int, after: int) -> Any:
        layers = []
        for inputs in (before, after):
            layers += [nn.Conv2d(inputs, after, 3, padding=1), nn.GroupNorm(_GROUPS, after)]
            layers.append(nn.ReLU())
        return nn.Sequential(*layers)

    class UNet(nn.Module):
        def __init__(self, classes: int, channels: int) -> None:
            super().__init__()
            self.down = nn.ModuleList(pair(*both) for both in pairwise((channels, *CHANNELS)))
            self.up = nn.ModuleList(
                pair(below + beside, beside) for below, beside in pairwise(reversed(CHANNELS))
            )
            self.scores = nn.Conv2d(CHANNELS[0], classes, 1)

        def forward(self, x: Any) -> Any:
            skipped = []
            for number, step in enumerate(self.down):
                x = step(functional.max_pool2d(x, 2) if number else x)
                skipped.append(x)
            skipped.pop()
            for step in self.up:
                large = functional.interpolate(
                    x, scale_factor=2.0, mode="bilinear", align_corners=False
                )
                x = step(torch.cat([large, skipped.pop()], 1))
            return self.scores(x)

    return UNet

"""Ev-SegNet: which class each pixel is of, from the six channels of the events of 50 ms.

An encoder of the kind Xception and a light decoder.  The decoder takes the encoder at five sizes,
enlarges bilinearly (corners on corners) and adds; its blocks are three separable convolutions and
one of a pixel, with a shortcut; near the end lie parallel convolutions that reach far.

Written after the network that the authors train (``Segception_small``); what is not as there:

- weights begin as PyTorch has it, not as Keras has it, and none are of ImageNet (theirs neither);
- momenta of batch normalisation are the same numbers, written as PyTorch counts them.

The parameters of the encoder are as many as those of Keras's Xception.  The decay of weights that
the layers of the authors declare never reaches their loss, so there is none.  The six channels are
:func:`adv2e.representations.voxel_grid.event_image`.  Needs PyTorch.

References
----------
.. [1] I. Alonso, A. C. Murillo, "EV-SegNet: Semantic Segmentation for Event-based Cameras", CVPRW
   2019, arXiv:1811.12039; github.com/Shathe/Ev-SegNet.
.. [2] F. Chollet, "Xception: Deep Learning with Depthwise Separable Convolutions", CVPR 2017.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from networks import torch_module

CHANNELS = 6
ENCODER_PARAMETERS = 20_806_952
"""That are trained, with three channels, as Keras counts them for Xception without its top."""


def evsegnet(classes: int) -> Any:
    """Return the network with weights by chance.

    It takes pictures (batch, 6, rows, columns), two or more at a time while it is trained, sides
    multiples of 32, and returns scores (batch, classes, rows, columns).
    """
    return _classes(torch_module())[0](classes)


def xception(channels: int = CHANNELS) -> Any:
    """Return the encoder: from pictures to what lies at 1/2, 1/4, 1/8, 1/16 and 1/32."""
    return _classes(torch_module())[1](channels)


@cache
def _classes(torch: Any) -> tuple[Any, Any]:
    nn, functional = torch.nn, torch.nn.functional

    def separable(before: int, after: int, size: int = 3, dilation: Any = 1) -> Any:
        """Return a convolution of each channel by itself, then one of a pixel."""
        reach = dilation if isinstance(dilation, tuple) else (dilation, dilation)
        padding = tuple(size // 2 * one for one in reach)
        return nn.Sequential(
            nn.Conv2d(
                before, before, size, padding=padding, dilation=reach, groups=before, bias=False
            ),
            nn.Conv2d(before, after, 1, bias=False),
        )

    def plain(before: int, after: int, size: int, stride: int, padding: int = 0) -> Any:
        layer = nn.Conv2d(before, after, size, stride, padding, bias=False)
        return nn.Sequential(layer, nn.BatchNorm2d(after, eps=1e-3, momentum=0.01))

    def norm(layer: Any, channels: int) -> Any:
        return nn.Sequential(layer, nn.BatchNorm2d(channels, eps=1e-3, momentum=0.01))

    def halved(x: Any) -> Any:
        """Return maxima of 3x3, every second one, as TensorFlow pads them."""
        rows, columns = x.shape[2:]
        sides = (columns % 2, 1, rows % 2, 1)
        return functional.max_pool2d(functional.pad(x, sides, value=-torch.inf), 3, 2)

    class Stage(nn.Module):
        """Two separable convolutions; what comes out of them, and half its size plus a shortcut."""

        def __init__(self, before: int, middle: int, after: int, active: bool = True) -> None:
            super().__init__()
            self.first = norm(separable(before, middle), middle)
            self.second = norm(separable(middle, after), after)
            self.shortcut = plain(before, after, 1, 2)
            self.active = active

        def forward(self, x: Any) -> tuple[Any, Any]:
            start = torch.relu(x) if self.active else x
            full = self.second(torch.relu(self.first(start)))
            return full, halved(full) + self.shortcut(x)

    class Middle(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.steps = nn.ModuleList(norm(separable(728, 728), 728) for _ in range(3))

        def forward(self, x: Any) -> Any:
            start = x
            for step in self.steps:
                x = step(torch.relu(x))
            return x + start

    class Xception(nn.Module):
        def __init__(self, channels: int) -> None:
            super().__init__()
            self.first, self.second = plain(channels, 32, 3, 2), plain(32, 64, 3, 1)
            self.stages = nn.ModuleList(
                [Stage(64, 128, 128, active=False), Stage(128, 256, 256), Stage(256, 728, 728)]
            )
            self.middle = nn.Sequential(*(Middle() for _ in range(8)))
            self.last = Stage(728, 728, 1024)
            self.exit = nn.ModuleList(
                [norm(separable(1024, 1536), 1536), norm(separable(1536, 2048), 2048)]
            )

        def forward(self, x: Any) -> list[Any]:
            x = torch.relu(self.second(torch.relu(self.first(x))))
            found = []
            for stage in self.stages:
                full, x = stage(x)
                found.append(full)
            full, x = self.last(self.middle(x))
            found.append(full)
            found.append(self.exit[1](torch.relu(self.exit[0](x))))
            return found

    def active(layer: Any, channels: int) -> Any:
        normed = nn.BatchNorm2d(channels, eps=1e-3, momentum=0.007)
        return nn.Sequential(layer, normed, nn.LeakyReLU(0.3))

    def pixelwise(before: int, after: int) -> Any:
        return active(nn.Conv2d(before, after, 1, bias=False), after)

    class Block(nn.Module):
        def __init__(self, channels: int) -> None:
            super().__init__()
            double = 2 * channels
            self.steps = nn.Sequential(
                active(separable(channels, double), double),
                active(separable(double, double), double),
                active(separable(double, double), double),
                pixelwise(double, channels),
            )

        def forward(self, x: Any) -> Any:
            return self.steps(x) + x

    def blocks(before: int, after: int, count: int) -> Any:
        return nn.Sequential(pixelwise(before, after), *(Block(after) for _ in range(count)))

    class Far(nn.Module):
        """Parallel convolutions that reach far, and the mean of all pixels."""

        def __init__(self, channels: int) -> None:
            super().__init__()
            self.mean = active(separable(channels, channels, 1), channels)
            reaches = (4, 8, 16, (2, 8), (6, 3), (8, 2), (3, 6))
            self.parts = nn.ModuleList(
                active(separable(channels, channels, dilation=one), channels) for one in reaches
            )
            self.joined = pixelwise(channels, channels)

        def forward(self, x: Any) -> Any:
            total = self.mean(x.mean((2, 3), keepdim=True))
            for part in self.parts:
                total = total + part(x)
            return self.joined(total) + x

    def resized(x: Any, size: Any) -> Any:
        return functional.interpolate(x, tuple(size), mode="bilinear", align_corners=True)

    def enlarged(x: Any) -> Any:
        return resized(x, (2 * x.shape[2], 2 * x.shape[3]))

    class EvSegNet(nn.Module):
        def __init__(self, classes: int) -> None:
            super().__init__()
            self.encoder = Xception(CHANNELS)
            taken = ((2048, 128), (1024, 128), (728, 128), (256, 64), (128, 32))
            self.taken = nn.ModuleList(blocks(*pair, 1) for pair in taken)
            made = ((128, 128, 3), (128, 64, 3), (64, 32, 3), (32, 32, 1))
            self.made = nn.ModuleList(blocks(*one) for one in made)
            self.far = Far(32)
            self.scores = nn.Conv2d(32, classes, 1)

        def forward(self, x: Any) -> Any:
            found = [functional.leaky_relu(one, 0.3) for one in reversed(self.encoder(x))]
            x = self.taken[0](found[0])
            for step, take, seen in zip(self.made, self.taken[1:], found[1:], strict=True):
                if step is self.made[3]:
                    x = self.far(x)
                x = enlarged(x)
                x = step(x + resized(take(seen), x.shape[2:]))
            return enlarged(self.scores(x))

    return EvSegNet, Xception

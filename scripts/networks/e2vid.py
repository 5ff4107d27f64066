"""E2VID: reconstructs images from events by a recurrent U-Net, with 10,712,098 parameters.

A head of 32 channels, three encoders, two residual blocks, three decoders.  Each encoder halves the
picture, doubles the channels and ends in a convolutional LSTM; each decoder takes the sum of what
lies below it and of its encoder.  Every convolution but the head's and the LSTMs' is followed by
batch normalisation, that of the image, too.  Kernels are of 5 pixels, those of the LSTMs and of the
residual blocks of 3.  Decoders enlarge bilinearly first, which leaves no pattern of a chessboard.

Events go in as :func:`networks.firenet.grid_of` has them.  This is the net alone: weights come from
:mod:`experiments.images`.  Needs PyTorch, which this project itself never does.

References
----------
.. [1] H. Rebecq, R. Ranftl, V. Koltun, D. Scaramuzza, "High Speed and High Dynamic Range Video
   with an Event Camera", TPAMI 2021, doi:10.1109/TPAMI.2019.2963386; what the article does not
   tell (biases, the last normalisation) as in github.com/uzh-rpg/rpg_e2vid.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from typing import Any

from networks import torch_module
from networks.firenet import BINS

CHANNELS = 32, 64, 128, 256
"""Of the head and of the encoders."""
PARAMETERS = 10_712_098


def e2vid() -> Any:
    """Return the net with weights by chance.

    It takes grids (batch, bins, rows, columns) and the state that it returned before, None for
    zeros; it returns images (batch, 1, rows, columns) between 0 black and 1 white, and the next
    state.  Pictures whose sides are no multiples of 8 are mirrored at their ends.
    """
    return _class(torch_module())()


@cache
def _class(torch: Any) -> Any:
    nn, functional = torch.nn, torch.nn.functional

    def convolution(before: int, after: int, size: int, stride: int = 1) -> Any:
        layer = nn.Conv2d(before, after, size, stride, padding=size // 2, bias=False)
        return nn.Sequential(layer, nn.BatchNorm2d(after))

    class Encoder(nn.Module):
        def __init__(self, before: int, after: int) -> None:
            super().__init__()
            self.conv = convolution(before, after, 5, stride=2)
            self.gates = nn.Conv2d(2 * after, 4 * after, 3, padding=1)

        def forward(self, x: Any, state: Any) -> tuple[Any, Any]:
            x = torch.relu(self.conv(x))
            hidden, cell = (torch.zeros_like(x),) * 2 if state is None else state
            take, keep, show, new = self.gates(torch.cat([x, hidden], 1)).chunk(4, 1)
            cell = torch.sigmoid(keep) * cell + torch.sigmoid(take) * torch.tanh(new)
            return torch.sigmoid(show) * torch.tanh(cell), cell

    class Block(nn.Module):
        def __init__(self, channels: int) -> None:
            super().__init__()
            self.first = convolution(channels, channels, 3)
            self.second = convolution(channels, channels, 3)

        def forward(self, x: Any) -> Any:
            return torch.relu(self.second(torch.relu(self.first(x))) + x)

    class E2VID(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.head = nn.Conv2d(BINS, CHANNELS[0], 5, padding=2)
            self.encoders = nn.ModuleList(Encoder(*pair) for pair in pairwise(CHANNELS))
            self.blocks = nn.Sequential(Block(CHANNELS[-1]), Block(CHANNELS[-1]))
            self.decoders = nn.ModuleList(
                convolution(*pair, 5) for pair in pairwise(reversed(CHANNELS))
            )
            self.image = convolution(CHANNELS[0], 1, 1)

        def forward(self, grid: Any, state: Any = None) -> tuple[Any, Any]:
            rows, columns = grid.shape[2:]
            grid = functional.pad(grid, (0, -columns % 8, 0, -rows % 8), mode="reflect")
            head = x = torch.relu(self.head(grid))
            states = []
            for encoder, before in zip(self.encoders, state or [None] * 3, strict=True):
                states.append(encoder(x, before))
                x = states[-1][0]
            x = self.blocks(x)
            for decoder, (skipped, _) in zip(self.decoders, reversed(states), strict=True):
                large = functional.interpolate(
                    x + skipped, scale_factor=2.0, mode="bilinear", align_corners=False
                )
                x = torch.relu(decoder(large))
            image = torch.sigmoid(self.image(x + head))
            return image[..., :rows, :columns], states

    return E2VID

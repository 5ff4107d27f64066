"""How far images that are trained are from frames: L1 and structural similarity, or LPIPS.

LPIPS is how far apart two images look, by the features of AlexNet, from files of weights.

FOLDER holds two files that are not part of this repository:

- ``alexnet-owt-7be5be79.pth``, the weights that torchvision publishes at download.pytorch.org;
- ``alex.pth``, from ``lpips/weights/v0.1`` of github.com/richzhang/PerceptualSimilarity.

Grey images stand for three equal channels.  Needs PyTorch.

References
----------
.. [1] R. Zhang, P. Isola, A. Efros, E. Shechtman, O. Wang, "The Unreasonable Effectiveness of Deep
   Features as a Perceptual Metric", CVPR 2018, arXiv:1801.03924.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from adv2e.errors import DataError
from networks import damage_told, torch_module

_REACH, _SIGMA = 5, 1.5


def structural_loss(made: Any, wanted: Any) -> Any:
    """Return the mean absolute difference, plus 1 less the mean structural similarity.

    Both are (batch, 1, rows, columns), 0 black and 1 white, of 6 pixels a side or more.
    """
    return (made - wanted).abs().mean() + 1 - similarity(made, wanted)


def similarity(a: Any, b: Any) -> Any:
    """Return the mean of :func:`experiments.images.similarity` over a batch, differentiable."""
    torch = torch_module()
    functional = torch.nn.functional
    place = torch.arange(-_REACH, _REACH + 1, dtype=a.dtype, device=a.device)
    weights = torch.exp(-0.5 * (place / _SIGMA) ** 2)
    weights = weights / weights.sum()

    def mean(image: Any) -> Any:
        padded = functional.pad(image, (_REACH,) * 4, mode="reflect")
        rows = functional.conv2d(padded, weights.reshape(1, 1, -1, 1))
        return functional.conv2d(rows, weights.reshape(1, 1, 1, -1))

    at_a, at_b = mean(a), mean(b)
    spread = mean(a * a) - at_a**2 + mean(b * b) - at_b**2
    both = mean(a * b) - at_a * at_b
    light = (2 * at_a * at_b + 1e-4) / (at_a**2 + at_b**2 + 1e-4)
    return (light * (2 * both + 9e-4) / (spread + 9e-4)).mean()


BACKBONE, LINEAR = "alexnet-owt-7be5be79.pth", "alex.pth"
LAYERS = {0: (3, 64, 11, 4, 2), 3: (64, 192, 5, 1, 2), 6: (192, 384, 3, 1, 1),
          8: (384, 256, 3, 1, 1), 10: (256, 256, 3, 1, 1)}  # fmt: skip
"""Number in AlexNet's features: channels in and out, kernel, stride, padding."""
_POOLED = 3, 6
_SHIFT, _SCALE = (-0.030, -0.088, -0.188), (0.458, 0.448, 0.450)


class Lpips:
    """The distance, differentiable.

    Parameters
    ----------
    folder : Path
        Where both files are.
    """

    def __init__(self, folder: Path) -> None:
        torch = self._torch = torch_module()
        backbone, linear = (_read(torch, folder / name) for name in (BACKBONE, LINEAR))
        self._layers, self._weights = [], []
        for number, (at, (before, after, size, *_)) in enumerate(LAYERS.items()):
            key = f"features.{at}"
            weight = _of(folder / BACKBONE, backbone, f"{key}.weight", (after, before, size, size))
            bias = _of(folder / BACKBONE, backbone, f"{key}.bias", (after,))
            self._layers.append((weight, bias))
            key = f"lin{number}.model.1.weight"
            self._weights.append(_of(folder / LINEAR, linear, key, (1, after, 1, 1)))
        self._shift, self._scale = (
            torch.tensor(one).reshape(1, 3, 1, 1) for one in (_SHIFT, _SCALE)
        )

    def __call__(self, a: Any, b: Any) -> Any:
        """Return the distance of images (batch, 1, rows, columns), 0 black and 1 white: (batch,).

        Sides must be 64 pixels or more.
        """
        total = 0.0
        for at_a, at_b, weight in zip(*map(self._features, (a, b)), self._weights, strict=True):
            apart = (at_a - at_b) ** 2
            total = total + (apart * weight.to(apart)).sum(1).mean((1, 2))
        return total

    def _features(self, image: Any) -> list[Any]:
        functional = self._torch.nn.functional
        x = (2 * image - 1 - self._shift.to(image)) / self._scale.to(image)
        found = []
        for (at, (*_, stride, padding)), (weight, bias) in zip(
            LAYERS.items(), self._layers, strict=True
        ):
            if at in _POOLED:
                x = functional.max_pool2d(x, 3, 2)
            x = functional.conv2d(x, weight.to(x), bias.to(x), stride, padding).relu()
            found.append(x / (x.pow(2).sum(1, keepdim=True).sqrt() + 1e-10))
        return found


def _read(torch: Any, path: Path) -> Any:
    with damage_told(f"{path}: no weights of PyTorch"):
        return torch.load(path, map_location="cpu", weights_only=True)


def _of(path: Path, state: Any, key: str, shape: tuple[int, ...]) -> Any:
    value = state.get(key)
    if value is None or tuple(value.shape) != shape:
        raise DataError(f"{path}: {key}: needed in the shape {shape}; is this the file meant?")
    return value

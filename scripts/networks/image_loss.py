"""How far images that are trained are from frames: L1 and structural similarity, or LPIPS."""

from __future__ import annotations

from typing import Any

from networks import torch_module

_REACH, _SIGMA = 5, 1.5


def structural_loss(made: Any, wanted: Any) -> Any:
    """Return the mean absolute difference, plus 1 less the mean structural similarity.

    Both are (batch, 1, rows, columns), 0 black and 1 white, of 6 pixels a side or more.
    """
    return (made - wanted).abs().mean() + 1 - similarity(made, wanted)


def similarity(a: Any, b: Any) -> Any:
    """Return the mean of :func:`experiments.judge.similarity` over a batch, differentiable."""
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

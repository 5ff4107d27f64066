"""The steps of trainings of networks that tell classes of pixels."""

from __future__ import annotations

from typing import Any

import numpy as np
from networks import torch_module

from experiments.labels.labelled import IGNORED, Sample, Samples
from experiments.trainings.training import Update


def update_of(samples: Samples, batch: int, device: str, changed: bool) -> Update:
    """Return one step: pictures by chance, mirrored, and `changed` as Ev-SegNet does."""
    torch = torch_module()

    def update(net: Any, optimiser: Any, rng: np.random.Generator) -> float:
        chosen = rng.integers(len(samples), size=batch)
        pairs = [augmented(samples[int(k)], rng, changed) for k in chosen]
        pictures, labels = (
            torch.from_numpy(np.stack(one)).to(device) for one in zip(*pairs, strict=True)
        )
        optimiser.zero_grad()
        loss = loss_of(net(pictures), labels)
        loss.backward()
        optimiser.step()
        return float(loss.detach())

    return update


def loss_of(scores: Any, labels: Any) -> Any:
    """Return the mean cross entropy over pixels with a class."""
    functional = torch_module().nn.functional
    return functional.cross_entropy(scores, labels.long(), ignore_index=IGNORED)


def augmented(sample: Sample, rng: np.random.Generator, changed: bool) -> Sample:
    """Return a picture with its labels, mirrored in a half of all cases.

    With `changed` it is also made 0.5 to 2 times as large, shifted by a fifth at most, and turned
    by 10 degrees at most, by the nearest pixel; what comes from outside is 0, and of no class.
    """
    picture, label = sample
    if rng.random() < 0.5:
        picture, label = picture[..., ::-1], label[:, ::-1]
    if changed:
        rows, columns = label.shape
        scale, turn = rng.uniform(0.5, 2), np.deg2rad(rng.uniform(-10, 10))
        shift = rng.uniform(-0.2, 0.2, 2) * (rows, columns)
        y, x = np.indices(label.shape) - np.reshape([rows - 1, columns - 1], (2, 1, 1)) / 2
        y, x = y - shift[0], x - shift[1]
        from_y = (np.cos(turn) * y - np.sin(turn) * x) / scale + (rows - 1) / 2
        from_x = (np.sin(turn) * y + np.cos(turn) * x) / scale + (columns - 1) / 2
        at_y, at_x = (np.rint(one).astype(int) for one in (from_y, from_x))
        inside = (at_y >= 0) & (at_y < rows) & (at_x >= 0) & (at_x < columns)
        at_y, at_x = np.clip(at_y, 0, rows - 1), np.clip(at_x, 0, columns - 1)
        picture = np.where(inside, picture[:, at_y, at_x], np.float32(0))
        label = np.where(inside, label[at_y, at_x], np.uint8(IGNORED))
    return np.ascontiguousarray(picture), np.ascontiguousarray(label)

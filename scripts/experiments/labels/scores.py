"""How well a network tells the classes of pixels: accuracy, mIoU, and a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from networks import torch_module
from numpy.typing import NDArray

from experiments.labels.labelled import Sample, Samples

MEASURES = {"last accuracy": True, "last mIoU": True, "best accuracy": True, "best mIoU": True}
"""And whether larger is better."""


def confusion(net: Any, samples: Samples, classes: int, device: str) -> NDArray[np.int64]:
    """Return how many pixels of each class (rows) are said to be of each (columns)."""
    torch = torch_module()
    counts = np.zeros((classes, classes), np.int64)
    with torch.inference_mode():
        for number in range(len(samples)):
            picture, label = samples[number]
            said = net(torch.from_numpy(picture)[None].to(device))[0].argmax(0).cpu().numpy()
            known = label < classes
            pairs = classes * label[known].astype(np.int64) + said[known]
            counts += np.bincount(pairs, minlength=classes**2).reshape(classes, classes)
    return counts


def scores_of(counts: NDArray[np.int64]) -> dict[str, float]:
    """Return accuracy and mIoU."""
    hit = np.diag(counts)
    union = counts.sum(0) + counts.sum(1) - hit
    shares = hit / np.maximum(union, 1)
    return {"accuracy": float(hit.sum() / max(counts.sum(), 1)), "mIoU": float(shares.mean())}


def of_one_class(samples: Samples, classes: int) -> dict[str, float]:
    """Return accuracy and mIoU of saying the most common class of all pixels."""
    counts = np.zeros(classes, np.int64)
    for number in range(len(samples)):
        label = samples[number][1]
        counts += np.bincount(label[label < classes], minlength=classes)
    said = np.zeros((classes, classes), np.int64)
    said[:, counts.argmax()] = counts
    return scores_of(said)


def last_and_best(checks: Sequence[dict[str, float]]) -> dict[str, float]:
    """Return the measures of the last test and of the best one."""
    best = max(checks, key=lambda one: one["mIoU"])
    names = ("accuracy", "mIoU")
    return {
        f"{when} {name}": one[name]
        for when, one in (("last", checks[-1]), ("best", best))
        for name in names
    }


def picture(net: Any, sample: Sample) -> NDArray[np.uint8]:
    """Return labels, what a network says, and the number of events, side by side."""
    torch = torch_module()
    with torch.inference_mode():
        said = net(torch.from_numpy(sample[0])[None])[0].argmax(0).numpy()
    counts = sample[0][:2].max(0) / 2 + 0.5
    return np.rint(255 * np.hstack([sample[1] == 1, said == 1, counts])).astype(np.uint8)

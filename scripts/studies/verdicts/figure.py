"""The confusion matrix as a picture, a panel for each size."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from writing import load_pyplot, save_figure

from studies.verdicts import scoring
from studies.verdicts.camera import catalogue
from studies.verdicts.cases import LIBRARY, SIZES
from studies.verdicts.results import Line

VERDICTS = (scoring.UNEXPLAINED, scoring.MISSED, scoring.FAILED)


def confusion(lines: Sequence[Line]) -> NDArray[np.float64]:
    """Return how often each name was given for each effect, (effects, names and verdicts).

    A recording counts one for the name given; look-alikes share it evenly, and so do several
    names.  Rows and columns are in the catalogue's order, then come ``VERDICTS``.
    """
    order = list(catalogue.LIBRARY)
    matrix = np.zeros((len(order), len(order) + len(VERDICTS)))
    for one in lines:
        row, kind = order.index(one["effects"][0]), scoring.outcome(one)
        if kind in VERDICTS:
            matrix[row, len(order) + VERDICTS.index(kind)] += 1.0
            continue
        given = [*(found["name"] for found in one["found"]), *one["alternatives"]]
        for name in given:
            matrix[row, order.index(name)] += 1.0 / len(given)
    return matrix


def draw(lines: Sequence[Line], path: Path) -> None:
    """Write the figure."""
    panels = []
    for size in SIZES:
        found = [one for one in lines if one["kind"] == LIBRARY and one["size"] == size]
        if found:
            panels.append((size, found))
    count = max(1, len(panels))
    figure, axes = load_pyplot().subplots(
        1, count, figsize=(7.4 * count, 7.2), layout="constrained", squeeze=False
    )
    columns = [*catalogue.LIBRARY, *VERDICTS]
    for one, (size, found) in zip(axes[0], panels, strict=False):
        matrix = confusion(found)
        runs = np.maximum(matrix.sum(axis=1, keepdims=True), 1.0)
        one.imshow(matrix / runs, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
        for row, column in np.argwhere(matrix > 0):
            deep = matrix[row, column] / runs[row, 0] > 0.6
            one.text(
                column, row, f"{matrix[row, column]:.2g}", ha="center", va="center", fontsize=6,
                color="white" if deep else "black",
            )  # fmt: skip
        one.axvline(len(catalogue.LIBRARY) - 0.5, color="grey", lw=0.8)
        one.set_xticks(range(len(columns)), columns, rotation=90, fontsize=7)
        one.set_yticks(range(len(catalogue.LIBRARY)), catalogue.LIBRARY, fontsize=7)
        one.set(
            title=f"{size} size, {len(found)} recordings", xlabel="named", ylabel="in the recording"
        )
    save_figure(figure, path)

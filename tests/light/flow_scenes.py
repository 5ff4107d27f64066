"""Light of small scenes of which every instant is known."""

from __future__ import annotations

import numpy as np

ROWS, COLUMNS = 64, 80


def clouds(seed: int, contrast: float = 0.5):
    """Return a smooth random texture, a function of columns and rows: light about 80 DN."""
    rng = np.random.default_rng(seed)
    waves = rng.normal(0.0, 0.35, (40, 2))
    phases = rng.uniform(0, 2 * np.pi, 40)
    sizes = 1.0 / (0.3 + np.hypot(*waves.T))
    sizes *= contrast * np.sqrt(2.0 / np.sum(sizes**2))

    def light(x, y):
        arguments = waves[:, 0, None, None] * x + waves[:, 1, None, None] * y
        return 80.0 * np.exp(np.tensordot(sizes, np.sin(arguments + phases[:, None, None]), 1))

    return light


GROUND, FIGURE = clouds(1), clouds(2)


def pixels(rows=ROWS, columns=COLUMNS):
    return np.meshgrid(np.arange(columns, dtype=float), np.arange(rows, dtype=float))


def pan(t, step=(4.0, -1.5), rows=ROWS, columns=COLUMNS):
    """Return a texture that moves by `step` pixels from t = 0 to 1."""
    x, y = pixels(rows, columns)
    return GROUND(x - step[0] * t, y - step[1] * t).astype(np.float32)


def disk(t, start=30.0, step=6.0, radius=11.0, row=32.0):
    """Return a textured disk that moves by `step` columns over a texture at rest."""
    x, y = pixels()
    column = start + step * t
    inside = np.clip(0.5 + radius - np.hypot(x - column, y - row), 0.0, 1.0)
    light = (1.0 - inside) * GROUND(x, y) + inside * 2.0 * FIGURE(x - column, y - row)
    return light.astype(np.float32)

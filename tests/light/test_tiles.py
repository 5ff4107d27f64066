"""Tiles: together they are the picture, whatever its size."""

import numpy as np
import pytest

from adv2e.light.interpolation import network as module
from adv2e.light.interpolation.network import Axis, in_tiles


@pytest.mark.parametrize("length", [1, 31, 32, 33, 100, 1024, 1025, 1100, 2160, 3840])
@pytest.mark.parametrize(("fixed", "multiple"), [(None, 32), (None, 1), (None, 100), (64, 32)])
def test_every_pixel_lies_in_a_tile_and_neighbours_have_enough_in_common(length, fixed, multiple):
    axis = Axis(length, fixed, multiple)
    assert axis.size == fixed or axis.size % multiple == 0
    assert axis.size <= (fixed or 1024)
    weights = np.zeros(axis.padded)
    for tile in axis.tiles:
        assert tile.weight.shape == (axis.size,)
        assert np.all(tile.weight > 0)
        assert np.all(tile.weight <= 1)
        weights[tile.start : tile.start + axis.size] += tile.weight
    assert axis.padded >= length
    assert np.all(weights > 0)
    for one, two in zip(axis.tiles[:-1], axis.tiles[1:], strict=True):
        assert one.start + axis.size - two.start >= min(128, axis.size // 4)
    # one more than needed would be work for nothing
    if len(axis.tiles) > 1:
        common = min(128, axis.size // 4)
        assert axis.size + (len(axis.tiles) - 2) * (axis.size - common) < axis.padded


@pytest.mark.parametrize("shape", [(1, 1), (5, 70), (64, 64), (65, 64), (200, 333)])
@pytest.mark.parametrize("fixed", [(None, None), (48, 40), (None, 40)])
def test_what_depends_on_the_pixel_alone_is_the_same_in_tiles(monkeypatch, shape, fixed):
    monkeypatch.setattr(module, "LARGEST", 64)
    rng = np.random.default_rng(2)
    a, b = rng.random((2, *shape)).astype(np.float32)
    sizes = []

    def ask(one, two):
        sizes.append(one.shape)
        assert one.flags.c_contiguous
        return one + 2 * two

    made = in_tiles((a, b), ask, fixed, 16)
    assert made.shape == shape
    np.testing.assert_allclose(made, a + 2 * b, rtol=3e-7)
    for rows, columns in sizes:
        assert rows == fixed[0] or (rows % 16 == 0 and rows <= 64)
        assert columns == fixed[1] or (columns % 16 == 0 and columns <= 64)
    assert len(set(sizes)) == 1


def test_a_picture_is_padded_with_its_border():
    picture = np.arange(6, dtype=np.float32).reshape(2, 3)
    seen = []
    in_tiles((picture,), lambda one: seen.append(one) or one, (None, None), 4)
    assert seen[0].tolist() == [[0, 1, 2, 2], [3, 4, 5, 5], [3, 4, 5, 5], [3, 4, 5, 5]]


def test_there_is_no_seam_where_tiles_disagree(monkeypatch):
    monkeypatch.setattr(module, "LARGEST", 64)
    picture = np.zeros((64, 400), np.float32)
    count = iter(range(100))
    made = in_tiles((picture,), lambda one: one + next(count), (None, None), 16)
    steps = np.abs(np.diff(made[0]))
    assert made[0, 0] == 0
    assert made[0, -1] == made.max() > 5
    # each tile is 1 more than the one before, and they have 16 pixels in common
    assert steps.max() < 1.5 / 16

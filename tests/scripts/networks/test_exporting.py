"""A network becomes a file that was run, or no file."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="PyTorch (extra torch) is too large to install for all")
pytest.importorskip("onnxscript", reason="is of the extra torch")

from networks import exporting  # noqa: E402

from adv2e.errors import OutputError  # noqa: E402


class Blend(torch.nn.Module):
    def forward(self, img0, img1, timestep):
        t = timestep.reshape(1, 1, 1, 1)
        return (1 - t) * img0 + t * img1


@pytest.mark.parametrize(
    ("reference", "told"),
    [
        (lambda img0, img1, timestep: (img0 + img1) / 2, "0.18, more than"),
        (lambda img0, img1, timestep: img0 * torch.nan, "nan"),
    ],
)
def test_a_file_that_does_something_else_is_not_written(tmp_path, reference, told):
    network = exporting.Network(Blend().eval(), reference, 1, 32, {})
    output = tmp_path / "a.onnx"
    output.write_bytes(b"before")
    with pytest.raises(OutputError, match=f"ONNX and PyTorch differ by up to {told}"):
        exporting.export(lambda: network, tmp_path / "in", output, overwrite=True)
    assert [path.name for path in tmp_path.iterdir()] == ["a.onnx"]
    assert output.read_bytes() == b"before"


def test_frames_that_are_compared_move_and_use_the_range():
    for rows, columns, speed in exporting.SCENES:
        img0, img1 = exporting._frames(3, rows, columns, speed)
        assert img0.shape == img1.shape == (1, 3, rows, columns)
        assert img0.dtype == np.float32
        assert np.ptp(np.stack((img0, img1))) > 0.9
        np.testing.assert_array_equal(img0[..., speed:], img1[..., : columns - speed])

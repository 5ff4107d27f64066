#!/usr/bin/env python
"""Write the network Super SloMo as a file of ONNX, for ``sampling.interpolation: onnx``.

CHECKPOINT holds the weights that v2e uses (grey), or those of github.com/avinashpaliwal/Super-SloMo
(colour); which of them is seen from their shapes::

    python scripts/export_superslomo.py SuperSloMo39.ckpt -o superslomo.onnx

The file takes frames as they lie in video files, and makes the frame at any instant between them.
What else was decided, and why, is told in ``networks/superslomo.py``.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import click
from networks import late, output_options
from writing import one_line_errors


@click.command()
@click.argument("checkpoint", type=click.Path(path_type=Path))
@output_options
@click.option(
    "--mean", type=click.FloatRange(0, 1),
    help="What the network subtracts from frames.  0 does as v2e does without a GPU.  [default: as "
    "in training; 0.428 for grey, 0.429, 0.431 and 0.397 for colour]",
)  # fmt: skip
@one_line_errors()
def main(checkpoint: Path, output: Path, overwrite: bool, mean: float | None) -> None:
    """Write Super SloMo as a file of ONNX.

    CHECKPOINT is what PyTorch stored, with `state_dictFC` and `state_dictAT`.  Nothing in it is
    run.  The file of ONNX is run beside PyTorch before it gets its name.  Needs the extra `torch`.
    """
    load = partial(late("superslomo").load, checkpoint, mean)
    late("exporting").export(load, checkpoint, output, overwrite=overwrite)


if __name__ == "__main__":
    main()

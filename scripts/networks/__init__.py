"""Networks: two that interpolate between frames, as files of ONNX, and those that events go into.

FireNet (:mod:`networks.firenet`) and others are built where they are used.  RIFE and Super SloMo
are exported, and every file of ONNX keeps the same contract.  Its inputs are ``img0`` and ``img1``
of shape (1, channels, rows, columns) in [0, 1], and ``timestep`` of shape (1,), strictly between 0
and 1: 0 is the instant of ``img0``.  Its output is ``output``, shaped like ``img0``.  All are
float32.  Rows and columns are free, but must be multiples of ``multiple`` in the metadata.
``encoding`` there says what the numbers are: ``srgb``, as in video files.  ``source`` and
``sha256`` name the file of the weights.
"""

from __future__ import annotations

import importlib
import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from adv2e.errors import DataError, MissingExtraError


def output_options(body: Callable[..., None]) -> Callable[..., None]:
    """Add -o and --overwrite: where a network is written."""
    body = click.option("--overwrite", is_flag=True, help="Replace a file that exists.")(body)
    return click.option(
        "-o", "--output", type=click.Path(path_type=Path), metavar="FILE.onnx", required=True,
        help="Where the network is written.",
    )(body)  # fmt: skip


def late(name: str) -> Any:
    """Return a module of this package that needs PyTorch."""
    try:
        return importlib.import_module(f"networks.{name}")
    except ImportError as error:
        raise MissingExtraError("the export of a network", "torch") from error


def torch_module() -> Any:
    """Return PyTorch."""
    try:
        return importlib.import_module("torch")
    except ImportError as error:
        raise MissingExtraError("a network of PyTorch", "experiments") from error


_DAMAGED = pickle.UnpicklingError, EOFError, LookupError, RuntimeError, TypeError, ValueError


@contextmanager
def damage_told(complaint: str) -> Iterator[None]:
    """Turn what PyTorch raises for files that it did not write, or not so, into one line."""
    try:
        yield
    except _DAMAGED as error:
        reason = str(error).strip().partition("\n")[0]
        raise DataError(f"{complaint} ({reason})") from error

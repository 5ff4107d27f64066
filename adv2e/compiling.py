"""Compiling in a process of its own, so that its memory goes when it is done.

The compiler takes some 600 MiB, most of which stays with the process that it ran in; a first
conversion would hold it to its end, which may be hours away.  A conversion of a few small frames,
with all that decides what code is needed, fills the cache from which the large one then loads.

``python -m adv2e.compiling`` reads what to convert like from standard input, as JSON.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config, from_dict, to_dict
from adv2e.garbage import collect_seldom
from adv2e.jit import keeps_code

_ROWS, _COLUMNS = 40, 64
"""Of the small frames; large enough for motion to be looked for."""


def compile_apart(
    config: Config,
    *,
    dtype: np.dtype[Any],
    colour: bool,
    encoding: str,
    format: str,
    layout: str | None,
    threads: int,
) -> None:
    """Compile what a conversion needs, in another process; wait for it.

    It may fail, or leave something out: what is not there is compiled when it is needed.  Nothing
    is done where this process would not find the code.

    Parameters
    ----------
    config : Config
        Without effects of the user's own.
    dtype, colour, encoding
        Of the frames; see :class:`adv2e.sources.base.Source`.
    format, layout
        Of the output; see :func:`adv2e.sinks.open_sink`.
    threads : int
        Of the conversion.
    """
    if not keeps_code():
        return
    values = to_dict(config)
    values["frames"]["encoding"] = encoding
    request = {
        "config": values,
        "dtype": dtype.str,
        "colour": colour,
        "format": format,
        "layout": layout,
        "threads": threads,
    }
    with suppress(OSError):
        subprocess.run(
            [sys.executable, "-m", "adv2e.compiling"],
            input=json.dumps(request).encode(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            check=False,
        )


def _frames(dtype: np.dtype[Any], colour: bool) -> NDArray[Any]:
    """Return frames with a texture that moves."""
    y, x = np.mgrid[:_ROWS, :_COLUMNS]
    white = 200.0 if dtype.kind in "ui" else 0.8
    waves = [np.sin((x - 2 * k) / 3.0) * np.sin((y + k) / 4.0) for k in range(4)]
    frames = (white * (0.5 + 0.45 * np.array(waves))).astype(dtype)
    return np.repeat(frames[..., None], 3, axis=3) if colour else frames


def main() -> None:
    """Convert small frames as the request says."""
    # late: they need the compiler's run-time, which the conversion has anyway
    from adv2e.pipeline import convert  # noqa: PLC0415
    from adv2e.reading import Reading  # noqa: PLC0415

    collect_seldom()
    request = json.load(sys.stdin)
    with tempfile.TemporaryDirectory(prefix="adv2e-compiling-") as folder:
        source = Path(folder) / "frames.npy"
        np.save(source, _frames(np.dtype(request["dtype"]), request["colour"]))
        target = str(Path(folder) / "events")
        how = {key: request[key] for key in ("format", "layout")}
        with Reading(str(source), fps=100.0, threads=request["threads"]) as reading:
            convert(reading, target, config=from_dict(request["config"]), **how)


if __name__ == "__main__":
    main()

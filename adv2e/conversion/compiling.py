"""Compiling in a process of its own, so that its memory goes when it is done.

The compiler takes some 600 MiB, most of which stays with the process that it ran in; a first
conversion would hold it to its end, which may be hours away.  A conversion of a few small frames,
with all that decides what code is needed, fills the cache from which the large one then loads.

The process reads what to convert like, a line of JSON, from its standard input, and ends when that
is closed: so it never outlives the one that waits for it.
"""

from __future__ import annotations

import io
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import environment, others_find_code
from adv2e.config import Config, from_dict, to_dict
from adv2e.process.memory import collect_seldom

_ROWS, _COLUMNS = 40, 64
"""Of the small frames; large enough for motion to be looked for."""

_START = """\
import sys
sys.path[:] = sys.argv[2:]
from importlib.util import module_from_spec, spec_from_file_location
spec = spec_from_file_location("adv2e", sys.argv[1])
sys.modules["adv2e"] = module_from_spec(spec)
spec.loader.exec_module(sys.modules["adv2e"])
from adv2e.conversion.compiling import main
main()
"""
"""What the process runs: this very package, and all else from where this process has it."""


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
        Of the output; see :func:`adv2e.formats.writing.open_sink`.
    threads : int
        Of the conversion.
    """
    # an application that brings its own Python along would start itself
    if not others_find_code() or not sys.executable or getattr(sys, "frozen", False):
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
        child = subprocess.Popen(
            _command(),
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=environment(),
        )
        with child:
            assert child.stdin is not None
            child.stdin.write(json.dumps(request).encode() + b"\n")
            child.stdin.flush()
            child.wait()


def _command() -> list[str]:
    """Return how to start a Python that imports nothing from the current folder.

    With ``-I`` it looks neither there nor where variables of the environment say, also while it
    starts; then it is told where this one looks.
    """
    package = Path(__file__).absolute().parents[1] / "__init__.py"
    set_here = {"-S": sys.flags.no_site, "-B": sys.dont_write_bytecode}
    options = ["-I", *(option for option, is_set in set_here.items() if is_set)]
    places = [place for place in sys.path if Path(place).is_absolute() and not _is_here(place)]
    return [sys.executable, *options, "-c", _START, str(package), *places]


def _is_here(place: str) -> bool:
    try:
        return Path(place).samefile(".")
    except OSError:
        return False


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
    from adv2e.conversion.pipeline import convert  # noqa: PLC0415
    from adv2e.conversion.reading import Reading  # noqa: PLC0415

    collect_seldom()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of Ctrl-C, the one that waits is told, too
    with (
        open(0, "rb", buffering=0, closefd=False) as asked,
        tempfile.TemporaryDirectory(prefix="adv2e-compiling-") as folder,
    ):
        request = json.loads(asked.readline())
        threading.Thread(target=_end_with, args=(asked, folder), daemon=True).start()
        source = Path(folder) / "frames.npy"
        np.save(source, _frames(np.dtype(request["dtype"]), request["colour"]))
        target = str(Path(folder) / "events")
        how = {key: request[key] for key in ("format", "layout")}
        with Reading(str(source), fps=100.0, threads=request["threads"]) as reading:
            convert(reading, target, config=from_dict(request["config"]), **how)


def _end_with(asked: io.RawIOBase, folder: str) -> None:
    """End this process when the other end of its standard input is closed."""
    asked.read(1)
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(1)

"""Compile what tests compute with, so that no test waits for it.

``python tests/warm.py`` does so for all tests that follow, in two processes.
"""

from __future__ import annotations

import subprocess
import sys

import numpy as np

FORMS = {
    "lanes": ["sampling.interpolation=flow"],
    "steps": ["pixel.low_pass.update=paper"],
    "lines": ["pixel.low_pass=null"],
    "cascade": ["pixel.source_follower.cutoff_hz=900", "pixel.photoreceptor_noise.rms=0.03"],
}
"""Options that need each of the pixel's solvers, and all else that is compiled and takes long."""

SHARES = (("lanes", "steps"), ("cascade", "lines"))
"""Forms that one process compiles: each share takes about as long."""


def compile_solver(form: str) -> None:
    """Compile one form of the solver, if it is not compiled yet."""
    from adv2e.config import load_config
    from adv2e.conversion.simulation import simulate

    frames = np.random.default_rng(0).random((3, 16, 20), np.float32)
    for _ in simulate(frames, [0.0, 0.1, 0.2], load_config([], FORMS[form]), threads=1):
        pass


def main() -> int:
    """Compile all forms; return how many processes failed."""
    started = [subprocess.Popen([sys.executable, __file__, *share]) for share in SHARES]
    return sum(process.wait() != 0 for process in started)


if __name__ == "__main__":
    for form in sys.argv[1:]:
        compile_solver(form)
    if not sys.argv[1:]:
        sys.exit(main())

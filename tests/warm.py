"""Compile the forms of the pixel's solver that tests use, so that no test waits for it.

``python tests/warm.py`` compiles each form in a process of its own, once for all tests that follow.
"""

from __future__ import annotations

import subprocess
import sys

import numpy as np

FORMS = ("exact", "paper")


def compile_solver(form: str) -> None:
    """Compile one form of the solver, if it is not compiled yet."""
    from adv2e.config import load_config
    from adv2e.conversion.simulation import simulate

    config = load_config([], [f"pixel.low_pass.update={form}"])
    for _ in simulate(np.zeros((3, 4, 5), np.float32), [0.0, 0.1, 0.2], config, threads=1):
        pass


def main() -> int:
    """Compile all forms side by side; return how many failed."""
    started = [subprocess.Popen([sys.executable, __file__, form]) for form in FORMS]
    return sum(process.wait() != 0 for process in started)


if __name__ == "__main__":
    if sys.argv[1:]:
        compile_solver(sys.argv[1])
    else:
        sys.exit(main())

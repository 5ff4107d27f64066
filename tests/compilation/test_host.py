"""What a library may not do to the process that imports it."""

import subprocess
import sys

WATCHED = """
import ctypes, gc, sys, threading
thresholds, threads = gc.get_threshold(), threading.active_count()
ctypes.CDLL = None  # whoever tunes the allocator needs it
import numpy as np
ctypes.CDLL = None
import adv2e, adv2e.compiled, adv2e.conversion.pipeline, adv2e.conversion.reading
import adv2e.pixel.array, adv2e.formats.reading, adv2e.rendering
assert gc.get_threshold() == thresholds and not gc.get_freeze_count()
assert threading.active_count() == threads
print("numba" in sys.modules)
"""


def test_importing_makes_no_folder_and_sets_nothing(tmp_path):
    environment = {
        "HOME": str(tmp_path),
        "TMPDIR": str(tmp_path),
        "PATH": "",
        "NUMBA_CACHE_DIR": "",
    }
    command = [sys.executable, "-B", "-c", WATCHED]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "False\n", "")
    assert list(tmp_path.iterdir()) == []

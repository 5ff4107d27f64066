"""Parts of a solver are compiled by a second process, where no code is kept yet."""

import json
import os
import subprocess
import sys

import pytest

from adv2e.compilation.ahead import compiled_beside

COMPILED = """
import json, sys
import numpy as np
from adv2e.compiled import code_cache
from adv2e.config import load_config
from adv2e.conversion.simulation import simulate
from adv2e.compilation import compiler

import numba.core.event as event

names = []

class Listener(event.Listener):
    def on_start(self, one):
        names.append(one.data["dispatcher"].py_func.__name__)

    def on_end(self, one):
        pass

event.register("numba:compile", Listener())
frames = np.random.default_rng(0).random((3, 16, 20), np.float32)
config = load_config([], sys.argv[1:])
events = [one for one in simulate(frames, [0.0, 0.1, 0.2], config, threads=1)]
kept = sorted(path.name for path in (code_cache().folder / "parts").iterdir())
print(json.dumps({"compiled": names, "kept": kept, "events": sum(one.size for one in events)}))
"""


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("options", "parts"),
    [
        ([], {"decide", "choose", "release"}),
        (["pixel.low_pass.update=paper"], {"fire_step", "first_reach"}),
        (["pixel.source_follower.cutoff_hz=900"], {"draw", "find_places", "sample"}),
    ],
)
def test_a_solver_is_compiled_in_two_processes(tmp_path, options, parts):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", COMPILED, *options]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert not parts & set(told["compiled"])
    assert parts <= {name.rpartition(".")[2] for name in told["kept"]}
    assert told["events"] > 100


@pytest.mark.parametrize("executable", ["", os.devnull, sys.executable])
def test_a_second_process_that_compiles_nothing_does_no_harm(monkeypatch, executable):
    monkeypatch.setattr(sys, "executable", executable)
    with compiled_beside([("no.such.module", "function", ())]):
        pass


def test_an_error_beside_it_ends_the_second_process():
    with pytest.raises(ZeroDivisionError), compiled_beside([]):
        raise ZeroDivisionError

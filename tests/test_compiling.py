"""Compiling in a process of its own: it makes all that a conversion then needs."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from adv2e import compiling
from adv2e.config import Config, load_config
from adv2e.pipeline import _compile_apart
from adv2e.sinks import format_name
from adv2e.sources import open_source
from adv2e.synthetic import Scene
from adv2e.synthetic.clips import write_video

CODE = """
import gc, sys
{body}
gc.unfreeze()
from adv2e.jit import _Entry
from adv2e.machine_code import described
for one in gc.get_objects():
    if type(one) is _Entry:
        for kind in one._calls:
            print("code", one.__module__, one.__name__, described(kind))
print("numba" in sys.modules)
"""
CONVERSION = """
from adv2e.cli import main
try:
    main(sys.argv[1:])
except SystemExit as end:
    assert not end.code
"""
SMALL = "from adv2e.compiling import main; main()"


def codes(body, *arguments, request=""):
    """Return all code that a process loaded or compiled, and whether it imported Numba."""
    done = subprocess.run(
        [sys.executable, "-c", CODE.format(body=body), *map(str, arguments)],
        input=request,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    return {line for line in lines if line.startswith("code ")}, lines[-1]


@pytest.fixture
def sources(tmp_path):
    """Inputs of several kinds, by name."""
    rng = np.random.default_rng(1)
    grey = rng.integers(0, 255, (6, 36, 52), np.uint8)
    np.save(tmp_path / "grey.npy", grey)
    np.save(tmp_path / "deep.npy", grey.astype(np.uint16) * 200)
    np.save(tmp_path / "float.npy", np.stack([grey / 255.0] * 3, axis=3).astype(np.float32))
    write_video(Scene(), tmp_path / "clip.avi", width=64, height=48, fps=30.0, duration_s=0.3)
    return tmp_path


@pytest.mark.parametrize(
    ("name", "target", "sets"),
    [
        ("clip.avi", "out.h5", []),
        ("clip.avi", "out.txt", ["sampling.L=1"]),
        ("clip.avi", "out.zip", ["sampling.interpolation=flow", "sampling.L=3"]),
        ("grey.npy", "out.h5", ["sampling.L=1"]),
        ("grey.npy", "out.h5", ["pixel.source_follower.cutoff_hz=500"]),
        ("deep.npy", "out.txt", ["pixel.low_pass.update=first_order_hold"]),
        ("float.npy", "out", ["frames.full_scale=1"]),
    ],
)
def test_nothing_is_left_to_compile(sources, monkeypatch, name, target, sets):
    requests = []

    def run(command, *, input, **options):
        assert command == [sys.executable, "-m", "adv2e.compiling"]
        requests.append(input.decode())

    source = open_source(sources / name, fps=None if name.endswith("avi") else 50.0)
    with monkeypatch.context() as patch:
        patch.setattr(compiling.subprocess, "run", run)
        _compile_apart(source, load_config([], sets), format_name(Path(target), None), None, 2)
    made, _ = codes(SMALL, request=requests[0])
    rate = [] if name.endswith("avi") else ["--fps", "50"]
    options = [option for one in sets for option in ("--set", one)]
    arguments = ["convert", sources / name, "-o", sources / target, "--threads", "2", *rate]
    needed, asked_numba = codes(CONVERSION, *arguments, *options)
    assert len(needed) > 5
    assert needed <= made
    assert asked_numba == "False"


def test_a_conversion_has_it_compiled_elsewhere_once(adv2e, sources, monkeypatch):
    asked = []
    monkeypatch.setattr(compiling, "compile_apart", lambda config, **how: asked.append(how))
    monkeypatch.setattr("adv2e.pipeline.is_compiled", lambda config: False)
    outcome = adv2e("convert", sources / "clip.avi", "-o", sources / "a.txt")
    assert (outcome.status, len(asked)) == (0, 1)
    assert (asked[0]["colour"], asked[0]["encoding"]) == (True, "srgb")
    assert (asked[0]["format"], asked[0]["layout"]) == ("txt", None)
    monkeypatch.setattr("adv2e.pipeline.is_compiled", lambda config: True)
    adv2e("convert", sources / "clip.avi", "-o", sources / "b.txt")
    assert len(asked) == 1
    monkeypatch.setattr("adv2e.pipeline.is_compiled", lambda config: False)
    adv2e("convert", sources / "clip.avi", "-o", "-")
    adv2e("convert", sources / "clip.avi", "-o", sources / "c.out", "--format", "h5")
    assert [one["format"] for one in asked[1:]] == ["txt", "h5"]
    assert (sources / "a.txt").read_bytes() == (sources / "b.txt").read_bytes()


def test_a_compiler_that_fails_is_no_error(monkeypatch, capfd):
    monkeypatch.setattr(compiling, "to_dict", lambda config: {"frames": {}, "nonsense": 1})
    compile_for_test()
    monkeypatch.setattr(compiling.sys, "executable", "/no/such/python")
    compile_for_test()
    monkeypatch.setattr(compiling, "keeps_code", lambda: False)  # nobody would find it
    monkeypatch.setattr(compiling.subprocess, "run", None)
    compile_for_test()
    assert capfd.readouterr() == ("", "")


def compile_for_test():
    compiling.compile_apart(
        Config(),
        dtype=np.dtype(np.uint8),
        colour=False,
        encoding="linear",
        format="h5",
        layout=None,
        threads=1,
    )

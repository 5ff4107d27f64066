"""Compiling in a process of its own: it makes all that a conversion then needs."""

import io
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from processes import running_python
from threads import wait_until

from adv2e.config import Config, load_config
from adv2e.conversion import compiling
from adv2e.conversion.pipeline import _compile_apart
from adv2e.formats.writing import format_name
from adv2e.light.decoding import encoding_for
from adv2e.sources import open_source
from adv2e.synthetic import Scene
from adv2e.synthetic.clips import write_video

CODE = """
import gc, sys
{body}
gc.unfreeze()
from adv2e.compiled import _Entry
from adv2e.compilation.machine_code import described
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
SMALL = "from adv2e.conversion.compiling import main; main()"


def codes(body, *arguments, request=""):
    """Return all code that a process loaded or compiled, and whether it imported Numba."""
    with running_python(
        CODE.format(body=body), *arguments, stdin=subprocess.PIPE, text=True
    ) as process:
        process.stdin.write(request)
        process.stdin.flush()
        said, errors = process.stdout.read(), process.stderr.read()  # its input stays open
        assert process.wait() == 0, errors
    lines = said.splitlines()
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

    class Child:
        def __init__(self, command, **options):
            self.stdin = io.BytesIO()

        def __enter__(self):
            return self

        def __exit__(self, *error):
            pass

        def wait(self):
            requests.append(self.stdin.getvalue().decode())

    source = open_source(sources / name, fps=None if name.endswith("avi") else 50.0)
    with monkeypatch.context() as patch:
        patch.setattr(compiling.subprocess, "Popen", Child)
        config, form = load_config([], sets), format_name(Path(target), None)
        encoding = encoding_for(config.frames, source.encoding)
        _compile_apart(source, config, encoding, form, None, 2)
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
    monkeypatch.setattr("adv2e.conversion.pipeline.is_compiled", lambda config: False)
    outcome = adv2e("convert", sources / "clip.avi", "-o", sources / "a.txt")
    assert (outcome.status, len(asked)) == (0, 1)
    assert (asked[0]["colour"], asked[0]["encoding"]) == (True, "srgb")
    assert (asked[0]["format"], asked[0]["layout"]) == ("txt", None)
    monkeypatch.setattr("adv2e.conversion.pipeline.is_compiled", lambda config: True)
    adv2e("convert", sources / "clip.avi", "-o", sources / "b.txt")
    assert len(asked) == 1
    monkeypatch.setattr("adv2e.conversion.pipeline.is_compiled", lambda config: False)
    adv2e("convert", sources / "clip.avi", "-o", "-")
    adv2e("convert", sources / "clip.avi", "-o", sources / "c.out", "--format", "h5")
    assert [one["format"] for one in asked[1:]] == ["txt", "h5"]
    assert (sources / "a.txt").read_bytes() == (sources / "b.txt").read_bytes()


def test_a_compiler_that_fails_is_no_error(monkeypatch, capfd):
    monkeypatch.setattr(compiling, "to_dict", lambda config: {"frames": {}, "nonsense": 1})
    compile_for_test()
    monkeypatch.setattr(compiling.sys, "executable", "/no/such/python")
    compile_for_test()
    monkeypatch.setattr(compiling.subprocess, "Popen", None)
    with monkeypatch.context() as patch:
        patch.setattr(compiling, "others_find_code", lambda: False)
        compile_for_test()
    with monkeypatch.context() as patch:
        patch.setattr(compiling.sys, "frozen", True, raising=False)  # it would start itself
        compile_for_test()
    monkeypatch.setattr(compiling.sys, "executable", None)
    compile_for_test()
    assert capfd.readouterr() == ("", "")


@pytest.fixture
def traps(tmp_path):
    """A folder whose files tell when they are run, named like what is imported."""
    folder = tmp_path / "traps"
    (folder / "encodings").mkdir(parents=True)
    names = ["adv2e", "json", "numpy", "numba", "click", "typing", "os", "site", "struct", "tqdm"]
    for name in (*names, "sitecustomize", "usercustomize", "threading", "encodings/__init__"):
        (folder / f"{name}.py").write_text(f"print('ran {name}', flush=True)\nraise SystemExit(9)")
    return folder


def compiler_in(folder, environment, monkeypatch):
    """Return what a compiling process says to a wrong request, with all imported before."""
    with monkeypatch.context() as patch:
        patch.chdir(folder)
        command = compiling._command()
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(
        command, cwd=folder, env={**os.environ, **environment}, text=True, **pipes
    ) as process:
        process.stdin.write('{"dtype": "nonsense"}\n')
        process.stdin.flush()
        out, errors = process.stdout.read(), process.stderr.read()  # its input stays open
        status = process.wait(timeout=60)
    return status, out, errors.splitlines()[-1]


@pytest.mark.parametrize("path", [None, "", ".", "{here}", ":/nowhere:"])
def test_the_compiler_imports_nothing_from_the_current_folder(traps, monkeypatch, path):
    before = [] if path is None else [path.format(here=traps)]
    monkeypatch.setattr(sys, "path", [*before, *sys.path])
    environment = {"PYTHONPATH": str(before[0]) if before else ""}
    status, out, last = compiler_in(traps, environment, monkeypatch)
    assert out == ""
    assert (status, last) == (1, "TypeError: data type 'nonsense' not understood")


def test_the_compiler_is_of_this_package_wherever_it_lies(traps, tmp_path, monkeypatch):
    """A checkout that is not installed, in the current folder; another one is on the path."""
    here = tmp_path / "checkout"
    shutil.copytree(
        Path(compiling.__file__).parents[1],
        here / "adv2e",
        ignore=shutil.ignore_patterns("__pycache__"),
    )
    text = (here / "adv2e" / "conversion" / "compiling.py").read_text()
    (here / "adv2e" / "conversion" / "compiling.py").write_text(
        text.replace(
            "def main() -> None:",
            """
def main() -> None:
    raise SystemExit(f"of {__file__}")
""",
        )
    )
    monkeypatch.setattr(compiling, "__file__", str(here / "adv2e" / "conversion" / "compiling.py"))
    status, out, last = compiler_in(here, {}, monkeypatch)
    assert (status, out, last) == (1, "", f"of {here / 'adv2e' / 'conversion' / 'compiling.py'}")


def test_the_command_imports_no_library_from_the_current_folder(traps):
    """With ``-m`` Python itself takes the package from there if there is one, and no more."""
    (traps / "adv2e.py").unlink()
    for name in ("os", "site", "encodings/__init__", "struct", "threading", "typing"):
        (traps / f"{name}.py").unlink()  # those that Python imports before it runs anything
    (traps / "encodings").rmdir()
    done = subprocess.run(
        [sys.executable, "-m", "adv2e", "convert", "nothing.npy", "--fps", "9"],
        cwd=traps,
        env={**os.environ, "PYTHONPATH": str(Path(compiling.__file__).parents[1])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout == ""
    assert (done.returncode, done.stderr) == (
        1,
        "adv2e: error: nothing.npy: no such file or folder\n",
    )


CALL = """
compiling.compile_apart(
    Config(), dtype=np.dtype(np.uint8), colour=False, encoding="linear",
    format="h5", layout=None, threads=1,
)
"""
STUCK = """
import os, time
import adv2e.conversion.pipeline
from adv2e.conversion.compiling import main
def convert(*_, **__):
    print(os.getpid(), flush=True)
    time.sleep(100)
adv2e.conversion.pipeline.convert = convert
main()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("name", ["SIGKILL", "SIGINT", "SIGTERM"])
def test_the_compiler_ends_with_whoever_waits_for_it(tmp_path, name):
    """And its folder with it."""
    code = f"""
import subprocess, sys, signal
import numpy as np
from adv2e.conversion import compiling
from adv2e.config import Config
from adv2e.process.signals import stop_on_signals
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGTERM, signal.SIG_DFL)
stop_on_signals()
subprocess.DEVNULL = None
start = compiling._START
compiling._START = start.replace("from adv2e.conversion.compiling import main", {STUCK!r})
{CALL}
"""
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    with running_python(code, env=environment, text=True) as process:
        child = int(process.stdout.readline())
        assert len(list(tmp_path.glob("adv2e-compiling-*"))) == 1
        process.send_signal(getattr(signal, name))
        process.wait(timeout=20)
        wait_until(lambda: not is_running(child), seconds=20)
    assert list(tmp_path.iterdir()) == []


def is_running(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    state = Path(f"/proc/{pid}/stat")  # nobody may have asked how it ended
    return not state.exists() or state.read_text().rpartition(")")[2].split()[0] != "Z"


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

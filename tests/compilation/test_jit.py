"""The cache of compiled code, as seen by processes of their own."""

import ast
import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import adv2e
from adv2e import compiled as jit
from adv2e.compilation.code_cache import CodeCache

INNER = """
from adv2e.compiled import kernel

@kernel
def inner(x):
    return x + 1
"""
OUTER = """
from adv2e.inner import inner
from adv2e.compiled import kernel

@kernel
def outer(x):
    return 10 * inner(x)
"""
RUN = """
import sys
from adv2e.outer import outer
results = [outer(float(a) if "." in a else int(a)) for a in sys.argv[1:]]
print(*results, sum(outer.entry.stats.cache_hits.values()), sep=" ")
"""


@pytest.fixture
def package(tmp_path):
    """A copy of the package with two small kernels in two files, one calling the other."""
    copy = tmp_path / "site" / "adv2e"
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(Path(adv2e.__file__).parent, copy, ignore=ignored)
    (copy / "inner.py").write_text(INNER)
    (copy / "outer.py").write_text(OUTER)
    return copy


@pytest.fixture
def start(package, tmp_path):
    """Start a process that calls the outer kernel; it prints results and hits of the cache."""
    without = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    places = {"PYTHONPATH": str(package.parent), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    environment = {**without, **places, "PYTHONDONTWRITEBYTECODE": "1"}

    def start(*numbers, code=RUN, **more):
        return subprocess.Popen(
            [sys.executable, "-c", code, *map(str, numbers)],
            env={**environment, **more},
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    return start


def said(process):
    out, err = process.communicate(timeout=120)
    assert (process.returncode, err) == (0, "")
    return out.split()


def test_a_second_process_finds_the_code(start):
    assert said(start(1)) == ["20", "0"]
    assert said(start(1)) == ["20", "1"]


@pytest.mark.thorough
def test_a_read_only_installation_is_served_and_not_touched(package, start):
    before = {path: path.stat().st_mtime_ns for path in package.rglob("*")}
    for path in (*before, package):
        path.chmod(path.stat().st_mode & ~(stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH))
    try:
        assert said(start(1)) == ["20", "0"]
        assert said(start(1)) == ["20", "1"]
        assert {path: path.stat().st_mtime_ns for path in package.rglob("*")} == before
    finally:
        for path in (package, *before):
            path.chmod(path.stat().st_mode | stat.S_IWUSR)


@pytest.mark.thorough
def test_processes_that_start_at_once_do_not_disturb_each_other(start):
    arguments = [(1,), (1.5,), (2.5, 2), (2, 2.5)]
    results = [said(process) for process in [start(*numbers) for numbers in arguments]]
    assert [result[:-1] for result in results] == [["20"], ["25.0"], ["35.0", "30"], ["30", "35.0"]]
    assert said(start(1, 1.5))[:-1] == ["20", "25.0"]
    assert said(start(1, 1.5)) == ["20", "25.0", "2"]


@pytest.mark.thorough
@pytest.mark.parametrize("kept", [0, 0.5])
def test_a_file_cut_short_is_made_again(start, tmp_path, kept):
    said(start(1))
    files = list(tmp_path.glob("cache/**/*.nbc"))
    assert files
    for path in files:
        os.truncate(path, int(kept * path.stat().st_size))
    assert said(start(1)) == ["20", "0"]
    assert said(start(1)) == ["20", "1"]


@pytest.mark.thorough
@pytest.mark.skipif(os.name != "posix", reason="modes of POSIX")
def test_without_a_trusted_folder_code_is_compiled_and_not_kept(start, tmp_path):
    said(start(1))
    (tmp_path / "cache" / "adv2e").chmod(0o777)
    before = sorted(tmp_path.rglob("*"))
    assert said(start(1, HOME=os.devnull)) == ["20", "0"]
    assert sorted(tmp_path.rglob("*")) == before


WATCH = """
from numba import config
from adv2e import compiled
from adv2e.outer import outer
before = config.CACHE_DIR
seen = []
with compiled.watched(seen.append):
    outer(1)
    outer(2)
assert config.CACHE_DIR == before
print(*(one.__name__ for one in seen), len(compiled.parts_of(seen[0])) if seen else 0)
"""


@pytest.mark.thorough
def test_whoever_watches_is_told_of_what_is_compiled_and_numba_stays_as_it_was(start):
    assert said(start(code=WATCH)) == ["outer", "inner", "2"]
    assert said(start(code=WATCH)) == ["0"]


FINDERS = """
import sys
seen = []
class Looks:
    def find_spec(self, name, path=None, target=None):
        if name == "numba":
            seen.append((sys.meta_path, list(sys.meta_path)))
sys.meta_path.insert(0, Looks())
before = list(sys.meta_path)
from adv2e.inner import inner
inner(1)
(held, then), = seen
print(held == then, [one in held for one in before], sys.meta_path == before)
"""


def test_imports_of_other_threads_miss_no_finder_while_numba_is_imported(start):
    """A list that becomes shorter while an import goes through it makes that skip a finder."""
    told = said(start(code=FINDERS))
    assert told[0] == told[-1] == "True"
    assert "False" not in "".join(told)


SETTINGS = """
from pathlib import Path
from adv2e import compiled
from adv2e.inner import inner
from adv2e.outer import outer
outer(1)
import numba
name = Path(".numba_config.yaml")
name.unlink(missing_ok=True)
name.write_text("disable_jit: 1\\nopt: 0\\ncpu_name: generic\\n")
outer(1.5)  # which is compiled
print(numba.config.DISABLE_JIT, numba.config.OPT._raw_value, numba.config.CPU_NAME)
"""


@pytest.mark.parametrize("before", [False, True])
@pytest.mark.thorough
def test_a_file_of_settings_in_the_current_folder_is_not_read(start, tmp_path, before):
    if before:
        (tmp_path / ".numba_config.yaml").write_text("disable_jit: 1\ncpu_name: generic\n")
    assert said(start(code=SETTINGS)) == ["0", "3", "None"]
    assert said(start(code=SETTINGS, NUMBA_OPT="2"))[1] == "2"  # which is the user's own


HELD = """
import sys, time
from adv2e.files.workspace import lock_file
with open(sys.argv[1], "ab", buffering=0) as file:
    assert lock_file(file, wait=True)
    print("held", flush=True)
    time.sleep(100)
"""


COMPILES_FOR_LONG = """
import time
from adv2e import compiled
from adv2e.outer import outer

def wait(function):
    print("compiling", flush=True)
    time.sleep(100)

with compiled.watched(wait):
    outer(2.5)
"""


@pytest.mark.thorough
def test_nobody_waits_for_a_process_that_compiles(start):
    said(start(1))
    compiling = start(code=COMPILES_FOR_LONG)
    assert compiling.stdout.readline() == "compiling\n"
    assert said(start(1)) == ["20", "1"]  # what is there is loaded
    assert said(start(1.5)) == ["25.0", "0"]  # and what is not is compiled, and kept
    assert compiling.poll() is None
    compiling.kill()
    compiling.communicate()
    assert said(start(1, 1.5)) == ["20", "25.0", "2"]


@pytest.mark.thorough
def test_writing_waits_for_another_process_that_does(start, tmp_path):
    said(start(1))
    (folder,) = tmp_path.glob("cache/adv2e/kernels-*")
    holder = start(folder / "lock", code=HELD)
    assert holder.stdout.readline() == "held\n"
    waiting = start(1.5)
    with pytest.raises(subprocess.TimeoutExpired):
        waiting.wait(4)
    holder.kill()  # the lock goes with it
    holder.communicate()
    assert said(waiting) == ["25.0", "0"]


@pytest.mark.thorough
def test_code_is_compiled_again_when_what_it_calls_has_changed(package, start):
    assert said(start(1)) == ["20", "0"]
    (package / "inner.py").write_text(INNER.replace("x + 1", "x + 2"))
    assert said(start(1)) == ["30", "0"]


@pytest.mark.thorough
def test_numba_cache_dir_comes_first(start, tmp_path):
    said(start(1, NUMBA_CACHE_DIR=str(tmp_path / "mine")))
    assert list(tmp_path.glob("mine/adv2e/kernels-*/**/*.nbc"))
    assert not (tmp_path / "cache").exists()


def test_the_digest_covers_the_constants_that_compiled_code_takes_in():
    """Whatever a file of the kernel imports in capitals lies in a file of the digest."""
    package = Path(adv2e.__file__).parent
    covered = {package / name for name in jit.sources()}
    assert package / "compilation" / "compiler.py" in covered  # which says how to compile
    seen = 0
    for path in (path for path in covered if package / "kernel" in path.parents):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.ImportFrom) or not (node.module or "").startswith("adv2e."):
                continue
            if any(alias.name.isupper() for alias in node.names):
                file = package.joinpath(*node.module.split(".")[1:]).with_suffix(".py")
                assert file in covered, f"{path} takes constants from {file}"
                seen += 1
    assert seen > 20


@pytest.mark.thorough
def test_what_is_imported_after_the_compiler_extends_it(tmp_path):
    script = (
        "from adv2e import compiled\n"
        "import numpy as np\n"
        "compiled._nothing()\n"
        "from adv2e.kernel.work_queue import claim, nothing_claimed\n"
        "print(*claim(nothing_claimed(), 5000))\n"
    )
    none = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}  # no code is kept there
    run = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False, env=none
    )
    assert (run.stdout, run.returncode) == ("0 2048\n", 0), run.stderr


@pytest.mark.thorough
def test_what_has_one_byte_changed_is_not_loaded_but_made_again(start, tmp_path, monkeypatch):
    """Flip a byte 200 times: nothing damaged stays, and some of these times it runs."""
    said(start(1))
    (folder,) = tmp_path.glob("cache/adv2e/kernels-*")
    files = (path for path in folder.rglob("*") if path.is_file() and path.stat().st_size)
    whole = {path: path.read_bytes() for path in files}
    assert {path.suffix for path in whole} >= {".nbi", ".nbc", ".json"}
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    rng = np.random.default_rng(8)
    for turn in range(200):
        for path, data in whole.items():
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(data)
        path = sorted(whole)[rng.integers(len(whole))]
        data = bytearray(whole[path])
        data[rng.integers(len(data))] ^= 1 << rng.integers(8)
        path.write_bytes(data)
        if turn % 50 == 0:
            assert said(start(1))[0] == "20"
            continue
        cache = CodeCache(folder.name)
        assert cache.folder == folder.resolve()
        for one in {path.parents[1] for path in whole if path.suffix == ".nbc"}:
            assert cache.checked(str(one.relative_to(folder))) == one
        if path.suffix != ".json":
            assert not path.exists()
        for one in folder.rglob("*.nb?"):
            assert one.read_bytes() == whole[one]


WITHOUT_SCIPY = """
import sys, threading
from adv2e import compiled
compiled.import_ahead()
for thread in threading.enumerate():
    if thread is not threading.current_thread():
        thread.join()
print("numba" in sys.modules, "scipy.linalg" in sys.modules)
import numba, numpy as np
product = numba.njit(lambda a, b: a @ b)
print(product(np.eye(2), np.eye(2)).sum(), "scipy.linalg" in sys.modules)
"""


def test_an_import_ahead_leaves_out_scipy_which_others_find(start):
    pytest.importorskip("scipy")
    assert said(start(code=WITHOUT_SCIPY)) == ["True", "False", "2.0", "True"]

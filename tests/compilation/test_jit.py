"""The cache of compiled code, as seen by processes of their own."""

import ast
import dataclasses
import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

import adv2e
from adv2e import compiled as jit
from adv2e.compilation.machine_code import read_code, write_code

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
print(*results, sum(outer.stats.cache_hits.values()), sep=" ")
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


ENTRY = """
from adv2e.inner import inner
from adv2e.compiled import entry, kernel

@entry
def first(numbers):
    total = 0.0
    for k in range(numbers.shape[0]):
        total += inner(numbers[k])
    return total

@entry
def ends(numbers):
    return len(numbers), numbers[-1], len(numbers) > 3

@entry
def itself(numbers):
    return numbers

@kernel
def caller(numbers):
    return -first(numbers)
"""
REST = "3", "2.0", "False", "True", "0.0", "1.0", "2.0"
ENTER = """
import sys
import numpy as np
from adv2e.first import caller, ends, first, itself
print(first(np.arange(3.0)), "numba" in sys.modules)
if len(sys.argv) > 1:
    print(caller(np.arange(3.0)), *ends(np.arange(3.0)), "numba" in sys.modules)
    print(*itself(np.arange(3.0)))
"""


def test_an_entry_is_called_without_numba_once_its_code_is_there(package, start, tmp_path):
    (package / "first.py").write_text(ENTRY)
    assert said(start(code=ENTER)) == ["6.0", "True"]
    assert said(start(code=ENTER)) == ["6.0", "False"]
    for _ in range(2):  # other compiled code calls it, and some of it only Numba can call
        assert said(start(1, code=ENTER)) == ["6.0", "False", "-6.0", *REST]
    (code,) = tmp_path.glob("cache/**/adv2e.first.first-*.code")
    os.truncate(code, code.stat().st_size - 1)
    assert said(start(code=ENTER)) == ["6.0", "True"]
    assert said(start(code=ENTER)) == ["6.0", "False"]
    (package / "inner.py").write_text(INNER.replace("x + 1", "x + 2"))
    assert said(start(code=ENTER)) == ["9.0", "True"]


@pytest.mark.parametrize(
    "changed",
    [
        ("library.enable_object_caching()", "library.no_longer_there()"),
        ("compilers._FunctionCompiler", "compilers.NoLongerThere"),
        ('types.float64: "d",', ""),
    ],
)
def test_another_numba_goes_its_own_way(package, start, changed):
    (package / "first.py").write_text(ENTRY)
    translation = package / "compilation" / "translation.py"
    text = translation.read_text()
    assert changed[0] in text
    translation.write_text(text.replace(*changed))
    for _ in range(2):
        assert said(start(1, code=ENTER)) == ["6.0", "True", "-6.0", *REST]


def test_code_that_calls_what_is_not_there_is_not_loaded(package, start, tmp_path):
    (package / "first.py").write_text(ENTRY)
    assert said(start(code=ENTER)) == ["6.0", "True"]
    (code,) = tmp_path.glob("cache/**/adv2e.first.first-*.code")
    write_code(code, dataclasses.replace(read_code(code), needed=("nowhere_to_be_found",)))
    assert said(start(code=ENTER)) == ["6.0", "True"]


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


def test_processes_that_start_at_once_do_not_disturb_each_other(start):
    arguments = [(1,), (1.5,), (2.5, 2), (2, 2.5)]
    results = [said(process) for process in [start(*numbers) for numbers in arguments]]
    assert [result[:-1] for result in results] == [["20"], ["25.0"], ["35.0", "30"], ["30", "35.0"]]
    assert said(start(1, 1.5))[:-1] == ["20", "25.0"]
    assert said(start(1, 1.5)) == ["20", "25.0", "2"]


@pytest.mark.parametrize("kept", [0, 0.5])
def test_a_file_cut_short_is_made_again(start, tmp_path, kept):
    said(start(1))
    files = list(tmp_path.glob("cache/**/*.nbc"))
    assert files
    for path in files:
        os.truncate(path, int(kept * path.stat().st_size))
    assert said(start(1)) == ["20", "0"]
    assert said(start(1)) == ["20", "1"]


def test_a_folder_that_cannot_be_written_to_is_no_error(start, tmp_path):
    said(start(1))
    (folder,) = tmp_path.glob("cache/**/numba")
    shutil.rmtree(folder)
    folder.write_text("in the way")
    assert said(start(1)) == ["20", "0"]


def test_code_is_compiled_again_when_what_it_calls_has_changed(package, start):
    assert said(start(1)) == ["20", "0"]
    (package / "inner.py").write_text(INNER.replace("x + 1", "x + 2"))
    assert said(start(1)) == ["30", "0"]


def test_numba_cache_dir_comes_first(start, tmp_path):
    said(start(1, NUMBA_CACHE_DIR=str(tmp_path / "mine")))
    assert list(tmp_path.glob("mine/adv2e/kernels-*/**/*.nbc"))
    assert not (tmp_path / "cache").exists()


def test_the_digest_covers_the_constants_that_compiled_code_takes_in():
    """Whatever a file of the kernel imports in capitals lies in a file of the digest."""
    package = Path(adv2e.__file__).parent
    covered = set(jit.sources())
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

"""What is said while functions are compiled."""

import io

import pytest

from adv2e import compiled
from adv2e.cli.progress import compilation_told
from adv2e.kernel.exact import run_exact


@pytest.fixture
def about_to_compile():
    """Tell the watchers that functions are about to be compiled."""
    if not hasattr(run_exact, "function"):
        pytest.skip("nothing is compiled")
    return compiled._tell


def test_it_is_said_once_and_only_if_something_is_compiled(about_to_compile, monkeypatch):
    lines = []
    with compilation_told(lines.append, progress=False):
        pass
    assert lines == []
    with compilation_told(lines.append, progress=False):
        about_to_compile(run_exact.function)
        about_to_compile(run_exact.function)
    assert lines == ["compiling the pixel's kernel (once; about a minute)"]
    monkeypatch.setattr(compiled.code_cache(), "why_not", "the disk is full")
    with compilation_told(lines.append, progress=False):
        about_to_compile(run_exact.function)
    assert lines[1:] == [
        "compiling the pixel's kernel (in every run, as it cannot be kept: the disk is full;"
        " about a minute)"
    ]
    with compilation_told(None, progress=False):
        about_to_compile(run_exact.function)


def test_the_bar_counts_the_functions_that_one_consists_of(about_to_compile, monkeypatch):
    shown = io.StringIO()
    monkeypatch.setattr("sys.stderr", shown)
    monkeypatch.setenv("TQDM_MININTERVAL", "0")
    parts = compiled.parts_of(run_exact.function)
    assert run_exact.function in parts
    assert len(parts) > 30
    with compilation_told(None, progress=True):
        for part in parts - {run_exact.function}:
            about_to_compile(part)
        about_to_compile(run_exact.function)
    assert f"{len(parts)}/{len(parts)}" in shown.getvalue()

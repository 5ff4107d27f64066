"""What the Dockerfile copies and installs exists, and it runs adv2e without being root."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LINES = re.sub(r"\\\n", " ", (ROOT / "Dockerfile").read_text("utf-8")).splitlines()


def told(word):
    """Return what stands behind an instruction, wherever it stands."""
    return [line.split(maxsplit=1)[1] for line in LINES if line.startswith(f"{word} ")]


def test_what_is_copied_exists_and_is_not_ignored():
    ignored = (ROOT / ".dockerignore").read_text("utf-8").split()
    assert ignored[0] == "*"
    sources = [one for line in told("COPY") for one in line.split()[:-1]]
    assert {"pyproject.toml", "README.md", "LICENSE", "adv2e", "configs"} == {*sources}
    for source in sources:
        assert (ROOT / source).exists()
        assert f"!{source}" in ignored


def test_extras_that_are_installed_exist_in_both_stages():
    project = (ROOT / "pyproject.toml").read_text("utf-8")
    asked = re.findall(r'"(?:\.|adv2e)\[([\w,]+)\]"', "\n".join(told("RUN")))
    assert len(asked) == 2
    assert asked[0] == asked[1]
    for extra in asked[0].split(","):
        assert re.search(rf"^{extra} = \[", project, flags=re.MULTILINE), extra


def test_it_runs_adv2e_without_being_root():
    assert told("USER") == ["1000"]
    assert "useradd --create-home --uid 1000 adv2e" in told("RUN")[-1]
    assert told("ENTRYPOINT") == ['["adv2e"]']
    assert LINES.index("USER 1000") > max(k for k, line in enumerate(LINES) if "RUN" in line)
    assert all(re.fullmatch(r"python:3\.\d+-slim( AS \w+)?", image) for image in told("FROM"))

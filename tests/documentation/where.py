"""Where each command that a document shows is run."""

from __future__ import annotations

import re

from documentation.documents import Command, documents

HERE = "tests/documentation/test_documents_run.py"

ELSEWHERE = {
    r"pip install ": "tests/test_wheel.py",
    r"\./scripts/demo\b": "tests/scripts/test_demo_script.py",
    r"\./scripts/test\b": "scripts/test",
    r"\./scripts/docs\b": "tests/documentation/test_site.py",
    r"(git clone|cd) ": "scripts/test",
    r"sbatch ": "tests/documentation/test_array_of_jobs.py",
    r"docker ": "tests/test_dockerfile.py",
    r"dask (scheduler|worker) ": "tests/batches/test_cluster.py",
    r"python3? -m venv ": "scripts/environment.sh",
    r"(source|\.) \S+/activate$": "scripts/environment.sh",
}
"""Commands that no test runs from the text, and the file that does the same.

The tests themselves run in a clone, in an environment that ``scripts/test`` makes.
"""


def elsewhere(command: Command) -> str | None:
    """Return the file that does what a command does, if it is not run from the text."""
    found = (path for form, path in ELSEWHERE.items() if re.match(form, command.text))
    return next(found, None)


def is_run(command: Command) -> bool:
    """Tell whether a command is run from the text; one within a sentence only if it is no work."""
    quick = not command.inline or command.text.startswith("adv2e effects ")
    return quick and not command.needs and elsewhere(command) is None


def where(command: Command) -> str:
    """Return where a command is run, for people."""
    other = elsewhere(command)
    if other:
        return other
    if is_run(command):
        return HERE
    return "; ".join(filter(None, (f"{HERE}: its options alone", command.needs)))


def table() -> str:
    """Return all commands of all documents and where each is run."""
    lines = ["document:line | command | where it is run"]
    for document in documents():
        for command in sorted(document.commands(), key=lambda one: one.line):
            text = " ".join(command.text.split())
            lines.append(f"{command.document}:{command.line} | {text} | {where(command)}")
    return "\n".join(lines)

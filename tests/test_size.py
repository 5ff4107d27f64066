"""Size of the program: lines of code of each package, none of which grows unnoticed.

A package that outgrows its line of the table is to lose as much elsewhere.  Where that cannot be,
the commit that raises the line says why.  A package that has shrunk takes its line down with it.
"""

import ast
import io
import tokenize
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

import adv2e

PACKAGE = Path(adv2e.__file__).parent

LIMITS = {
    "": 1860,
    "batches": 1520,
    "cli": 1320,
    "comparison": 1165,
    "compilation": 285,
    "config": 1315,
    "conversion": 1520,
    "diagnosis": 8135,
    "effects": 1650,
    "exporting": 1075,
    "files": 785,
    "formats": 5155,
    "inspection": 645,
    "kernel": 5970,
    "light": 920,
    "motion": 370,
    "pixel": 575,
    "process": 285,
    "rendering": 1045,
    "reports": 1925,
    "representations": 145,
    "side": 870,
    "sources": 3800,
    "synthetic": 160,
}
"""Most lines of code of each package; of the modules beside them as ""."""

FILES = 349
"""Most modules of all packages together."""

_SLACK = 60
"""Lines by which a package may be below its limit."""

_LAYOUT = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}


def code_lines(text):
    """Return the number of lines with code: without blank lines, comments and docstrings."""
    documented = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            documented |= set(range(node.lineno, node.end_lineno + 1))
    written = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in _LAYOUT:
            written |= set(range(token.start[0], token.end[0] + 1))
    return len(written - documented)


@cache
def packages():
    """Return the lines of code of each package, and of the modules beside them as ""."""
    count = Counter()
    for path in PACKAGE.rglob("*.py"):
        parts = path.relative_to(PACKAGE).parts
        count[parts[0] if len(parts) > 1 else ""] += code_lines(path.read_text("utf-8"))
    return count


def test_lines_of_code_are_those_that_do_something():
    head = '"""Title."""\n\n# why\nx = 1  # one\n\n'
    text = head + 'def f():\n    """Return 1."""\n    return (\n        x\n    )\n'
    assert code_lines(text) == 5


@pytest.mark.parametrize("name", sorted(LIMITS))
def test_a_package_keeps_to_its_size(name):
    lines = packages()[name]
    assert lines <= LIMITS[name], "say what leaves for it, or raise the limit with a reason"
    assert lines >= LIMITS[name] - _SLACK, "it has shrunk: lower its limit"


def test_no_package_is_left_out():
    assert set(packages()) == set(LIMITS)
    assert len(list(PACKAGE.rglob("*.py"))) <= FILES

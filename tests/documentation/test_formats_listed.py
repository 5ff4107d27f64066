"""The table of formats in their document is the one that the registry makes."""

from __future__ import annotations

from adv2e.formats.registry import FORMATS, Format
from documentation.documents import ROOT

DOCUMENT = ROOT / "docs" / "formats.md"

HEAD = """\
| name | what it is | suffix | events | frames | configuration | causes | holds at most |
|---|---|---|---|---|---|---|---|
"""

LENGTHS = {"years": 365.25 * 86400e6, "days": 86400e6, "hours": 3600e6, "minutes": 60e6}


def row(found):
    """Return the line of a format; what concerns writing is empty for those only read."""
    most, inside = [], ["", ""]
    if found.writer:
        inside = [
            "inside" if found.holds_settings else "`.json`",
            "inside" if found.causes else "`.causes.txt`",
        ]
        if found.most != Format.most:
            most.append("{}x{} pixels".format(*found.most))
        if found.last_us != Format.last_us:
            unit, us = next(pair for pair in LENGTHS.items() if found.last_us >= pair[1])
            most.append(f"{found.last_us / us:.3g} {unit}")
    cells = [
        f"`{found.name}`" + f" (`.[{found.extra}]`)" * bool(found.extra),
        found.what,
        " ".join(f"`{suffix}`" if suffix else "folder" for suffix in found.suffixes),
        "r" * bool(found.reader) + "w" * bool(found.writer),
        found.frames,
        *inside,
        ", ".join(most),
    ]
    return f"| {' | '.join(cells)} |\n"


def test_the_table_is_that_of_the_registry():
    text = DOCUMENT.read_text("utf-8").split("\n## All formats\n")[1]
    table = HEAD + "".join(map(row, FORMATS))
    assert table in text, f"the table of {DOCUMENT.name} must be\n\n{table}"


def test_what_checks_and_how_fast_is_told_of_formats_that_there_are():
    text = DOCUMENT.read_text("utf-8").split("\n| name | checked in tests by |")[1].split("\n\n")[0]
    told = [line.split("`")[1] for line in text.splitlines() if line.startswith("| `")]
    names = [found.name for found in FORMATS]
    assert told == [name for name in names if name in told]
    assert len(told) > len(names) // 2

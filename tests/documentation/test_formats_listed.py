"""The table of formats says of each what the registry says."""

from __future__ import annotations

import re

from adv2e.formats.registry import FORMATS
from documentation.documents import ROOT

DOCUMENT = ROOT / "adv2e" / "formats" / "README.md"


def listed():
    """Return the cells of each row of the table by its name."""
    text = DOCUMENT.read_text("utf-8").split("\n## All formats\n")[1].split("\n## ")[0]
    rows = [line for line in text.splitlines() if line.startswith("| `")]
    return {
        re.findall("`([^`]+)`", row)[0]: [c.strip() for c in row.split("|")[1:-1]] for row in rows
    }


def test_every_format_has_a_row_that_says_what_is_done():
    rows = listed()
    assert list(rows) == [found.name for found in FORMATS]
    for found in FORMATS:
        _, suffix, events, frames, *_ = rows[found.name]
        assert set(re.findall("`([^`]+)`", suffix)) == {s for s in found.suffixes if s}, found.name
        assert events == "r" * bool(found.reader) + "w" * bool(found.writer), found.name
        assert frames == found.frames, found.name
        extra = re.findall(r"`\.\[(\w+)\]`", rows[found.name][0])
        assert extra == [found.extra] * bool(found.extra), found.name

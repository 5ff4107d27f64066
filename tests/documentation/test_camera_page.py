"""docs/camera.md: its examples run, and its links lead somewhere."""

from __future__ import annotations

import pytest

from documentation.documents import ROOT, Document

PAGE = Document.read(ROOT / "docs" / "camera.md")
BLOCKS = [block for block in PAGE.blocks if block.language == "python"]


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: f"line {block.line}")
@pytest.mark.filterwarnings("ignore::adv2e.errors.Adv2eWarning")
def test_examples_run(block, capsys):
    exec(compile(block.text, "docs/camera.md", "exec"), {"__name__": "example"})
    if "43008" in block.text:
        assert capsys.readouterr().out == "43008\n"


def test_there_are_examples():
    assert len(BLOCKS) == 4

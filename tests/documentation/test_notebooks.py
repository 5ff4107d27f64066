"""The notebooks run from their first cell to the last, and keep no outputs."""

from __future__ import annotations

import json
import sys

import pytest

from documentation.documents import ROOT

NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
each = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.name)


def test_there_is_one():
    assert NOTEBOOKS


@each
@pytest.mark.thorough
def test_all_cells_run(path, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tempfile.mkdtemp", lambda: str(tmp_path))
    monkeypatch.setitem(sys.modules, "IPython.display", None)  # as in a shell
    names = {"__name__": "__main__"}
    for number, cell in enumerate(json.loads(path.read_text("utf-8"))["cells"]):
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), f"{path.name}:{number}", "exec"), names)
    told = capsys.readouterr().out
    assert "events a pixel a second" in told
    assert (tmp_path / "disk.png").stat().st_size > 1000
    assert names["distance"]["value"] > 2 * names["distance"]["floor"]["half_split"]


@each
def test_none_keeps_outputs(path):
    book = json.loads(path.read_text("utf-8"))
    assert (book["nbformat"], book["nbformat_minor"]) == (4, 5)
    assert all(cell["id"] for cell in book["cells"])
    for cell in book["cells"]:
        assert cell["cell_type"] in ("markdown", "code")
        assert not cell.get("outputs") and cell.get("execution_count") is None

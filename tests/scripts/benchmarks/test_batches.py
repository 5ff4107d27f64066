"""The benchmark of batches, with a clip of three frames."""

import json
import re

import pytest
from benchmarks import batches
from click.testing import CliRunner


@pytest.mark.thorough
def test_all_ways_are_measured(tmp_path, monkeypatch):
    monkeypatch.setattr(batches, "QUICK_CLIPS", 1)
    monkeypatch.setattr(batches, "FRAMES", 3)
    words = ["--quick", "--rounds", 1, "--threads", 1, "--clips", tmp_path / "clips"]
    words += ["--pixel", "noise off", "--moving", 0.5, "-o", tmp_path / "out.md"]
    done = CliRunner().invoke(batches.main, [*map(str, words)])
    assert done.exit_code == 0, done.output
    assert [path.name for path in (tmp_path / "clips").rglob("*.mp4")] == ["000.mp4"]
    text = (tmp_path / "out.md").read_text()
    rows = re.findall(r"^\| (the pixel alone|`adv2e batch`|shell loop of [^|]*) \|", text, re.M)
    assert len(rows) == 4
    assert "Noise off; something moves in 50 % of the rows." in text
    measured = json.loads((tmp_path / "out.json").read_text())["measured"]
    written = [one["rounds"][0]["report"].get("bytes") for one in measured]
    # the batch and the loop write about the same; their seeds differ
    assert written[1] == pytest.approx(written[2], rel=0.2)
    assert all(size > 1000 for size in written[1:])

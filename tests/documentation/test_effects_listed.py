"""The page of the effects is as it is generated now, and the example of the document runs."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

import numpy as np
import pytest

from adv2e.effects import EFFECTS
from documentation.documents import ROOT, Document

DOCUMENT = Document.read(ROOT / "docs" / "own_effects.md")
(EXAMPLE,) = (block.text for block in DOCUMENT.blocks if block.file == "echo.py")


def test_the_page_of_the_effects_is_the_one_that_is_written_now(adv2e):
    """If not: adv2e effects --all > docs/effects.md."""
    assert adv2e("effects", "--all") == (0, (ROOT / "docs" / "effects.md").read_text("ascii"), "")


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_a_page_says_where_the_effect_acts_and_is_tested(adv2e, effect):
    page = adv2e("effects", effect.name).out
    assert re.search(r"^adv2e/effects/\S+ \(hooks: \w", page, re.M) or re.search(
        r"^(Compiled|Applied) in adv2e/", page, re.M
    )
    paths = re.findall(r"\b(?:adv2e|tests)/[\w/.]*\w", page)
    assert f"tests/effects/test_{effect.own_module or effect.name}.py" in paths
    assert not [path for path in paths if not (ROOT / path).exists()]


def test_effect_of_ones_own_runs(adv2e, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("echo.py").write_text(EXAMPLE)
    levels = np.tile(np.array([20, 40, 80, 160, 80, 40], np.uint8), 3)
    np.save("clip.npy", np.repeat(levels, 12 * 9).reshape(18, 9, 12))
    given = ("convert", "clip.npy", "--fps", "200", "-q", "--effect", "echo.py")
    events = {}
    for share in ("0", "0.25"):
        outcome = adv2e(*given, "-o", f"{share}.txt", "--set", f"user.echo.share={share}")
        assert outcome == (0, "", "")
        events[share] = Path(f"{share}.txt").read_text("ascii").splitlines()
    assert len(events["0.25"]) / len(events["0"]) == pytest.approx(1.25, abs=0.05)
    assert set(events["0"]) < set(events["0.25"])
    times = [float(line.split()[0]) for line in events["0.25"]]
    assert times == sorted(times)
    kept = json.loads(Path("0.25.txt.json").read_text("utf-8"))
    assert kept["config"]["user"] == {"echo": {"share": 0.25, "delay_us": 5000.0}}
    (source,) = kept["effects"]
    digest = hashlib.sha256(EXAMPLE.encode()).hexdigest()
    assert source == {"name": "echo", "file": "echo.py", "sha256": digest}
    assert "delay_us: 5000.0" in adv2e("config", "show", "--effect", "echo.py").out

"""The script that ends conversions at random: what it finds, and that it would find more."""

import sys

import pytest

from adv2e.compiled import code_cache

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="asks /proc")
soak = pytest.importorskip("dev.soak") if sys.platform.startswith("linux") else None

HALF = """
import sys, time
from pathlib import Path
out = Path(sys.argv[1]) / "out.h5"
out.write_bytes(b"half")
time.sleep(float(sys.argv[2]))
out.write_bytes(b"half, and the other half")
"""


def trial(tmp_path, number, seed=0):
    record = soak.Record()
    return soak.Trial(number, seed, tmp_path, record), record


@pytest.mark.parametrize("number", [25, 36])  # small ones
@pytest.mark.thorough
def test_nothing_is_lost(tmp_path, number):
    assert code_cache().folder is not None  # or each run would compile
    one, record = trial(tmp_path, number)
    one.run()
    assert record.losses == []
    assert record.counts["trials"] == 1
    assert record.counts["files compared"] >= 1
    assert sum(count for name, count in record.counts.items() if name.startswith("ended by")) >= 1


def test_a_program_that_writes_under_the_final_name_is_found_out(tmp_path, monkeypatch):
    one, record = trial(tmp_path, 0)
    monkeypatch.setattr(one, "command", lambda dest: [sys.executable, "-c", HALF, str(dest), "0.3"])
    monkeypatch.setattr(one._draw, "choice", lambda options: "SIGKILL")
    monkeypatch.setattr(one._draw, "uniform", lambda low, high: 0.2)
    one.run()
    assert any("out.h5 is under its final name and not whole" in loss for loss in record.losses)


def test_what_is_left_over_is_found(tmp_path):
    (tmp_path / ".adv2e.x.part").mkdir()
    (tmp_path / ".adv2e.x.part" / "new.h5").write_bytes(b"")
    (tmp_path / "a.h5").write_bytes(b"")
    assert len(soak.strays_in(tmp_path)) == 2
    assert sorted(soak.files_in(tmp_path)) == ["a.h5"]

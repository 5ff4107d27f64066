"""The pictures, the batch and the table of scripts/benchmarks/stills.py."""

import json

import pytest
from benchmarks import stills
from click.testing import CliRunner

from adv2e.errors import DataError


def test_three_pictures(tmp_path):
    out = tmp_path / "stills.md"
    done = CliRunner().invoke(stills.main, ["--stills", "3", "-c", "ideal", "-o", str(out)])
    assert done.exit_code == 0, done.output
    (found,) = json.loads(out.with_suffix(".json").read_text()).values()
    assert found["stills"] == 3
    assert found["events"] > 1000
    assert 0 < found["each_s"] < found["all_s"]
    assert f"| {3600 / found['each_s']:,.0f} |" in out.read_text()


def test_a_picture_that_fails_is_no_number(tmp_path):
    stills.make_stills(tmp_path / "stills", 3)
    (tmp_path / "stills" / "class0" / "000000.png").write_bytes(b"no picture")
    with pytest.raises(DataError, match=r"ideal: .*000000"):
        stills.measured(tmp_path / "stills", tmp_path / "to", "ideal", ())

"""The clips, the cases and the tables of scripts/benchmarks/memory.py."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks import clips, memory, worker


def test_cases_have_names_of_their_own_and_cover_everything():
    every = list(memory.cases([], []))
    assert len({case.name for case in every}) == len(every) == 3 * 2 * 2 * 3
    chosen = list(memory.cases(["1280x720"], ["txt"]))
    assert {(case.size.name, case.format) for case in chosen} == {("1280x720", "txt")}


def test_a_burst_swings_as_far_as_it_says():
    burst = clips.Burst(width=40, height=30, frames=3, fps=30.0, swing=1.2)
    frames = np.stack(list(burst.render())).astype(float)
    assert frames.shape == (3, 30, 40)
    assert np.log(frames.max() / frames.min()) == pytest.approx(1.2, abs=0.03)
    flipped = (frames[1:] == frames[:-1]).mean()  # one of two neighbours, not both
    assert flipped == pytest.approx(2 * clips.FLIPPED * (1 - clips.FLIPPED), abs=0.05)


def test_a_conversion_tells_its_peak_and_its_events(tmp_path):
    burst = clips.Burst(width=40, height=30, frames=4, fps=30.0, swing=1.2)
    clip = clips.stored(burst, tmp_path)
    arguments = ["convert", str(clip), "--fps", "30", "-o", str(tmp_path / "a.txt")]
    report = worker.convert({"options": {"arguments": arguments}})
    assert report["events"] == len((tmp_path / "a.txt").read_text().splitlines())
    assert report["peak_mib"] is None or report["peak_mib"] > 50
    with pytest.raises(RuntimeError, match="exit status 1"):  # it exists already
        worker.convert({"options": {"arguments": arguments}})


def test_the_long_clip_goes_to_and_fro(monkeypatch, tmp_path):
    monkeypatch.setattr(memory, "LENGTH_CYCLE", 4)
    folder = memory.long_clip(tmp_path / "long", 32, 24, 9)
    files = sorted(folder.iterdir())
    content = [file.read_bytes() for file in files]
    assert len(files) == 9
    assert [content.index(data) for data in content] == [0, 1, 2, 3, 2, 1, 0, 1, 2]

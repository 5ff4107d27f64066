"""The clips, the cases and the tables of scripts/benchmarks/memory.py."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from benchmarks import clips, measure, memory, worker


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


def test_progress_is_read_from_the_bar():
    assert memory.frames_taken("compiling\n") is None
    assert memory.frames_taken(" 1%| 12/900 [00:01\r 2%| 25/900 [00:02<01:10, 12unit/s]") == 25


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_a_run_is_watched_and_its_failure_told():
    script = (
        "import sys, time\n"
        "for k in range(5):\n"
        "    print(f'{k}/5 [', file=sys.stderr, flush=True); time.sleep(0.05)\n"
        "print('a: 1,234 events (50 % ON)')\n"
    )
    moments, printed = memory.watched([sys.executable, "-c", script])
    assert [moment.frames for moment in moments][-1] == 4
    assert all(moment.rss_mib > 1 for moment in moments)
    assert 0 <= moments[0].cpu_s <= moments[-1].cpu_s < 10
    assert worker.count_in(printed) == 1234
    with pytest.raises(measure.JobError, match="no such thing"):
        memory.watched([sys.executable, "-c", "raise SystemExit('no such thing')"])


def test_the_long_table_tells_each_tenth():
    moments = [
        memory.Moment(k * 0.01 * (1 + (k > 900)), k, 100 + k / 100, k * 0.005)
        for k in range(1, 1001)
    ]
    rows = memory.long_table(moments, 1000).splitlines()[2:]
    assert len(rows) == 10
    assert rows[0].startswith("| 1 | 10.0 | 5.00 ")
    assert rows[9].startswith("| 10 | 20.0 ")
    assert rows[9].endswith("| 110 |")
    with pytest.raises(measure.JobError, match="tenth 1 "):
        memory.long_table(moments[200:], 1000)


def test_the_long_clip_goes_to_and_fro(monkeypatch, tmp_path):
    small = memory.Size(32, 24, 1.0, 30.0, 1.0, 4)
    monkeypatch.setattr(memory, "LONG_SIZE", small)
    monkeypatch.setattr(memory, "LONG_CYCLE", 4)
    folder = memory.long_clip(tmp_path / "long", 32, 24, 9)
    files = sorted(folder.iterdir())
    content = [file.read_bytes() for file in files]
    assert len(files) == 9
    assert [content.index(data) for data in content] == [0, 1, 2, 3, 2, 1, 0, 1, 2]

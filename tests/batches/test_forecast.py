"""What a batch is said to make, against what it makes."""

import re

import numpy as np
import pytest
from trees_of_batch import clip, last_of

from adv2e.batches import run as module
from adv2e.batches.plan import Task
from adv2e.batches.sequences import Sequence
from adv2e.conversion.estimate import Estimate
from adv2e.files.states import State, free_bytes


def tasks_of(tmp_path, sizes):
    found = [Sequence(f"s{k}", tmp_path / f"s{k}.avi", "videos") for k in range(len(sizes))]
    return [
        Task(one, State(size, 1, 0), tmp_path / one.name, 0, "new")
        for one, size in zip(found, sizes, strict=True)
    ]


def test_the_forecast_is_the_total_on_average(tmp_path, monkeypatch):
    """Events that have nothing to do with the bytes of the source, in trees in any order."""
    rng = np.random.default_rng(5)
    sizes, made = rng.integers(200, 1000, 40), rng.integers(1, 1000, 40).astype(float)
    monkeypatch.setattr(module, "config_of", lambda job: None)
    monkeypatch.setattr(
        module,
        "estimate",
        lambda source, *_, **__: Estimate(made[int(source)], 4 * made[int(source)], 1.0, ""),
    )

    class Job:
        threads, output, options = 1, "", {}

        def __init__(self, task):
            self.source = task.sequence.name[1:]

    found = []
    tasks = tasks_of(tmp_path, sizes.tolist())
    for _ in range(2000):
        rng.shuffle(tasks)
        found.append(module.forecast(tasks, Job, 2))
    events = np.array([one.events for one in found])
    error = events.std() / np.sqrt(events.size)
    assert events.mean() == pytest.approx(made.sum(), abs=4 * error)
    assert error < 0.02 * made.sum()
    assert found[0].bytes == pytest.approx(4 * found[0].events)
    looked_at = {int(one.basis.split()[3]) for one in found}
    assert max(looked_at) <= 6


@pytest.mark.thorough
def test_a_dry_run_tells_what_is_coming(batch, tmp_path):
    root, dest = tmp_path / "from", tmp_path / "to"
    for k in range(9):
        clip(root / f"{k}.avi", count=120 + 12 * k, start=k)
    (root / "bad.avi").write_bytes(b"no video")
    told = batch(root, dest, "--dry-run").out.splitlines()
    assert told[0] == "10 new"
    found = re.fullmatch(
        r"about ([\d,]+) events, ([\d.]+)MB and \d\d:\d\d, by short parts of (\d) of 10 sequences",
        told[1],
    )
    assert found, told[1]
    assert int(found[3]) >= 1
    assert not dest.exists()
    assert batch(root, dest).status == 1
    made = sum(record.get("events", 0) for record in last_of(dest).values())
    assert int(found[1].replace(",", "")) == pytest.approx(made, rel=0.25)
    size = sum(path.stat().st_size for path in dest.glob("*.h5"))
    assert float(found[2]) * 1e6 == pytest.approx(size, rel=0.25)


def test_of_few_short_clips_it_is_said_that_nothing_is_known(batch, tmp_path):
    clip(tmp_path / "from" / "a.avi", count=10)
    told = batch(tmp_path / "from", tmp_path / "to", "--dry-run").out.splitlines()
    assert told[0] == "1 new"
    assert "is not known" in told[1]
    assert batch(tmp_path / "from", tmp_path / "to").status == 0
    told = batch(tmp_path / "from", tmp_path / "to", "--dry-run").out
    assert "not known" not in told  # nothing is to be done


def test_looking_stops_at_a_tenth_of_what_it_tells(tmp_path, monkeypatch):
    tasks, calls = tasks_of(tmp_path, [100] * 40), []

    def estimated(source, *_, share, **__):
        calls.append(share)
        return Estimate(1.0, 1.0, 1.0, "", 2.5)

    monkeypatch.setattr(module, "config_of", lambda job: None)
    monkeypatch.setattr(module, "estimate", estimated)

    class Job:
        threads, output, options, source = 1, "", {}, ""

        def __init__(self, task):
            pass

    found = module.forecast(tasks, Job, 1)
    assert found.seconds == pytest.approx(40)
    assert len(calls) == 2  # 2.5 s is less than a tenth of 40 s, 5 s is not
    assert calls == [pytest.approx(0.1 * 40 / 6)] * 2


def test_a_batch_tells_of_very_much_before_it_begins(batch, tmp_path, monkeypatch):
    clip(tmp_path / "from" / "a.avi", count=120)
    assert "about" not in batch(tmp_path / "from", tmp_path / "to").err
    monkeypatch.setattr("adv2e.batches.run._LARGE_SOURCE", 1)
    monkeypatch.setattr("adv2e.conversion.estimate.MUCH", 1)
    done = batch(tmp_path / "from", tmp_path / "to", "--overwrite")
    assert done.status == 0
    assert "by short parts of 1 of 1 sequences" in done.err


def test_sequences_that_differ_far_are_told(tmp_path, monkeypatch):
    tasks, made = tasks_of(tmp_path, [100] * 6), [1.0, 2.0, 7.2, 3.0, 3.0, 3.0]
    monkeypatch.setattr(module, "config_of", lambda job: None)
    monkeypatch.setattr(
        module, "estimate", lambda source, *_, **__: Estimate(made[int(source)], 1.0, 1.0, "")
    )

    class Job:
        threads, output, options = 1, "", {}

        def __init__(self, task):
            self.source = task.sequence.name[1:]

    assert "some make 7 times as many" in module.forecast(tasks, Job, 1).basis
    made[2] = 4.0
    assert module.forecast(tasks, Job, 1).basis == "short parts of 6 of 6 sequences"


def test_the_room_of_a_folder_that_is_not_there_is_that_of_its_disk(tmp_path):
    assert free_bytes(tmp_path / "a" / "b") == pytest.approx(free_bytes(tmp_path), rel=0.2)

"""Batches inside the test process: what they decide and write down, without the time to start."""

import pytest
from trees_of_batch import QUICK

from adv2e.batch import processes
from adv2e.batch.work import do


@pytest.fixture
def batch(adv2e, monkeypatch):
    """Run ``adv2e batch`` with small settings, and each conversion in this process."""
    monkeypatch.setattr(processes, "run", lambda jobs, count: ((job, do(job)) for job in jobs))

    def run(*args):
        return adv2e("batch", *args, *QUICK)

    return run

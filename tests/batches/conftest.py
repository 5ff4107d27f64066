"""Batches inside the test process: what they decide and write down, without the time to start."""

import pytest
from trees_of_batch import QUICK, in_this_process

from adv2e.batches import processes


@pytest.fixture
def batch(adv2e, monkeypatch):
    """Run ``adv2e batch`` with small settings, and each conversion in this process."""
    monkeypatch.setattr(processes, "run", in_this_process)

    def run(*args):
        return adv2e("batch", *args, *QUICK)

    return run

import threading
import time

import numpy as np
import pytest

from adv2e.formats import work as work_module
from adv2e.formats.work import OrderedWork


def test_results_are_taken_in_the_order_of_submission():
    taken = []
    work = OrderedWork(4)

    def slow_when_even(number):
        time.sleep(0.002 * (number % 2 == 0))
        return number

    for number in range(50):
        work.submit(slow_when_even, number, take=taken.append)
    work.finish()

    assert taken == list(range(50))


def test_results_are_taken_by_the_submitting_thread():
    takers = set()
    work = OrderedWork(2)
    for _ in range(30):
        work.submit(threading.get_ident, take=lambda _: takers.add(threading.get_ident()))
    work.finish()

    assert takers == {threading.get_ident()}


def test_work_ahead_is_bounded():
    work = OrderedWork(1)
    running = threading.Event()
    submitted = []

    def submit_all():
        for number in range(100):
            work.submit(running.wait, take=lambda _: None)
            submitted.append(number)

    thread = threading.Thread(target=submit_all)
    thread.start()
    time.sleep(0.05)
    assert len(submitted) < 20
    running.set()
    thread.join()
    work.finish()
    assert len(submitted) == 100


def test_failure_of_a_task_reaches_the_caller():
    work = OrderedWork(1)
    work.submit(int, "no number", take=lambda _: None)
    with pytest.raises(ValueError, match="no number"):
        work.finish()
    work.abandon()


def test_memory_of_work_ahead_is_bounded(monkeypatch):
    monkeypatch.setattr(work_module, "PENDING_BYTES", 250)
    work = OrderedWork(4)
    begun, taken = [], []
    for _ in range(20):
        work.submit(len, np.zeros(100, np.uint8), take=taken.append)
        begun.append(1)
        assert len(begun) - len(taken) <= 2
    work.submit(len, np.zeros(1000, np.uint8), take=taken.append)  # too large, so by itself
    assert len(taken) == 20
    work.finish()
    assert taken == [100] * 20 + [1000]


def test_without_threads_the_one_that_submits_works():
    work = OrderedWork(0)
    taken = []
    work.submit(threading.get_ident, take=taken.append)
    assert taken == [threading.get_ident()]
    with pytest.raises(ValueError, match="no number"):
        work.submit(int, "no number", take=taken.append)
    work.finish()
    work.abandon()

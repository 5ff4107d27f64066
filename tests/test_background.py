import signal
import sys
import threading
import time
import weakref

import numpy as np
import pytest
from processes import running_python
from threads import own_threads, wait_until

from adv2e.background import OrderedWork, read_ahead, worker_pool


@pytest.fixture(autouse=True)
def _no_thread_is_left():
    assert own_threads() == []
    yield
    assert own_threads() == []


class Made:
    """An iterator over numbers that remembers who made how many, and whether it was closed."""

    def __init__(self, count=10**9, failing_at=None):
        self.count, self.failing_at = count, failing_at
        self.made = 0
        self.threads = set()
        self.closed_by = None

    def __iter__(self):
        return self

    def __next__(self):
        self.threads.add(threading.get_ident())
        if self.made == self.failing_at:
            raise ValueError("bad frame")
        if self.made == self.count:
            raise StopIteration
        self.made += 1
        return self.made - 1

    def close(self):
        self.closed_by = threading.get_ident()


def ahead(items, count=3):
    return read_ahead(items, count)


class TestReadAhead:
    def test_items_come_in_order_from_another_thread(self):
        source = Made(1000)
        with ahead(source) as items:
            assert list(items) == list(range(1000))
            assert list(items) == []
        assert threading.get_ident() not in source.threads
        assert source.closed_by in source.threads

    def test_no_items(self):
        with ahead(iter(())) as items:
            assert list(items) == []

    def test_what_is_ahead_is_bounded(self):
        source = Made()
        with ahead(source) as items:
            wait_until(lambda: source.made == 3)
            for number in range(5):
                assert next(items) == number
            wait_until(lambda: source.made == 7)
            time.sleep(0.02)
            assert source.made == 7

    def test_an_error_comes_after_the_items_before_it(self):
        seen = []
        with pytest.raises(ValueError, match="bad frame"), ahead(Made(failing_at=7)) as items:
            for item in items:
                seen.append(item)  # noqa: PERF402 - the error comes from the loop
        assert seen == list(range(7))

    def test_leaving_early_stops_and_closes_the_source(self):
        source = Made()
        with ahead(source) as items:
            assert next(items) == 0
        assert source.closed_by in source.threads
        assert source.made < 10

    def test_leaving_by_an_error_while_the_source_waits_for_room(self):
        source = Made()
        with pytest.raises(KeyError), ahead(source):
            wait_until(lambda: source.made == 3)
            raise KeyError
        assert source.closed_by in source.threads

    def test_generators_run_their_ending_in_the_thread_that_ran_them(self):
        ended = []

        def numbers():
            try:
                yield from range(100)
            finally:
                ended.append(threading.current_thread().name)

        with ahead(numbers()) as items:
            next(items)
        assert ended == ["adv2e-read_0"]


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


def test_memory_of_work_ahead_is_bounded():
    work = OrderedWork(4, limit=250)
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


def test_a_failure_ends_the_next_call_and_drops_those_that_wait():
    done = []
    gate = threading.Event()

    def fail():
        gate.wait()
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"), OrderedWork(1) as work:
        work.submit(done.append, 1)
        work.submit(fail)
        work.submit(done.append, 2)
        gate.set()
        while True:
            work.submit(done.append, 3)
    assert done == [1]


def test_a_failure_of_the_last_task_ends_the_block():
    with pytest.raises(ValueError, match="no number"), OrderedWork(1) as work:
        work.submit(int, "no number")


def test_an_error_of_the_block_drops_what_waits_and_is_what_is_raised():
    gate = threading.Event()
    done = []

    def slow():
        gate.wait()
        raise OSError("not the first")

    with pytest.raises(KeyError, match="mine"), OrderedWork(1) as work:
        work.submit(slow)
        work.submit(done.append, 1)
        threading.Timer(0.02, gate.set).start()
        raise KeyError("mine")
    assert done == []


def test_what_was_handed_out_is_not_held():
    class Big:
        pass

    with OrderedWork(1) as work:
        done = threading.Event()
        big = Big()
        held = weakref.ref(big)
        work.submit(lambda big: None, big)
        del big
        work.submit(done.set)
        done.wait()
        wait_until(lambda: held() is None)


INTERRUPTED = """
import signal, threading, time
from adv2e.background import OrderedWork, read_ahead
signal.signal(signal.SIGINT, signal.default_int_handler)

def numbers():
    try:
        while True:
            yield 1
    finally:
        print("source closed", flush=True)

try:
    with OrderedWork(1, count=2) as work, read_ahead(numbers(), 1) as items:
        print("ready", flush=True)
        for item in items:
            work.submit(time.sleep, 0.05)
except KeyboardInterrupt:
    print("interrupted", [thread.name for thread in threading.enumerate()], flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_an_interrupt_while_waiting_for_room_ends_both_threads():
    with running_python(INTERRUPTED, text=True) as process:
        assert process.stdout.readline() == "ready\n"
        time.sleep(0.3)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=20)
    assert (process.returncode, err) == (0, "")
    assert out.splitlines() == ["source closed", "interrupted ['MainThread']"]


def pooled():
    with worker_pool(2) as pool:
        yield pool
        yield pool.submit(int, "7")


def test_a_pool_waits_for_its_threads_at_the_end_and_on_errors():
    before = threading.active_count()
    _, seven = pooled()
    assert seven.result() == 7
    assert threading.active_count() == before
    with pytest.raises(ZeroDivisionError), worker_pool(2) as pool:
        late = pool.submit(time.sleep, 0.05)
        raise ZeroDivisionError
    assert late.done()
    assert threading.active_count() == before


def test_a_generator_may_be_closed_where_nobody_can_wait_for_its_threads():
    """As by the collector of garbage, in the midst of anything: here in a thread of the pool."""
    before = threading.active_count()
    made = pooled()
    pool = next(made)
    assert pool.submit(made.close).result(timeout=10) is None
    wait_until(lambda: threading.active_count() == before)
    with pytest.raises(RuntimeError):
        pool.submit(int)

import signal
import sys
import threading
import time
import weakref

import pytest
from processes import running_python
from threads import own_threads, wait_until

from adv2e.background import ReadAhead, WriteBehind, worker_pool


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


def ahead(items, limit=3):
    return ReadAhead(items, cost=lambda item: 1, limit=limit)


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
        with ahead(source, limit=3) as items:
            wait_until(lambda: source.made == 4)  # three that wait and one in the hand
            for number in range(5):
                assert next(items) == number
            wait_until(lambda: source.made == 8)  # the one taken last still counts
            time.sleep(0.02)
            assert source.made == 8

    def test_an_item_dearer_than_the_limit_passes_alone(self):
        source = Made(5)
        with ReadAhead(source, cost=lambda item: 100, limit=3) as items:
            assert next(items) == 0
            wait_until(lambda: source.made == 2)
            time.sleep(0.02)
            assert source.made == 2
            assert list(items) == [1, 2, 3, 4]

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
            wait_until(lambda: source.made == 4)
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
        assert ended == ["adv2e-read"]


class TestWriteBehind:
    def test_calls_are_made_in_order_by_another_thread(self):
        made = []
        with WriteBehind(5) as behind:
            for number in range(1000):
                behind.call(1, lambda n: made.append((n, threading.get_ident())), number)
        assert [number for number, _ in made] == list(range(1000))
        assert threading.get_ident() not in {thread for _, thread in made}

    def test_calls_that_wait_are_bounded(self):
        gate = threading.Event()
        accepted = []

        def submit():
            for number in range(10):
                behind.call(1, gate.wait)
                accepted.append(number)

        with WriteBehind(3) as behind:
            submitting = threading.Thread(target=submit)
            submitting.start()
            wait_until(lambda: len(accepted) == 3)  # the one at work counts
            time.sleep(0.02)
            assert len(accepted) == 3
            gate.set()
            submitting.join()
        assert len(accepted) == 10

    def test_a_failure_ends_the_next_call_and_drops_those_that_wait(self):
        done = []
        gate = threading.Event()

        def fail():
            gate.wait()
            raise OSError("disk full")

        with pytest.raises(OSError, match="disk full"), WriteBehind(100) as behind:
            behind.call(1, done.append, 1)
            behind.call(1, fail)
            behind.call(1, done.append, 2)
            gate.set()
            wait_until(lambda: not own_threads())
            behind.call(1, done.append, 3)
            raise AssertionError("not reached")
        assert done == [1]

    def test_a_failure_frees_who_waits_for_room(self):
        def fail():
            time.sleep(0.02)
            raise BrokenPipeError

        with pytest.raises(BrokenPipeError), WriteBehind(1) as behind:
            for _ in range(3):
                behind.call(1, fail)

    def test_a_failure_of_the_last_call_ends_the_block(self):
        with pytest.raises(ValueError, match="last"), WriteBehind(10) as behind:
            behind.call(1, int, "last")

    def test_an_error_of_the_block_drops_what_waits_and_is_what_is_raised(self):
        gate = threading.Event()
        done = []

        def slow():
            gate.wait()
            raise OSError("not the first")

        with pytest.raises(KeyError, match="mine"), WriteBehind(10) as behind:
            behind.call(1, slow)
            behind.call(1, done.append, 1)
            threading.Timer(0.02, gate.set).start()
            raise KeyError("mine")
        assert done == []

    def test_what_was_called_is_not_held(self):
        class Big:
            pass

        with WriteBehind(10) as behind:
            done = threading.Event()
            big = Big()
            held = weakref.ref(big)
            behind.call(1, lambda big: None, big)
            del big
            behind.call(1, done.set)
            done.wait()
            wait_until(lambda: held() is None)


INTERRUPTED = """
import signal, threading, time
from adv2e.background import ReadAhead, WriteBehind, worker_pool
signal.signal(signal.SIGINT, signal.default_int_handler)

def numbers():
    try:
        while True:
            yield 1
    finally:
        print("source closed", flush=True)

try:
    with WriteBehind(2) as behind, ReadAhead(numbers(), cost=int, limit=1) as items:
        print("ready", flush=True)
        for item in items:
            behind.call(1, time.sleep, 0.05)
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

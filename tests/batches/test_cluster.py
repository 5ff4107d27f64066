"""Batches on a Dask cluster of this machine: a real scheduler, and workers that come and go."""

import os
import re
import signal
import subprocess
import sys
import threading
import time
from contextlib import ExitStack
from pathlib import Path

import pytest
import trees_of_batch as trees
from trees_of_batch import QUICK, clip, last_of, made_in

from adv2e.batches import cluster as engine
from adv2e.batches.cluster import Proof

pytest.importorskip("distributed")
pytestmark = [
    pytest.mark.thorough,
    pytest.mark.skipif(sys.platform == "win32", reason="needs signals"),
]

EFFECT = """
import os, signal, time
from dataclasses import dataclass
from pathlib import Path
from adv2e.effects.hooks import Hooks
from adv2e.parameters import Section, parameter

@dataclass(frozen=True, kw_only=True)
class Parameters(Section):
    folder: str = parameter(unit="-", meaning="folder of the files that say what to do")

class Obeying(Hooks):
    '''Waits as long as a file is there; wide clips crash, wider ones end the worker.'''
    name = "obeying"
    stage = "frames"
    Parameters = Parameters
    def light(self, frames):
        folder = Path(self.parameters.folder)
        (folder / f"{os.getppid()}-{os.getpid()}").touch()
        while (folder / "wait").exists():
            time.sleep(0.01)
        if self.view.columns > 40 and not (folder / "good").exists():
            os.kill(os.getppid() if self.view.columns > 48 else os.getpid(), signal.SIGKILL)
        yield from frames
"""


def until(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def is_there(process):
    """Tell whether a process that is no child of this one runs."""
    try:
        state = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return False
    return state != "Z"


class Machines:
    """A scheduler and its workers, none of which sees the folder that this process is in."""

    def __init__(self, folder, stack):
        self.folder, self.file, self._stack = folder, folder / "scheduler.json", stack
        self._workers = []
        self.scheduler = self._start("scheduler", "--port", "0", "--host", "127.0.0.1")
        until(self.file.exists)

    def _start(self, name, *arguments):
        # not with -m: what converts would import that module, too
        script = f"from distributed.cli.dask_{name} import main; main()"
        started = [sys.executable, "-c", script, "--no-dashboard"]
        log = self._stack.enter_context((self.folder / "log").open("ab"))
        process = self._stack.enter_context(
            subprocess.Popen(
                [*started, *arguments, "--scheduler-file", self.file],
                cwd=self.folder, stdout=log, stderr=log,
                env={**os.environ, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"},
            )
        )  # fmt: skip
        self._stack.callback(process.kill)
        return process

    def workers(self, count):
        """Return so many processes of workers, as many of them new as are missing."""
        self._workers = [one for one in self._workers if one.poll() is None]
        missing = count - len(self._workers)
        for surplus in self._workers[count:]:
            surplus.kill()
            surplus.wait()
        new = [self._start("worker", "--nthreads", "1", "--no-nanny") for _ in range(missing)]
        self._workers = [*self._workers[:count], *new]
        return self._workers


@pytest.fixture(scope="module")
def machines(tmp_path_factory):
    with ExitStack() as stack:
        yield Machines(tmp_path_factory.mktemp("machines"), stack)


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder with an effect of one's own, and files that say what it does."""
    monkeypatch.chdir(tmp_path)
    Path("obeying.py").write_text(EFFECT)
    Path("told").mkdir()
    Path("own.yaml").write_text(f"user: {{obeying: {{folder: {tmp_path}/told}}}}\n")
    return tmp_path


SETTINGS = ("-c", "own.yaml", "--effect", "obeying.py")
GIVEN = ("source", "dest", *SETTINGS, *QUICK)


def told():
    """Return the processes that have converted something: of workers, and their own."""
    return [tuple(map(int, p.name.split("-"))) for p in Path("told").glob("*-*")]


@pytest.fixture
def local(batch):
    """Return what the same batch makes in this process."""

    def run(*more):
        Path("told/good").touch()
        assert batch("source", "local", *SETTINGS, *more).status == 0
        return made_in(Path("local"))

    return run


def strays():
    return [*Path("dest").rglob(".adv2e*")]


def beside(task, *arguments):
    """Run something in a thread while the test waits."""
    thread = threading.Thread(target=task, args=arguments)
    thread.start()
    return thread


def test_three_workers_of_which_one_is_killed(adv2e, local, machines, place):
    for k in range(8):
        clip(Path(f"source/{'deep/' * (k % 2)}{k}.avi"), start=k)
    Path("told/wait").touch()
    machines.workers(2)
    killed = []

    def kill():
        until(lambda: len(told()) == 2)
        three = machines.workers(3)  # one joins
        until(lambda: len(told()) == 3)
        assert {worker for worker, _ in told()} == {one.pid for one in three}
        until(lambda: len(strays()) == 3)
        killed.extend(next(pair for pair in told() if pair[0] == three[0].pid))
        three[0].kill()
        Path("told/wait").unlink()

    thread = beside(kill)
    more = ("--export", "voxel", "--bins", 3, "--window", "20ms")
    done = adv2e("batch", *GIVEN, *more, "--scheduler", machines.file)
    thread.join()
    assert done.status == 0, done.err
    assert done.out.startswith("8 sequences: 8 made (")
    assert re.search(r"scheduler.json: workers: [12], threads: [12]", done.err)
    assert made_in(Path("dest")) == local(*more)
    until(lambda: not strays() and not is_there(killed[1]))
    again = adv2e("batch", *GIVEN, *more)
    assert again.out == "8 sequences: 0 made (0 events), 8 kept, 0 failed\n"


def test_a_sequence_that_crashes_is_named_and_the_worker_goes_on(
    adv2e, machines, place, monkeypatch
):
    monkeypatch.setattr(engine, "_RETRIES", 1)
    for name, width in (("crashes", 44), ("z", 32)):
        clip(Path(f"source/{name}.avi"), size=(width, 24))
    (worker,) = machines.workers(1)
    done = adv2e("batch", *GIVEN, "--scheduler", machines.file)
    assert done.status == 1
    assert done.out.startswith("2 sequences: 1 made ("), done.err
    assert "crashes.avi: the process that converted it was ended from outside" in done.err
    assert len([pair for pair in told() if pair[0] == worker.pid]) == 3  # begun again once
    assert worker.poll() is None
    assert not strays()


def test_a_sequence_that_ends_workers_is_named_and_the_others_go_on(adv2e, local, machines, place):
    for name, width in (("a", 32), ("ends", 52), ("z", 32)):
        clip(Path(f"source/{name}.avi"), size=(width, 24))
    machines.workers(2)

    def replace():
        for _ in range(2):
            two = machines.workers(2)
            until(lambda: any(one.poll() is not None for one in two))  # noqa: B023 - at once
        machines.workers(1)

    thread = beside(replace)
    done = adv2e("batch", *GIVEN, "--scheduler", machines.file)
    thread.join()
    assert done.status == 1
    assert done.out.startswith("3 sequences: 2 made ("), done.err
    assert "ends.avi: 2 workers ended while they had it" in done.err
    until(lambda: not strays())
    Path("told/good").touch()
    again = adv2e("batch", *GIVEN, "--scheduler", machines.file)
    assert "1 it failed, 2 kept" in again.err
    assert made_in(Path("dest")) == local()


def test_a_batch_that_is_stopped_ends_its_conversions(adv2e, local, machines, place):
    clip(Path("source/a.avi"))
    (worker,) = machines.workers(1)
    Path("told/wait").touch()
    process = subprocess.Popen(
        trees.command(*GIVEN, "--scheduler", machines.file), stderr=subprocess.DEVNULL
    )
    until(lambda: strays() and told())
    process.send_signal(signal.SIGTERM)
    assert process.wait(10) == 143
    ((_, converting),) = told()
    until(lambda: not is_there(converting) and not strays())
    assert made_in(Path("dest")) == {}
    assert worker.poll() is None
    Path("told/wait").unlink()
    again = adv2e("batch", *GIVEN, "--scheduler", machines.file)
    assert "1 it was not finished" in again.err
    assert made_in(Path("dest")) == local()


def test_a_source_that_the_workers_do_not_see_fails(adv2e, machines, place):
    clip(Path("source/a.avi"))
    clip(Path("source/b.avi"))
    machines.workers(1)
    Path("told/wait").touch()

    def remove():
        until(told)
        Path("source/b.avi").unlink()
        Path("told/wait").unlink()

    thread = beside(remove)
    done = adv2e("batch", *GIVEN, "--scheduler", machines.file, "--jobs", 1)
    thread.join()
    assert done.status == 1
    error = last_of(Path("dest"))["b"]["error"]
    assert error.startswith(f"{place}/source/b.avi: No such file")
    assert "(on the worker tcp://127.0.0.1:" in error
    assert sorted(made_in(Path("dest"))) == ["a.h5"]


def test_a_worker_of_another_version_ends_the_batch(adv2e, machines, place, monkeypatch):
    clip(Path("source/a.avi"))
    machines.workers(1)
    monkeypatch.setattr(engine, "__version__", "99.0")
    done = adv2e("batch", *GIVEN, "--scheduler", machines.file)
    assert done.status == 1
    last = done.err.splitlines()[-1]
    assert "scheduler.json: the worker tcp://127.0.0.1:" in last
    assert "install 99.0, as here" in last
    assert made_in(Path("dest")) == {}


def test_what_a_worker_must_be_and_see(tmp_path):
    here, there = tmp_path / "here", tmp_path / "there"
    here.write_bytes(b"one line\n")
    proof = Proof.of(here)
    here.write_bytes(b"one line\nand more\n")
    assert proof.complaint() == ""
    assert (
        "another folder of the name of DEST"
        in proof.__class__(proof.version, str(here), proof.bytes, "0").complaint()
    )
    there.write_bytes(b"another\n")
    elsewhere = Proof(proof.version, str(there), proof.bytes, proof.sha256)
    assert "another folder of the name of DEST" in elsewhere.complaint()
    there.unlink()
    assert "does not see DEST: " in elsewhere.complaint()


def test_files_that_workers_do_not_see_travel(tmp_path):
    file, folder = tmp_path / "effect.py", str(tmp_path / "of worker")
    copy = Path(engine._file(str(file), b"text", folder))
    assert (copy.name, copy.read_bytes()) == ("effect.py", b"text")
    file.write_bytes(b"text here")
    assert engine._file(str(file), b"text here", folder) == str(file)
    assert Path(engine._file(str(file), b"text there", folder)).read_bytes() == b"text there"


def test_no_worker_is_waited_for_and_told(adv2e, machines, place, monkeypatch):
    clip(Path("source/a.avi"))
    machines.workers(0)
    monkeypatch.setattr(engine, "WAIT_S", 1.0)
    done = adv2e("batch", *GIVEN, "--scheduler", machines.file)
    assert done.status == 1
    *_, waits, ended = done.err.splitlines()
    assert waits.endswith("scheduler.json: waits for workers, 1 s at most")
    assert ended.endswith("scheduler.json: no worker for 1 s: start some, and call again")


def test_a_lost_scheduler_ends_the_batch(adv2e, place, tmp_path_factory):
    clip(Path("source/a.avi"))
    Path("told/wait").touch()
    with ExitStack() as stack:
        own = Machines(tmp_path_factory.mktemp("own"), stack)
        own.workers(1)

        def end():
            until(told)
            own.scheduler.kill()

        thread = beside(end)
        done = adv2e("batch", *GIVEN, "--scheduler", own.file)
        thread.join()
        assert done.status == 1
        assert done.err.splitlines()[-1].endswith(
            "scheduler.json: the connection to the scheduler is lost: call again to go on"
        )
        until(lambda: not strays())
    assert made_in(Path("dest")) == {}


@pytest.mark.parametrize(
    "wrong", ["node1", "node1:port", "http//node1:1", "tcp://:8786", "none.json"]
)
def test_wrong_forms_of_addresses(adv2e, place, wrong):
    clip(Path("source/a.avi"))
    done = adv2e("batch", *GIVEN, "--scheduler", wrong)
    assert done.status == 2
    assert f"--scheduler {wrong}: must be an address with its port" in done.err
    assert not Path("dest").exists()


def test_no_scheduler_there(adv2e, place, monkeypatch):
    clip(Path("source/a.avi"))
    monkeypatch.setattr(engine, "CONNECT_S", 0.5)
    done = adv2e("batch", *GIVEN, "--scheduler", "127.0.0.1:9")
    assert done.status == 1
    assert "127.0.0.1:9: no scheduler of this Dask answers there" in done.err.splitlines()[-1]
    for text in ("{}", "[]", "none"):
        Path("some.json").write_text(text)
        done = adv2e("batch", *GIVEN, "--scheduler", "some.json")
        assert done.status == 1
        assert "some.json: is not what a scheduler of Dask wrote" in done.err


def test_without_dask_the_extra_is_named(adv2e, place, monkeypatch):
    clip(Path("source/a.avi"))
    monkeypatch.setattr(engine, "find_spec", lambda name: None)
    done = adv2e("batch", *GIVEN, "--scheduler", "node1:8786")
    assert done.status == 1
    assert "pip install 'adv2e[cluster]'" in done.err

"""Conversions on the workers of a Dask cluster: the same jobs, on other machines.

The batch itself stays in one process, here, which alone plans and writes the manifest.  A worker
has as many jobs at a time as threads, and does each in a process beside its own.  So a crash costs
the worker nothing, and what nobody wants any more is ended at once: where the batch was stopped or
killed, or its connection broke, the scheduler drops its jobs.

If a worker is lost, the scheduler has others do its jobs again.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
import math
import queue
import re
import threading
import time
import uuid
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.util import find_spec
from multiprocessing.util import Finalize
from pathlib import Path
from typing import TYPE_CHECKING, Any

from adv2e import __version__
from adv2e.batches.processes import EndedError, Workers
from adv2e.batches.work import Job
from adv2e.errors import Adv2eError, DataError, MissingExtraError, UsageError, one_line
from adv2e.files.regular import read_text_bytes
from adv2e.files.states import state_of
from adv2e.files.workspace import remove_abandoned

if TYPE_CHECKING:
    from distributed import Client, Future

CONNECT_S = 20.0
WAIT_S = 600.0
"""Longest wait of a batch while there is no worker at all [s]."""

_TICK_S = 1.0
_ANSWER_S = 10.0
_RETRIES = 2
"""Retries of a job whose process ended, but not the worker."""

_ADDRESS = re.compile(r"([a-z]+://)?(\[[0-9A-Fa-f:.%]+\]|[^\s:/\[\]]+):[0-9]{1,5}")


@dataclass(frozen=True)
class Proof:
    """Check of a worker: it must have the same version of adv2e, and see the same DEST.

    Attributes
    ----------
    version : str
        Of adv2e.
    manifest : str
        The file in DEST.
    sha256 : str
        Of that many bytes at its start, among which are lines of this run.
    """

    version: str
    manifest: str
    bytes: int
    sha256: str

    @classmethod
    def of(cls, manifest: Path) -> Proof:
        text = manifest.read_bytes()
        return cls(__version__, str(manifest), len(text), hashlib.sha256(text).hexdigest())

    def complaint(self) -> str:
        """Return the reason why the process that asks is unfit, or ""."""
        if self.version != __version__:
            return f"has adv2e {__version__}: install {self.version}, as here"
        try:
            with Path(self.manifest).open("rb") as file:
                text = file.read(self.bytes)
        except OSError as error:
            return f"does not see DEST: {self.manifest}: {error.strerror}"
        if hashlib.sha256(text).hexdigest() != self.sha256:
            return f"has another folder of the name of DEST: {Path(self.manifest).parent}"
        return ""


class Cluster:
    """An engine (:data:`adv2e.batches.work.Engine`): the workers of a scheduler.

    Parameters
    ----------
    scheduler : str
        Its address, such as tcp://node1:8786, or the file that it wrote (``--scheduler-file``).
    manifest : Path
        That of the batch, which the workers must see, too.
    at_most : int, optional
        Conversions at a time; default: as many as the workers have threads.
    threads : int
        Of each conversion.
    log : callable
        Told how many workers there are, and when there are none.

    Raises
    ------
    UsageError, DataError
        `scheduler` is no address, or no such file.
    MissingExtraError
        There is no Dask here.
    """

    def __init__(
        self,
        scheduler: str,
        manifest: Path,
        *,
        at_most: int | None = None,
        threads: int = 1,
        log: Callable[[str], None] = lambda text: None,
    ) -> None:
        if find_spec("distributed") is None:
            raise MissingExtraError("--scheduler", "cluster")
        self._address = _address_in(scheduler)
        self._scheduler, self._manifest = scheduler, manifest
        self._at_most, self._threads, self._log = at_most, threads, log

    def __call__(self, jobs: Iterable[Job], count: int) -> Iterator[tuple[Job, dict[str, Any]]]:
        """Yield each job with what :func:`adv2e.batches.work.do` returned, as they end.

        Raises
        ------
        Adv2eError
            There is no scheduler, no worker for :data:`WAIT_S`, or one that would do something else
            than this process.
        """
        client = self._connect()
        try:
            workers = _Workers(client, self._scheduler, self._log)
            yield from self._run(client, workers, iter(jobs))
        finally:
            with suppress(OSError, asyncio.TimeoutError):
                client.close(timeout=_TICK_S)

    def _connect(self) -> Client:
        from distributed import Client  # noqa: PLC0415 - an extra

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # tables of versions, of packages that play no part
            try:
                return Client(self._address, timeout=CONNECT_S, set_as_default=False, name="adv2e")
            except Exception as error:  # many kinds, where versions of Dask differ
                raise Adv2eError(
                    f"{self._scheduler}: no scheduler of this Dask answers there:"
                    f" {type(error).__name__}: {one_line(error)}"
                ) from error

    def _run(
        self, client: Client, workers: _Workers, coming: Iterator[Job]
    ) -> Iterator[tuple[Job, dict[str, Any]]]:
        proof = Proof.of(self._manifest.absolute())
        # those of effects travel, so that workers need not see them
        texts: dict[str, bytes] = {}
        folders: set[str] = set()
        done: queue.SimpleQueue[Future] = queue.SimpleQueue()
        flying: dict[str, Job] = {}
        job = next(coming, None)
        while job is not None or flying:
            room = workers.room()
            while job is not None and len(flying) < min(room, self._at_most or room):
                missing = set(job.effect_files) - texts.keys()
                texts |= {name: Path(name).read_bytes() for name in missing}
                sent = replace(_anywhere(job), threads=self._threads)
                made = filter(None, (sent.output, sent.export_folder))
                folders |= {str(Path(path).parent) for path in made}
                key = f"adv2e-{uuid.uuid4().hex}"
                future = client.submit(
                    _do, sent, proof, texts, key=key, pure=False, retries=_RETRIES
                )
                flying[key] = job
                future.add_done_callback(done.put)
                job = next(coming, None)
            try:
                future = done.get(timeout=_TICK_S)
                found = _found(future, flying[future.key])
            except queue.Empty:
                continue
            except (asyncio.TimeoutError, OSError):  # its worker is lost, and another does it again
                done.put(future)
                continue
            if found is None:
                raise workers.lost()
            if "unfit" in found:
                raise Adv2eError(f"{self._scheduler}: the worker {found['unfit']}")
            yield flying.pop(future.key), found
            job = job or next(coming, None)
        if workers.some_ended:
            workers.each(_sweep, sorted(folders))


def _anywhere(job: Job) -> Job:
    """Return the job with paths that do not depend on the folder that a process is in."""
    paths = {name: getattr(job, name) for name in ("source", "output", "export_folder")}
    whole: dict[str, Any] = {name: str(Path(p).absolute()) for name, p in paths.items() if p}
    return replace(job, **whole)


def _address_in(scheduler: str) -> str:
    """Return the address that is given, or that which a file of a scheduler tells."""
    address = scheduler
    if Path(scheduler).is_file():
        try:
            address = str(json.loads(read_text_bytes(Path(scheduler), DataError))["address"])
        except (ValueError, LookupError, TypeError):
            raise DataError(f"{scheduler}: is not what a scheduler of Dask wrote") from None
    if not _ADDRESS.fullmatch(address):
        raise UsageError(
            f"--scheduler {scheduler}: must be an address with its port, such as"
            " tcp://node1:8786, or the file that the scheduler wrote"
        )
    return address


class _Workers:
    """The workers that there are, as the scheduler tells once a second."""

    def __init__(self, client: Client, scheduler: str, log: Callable[[str], None]) -> None:
        self._client, self._scheduler, self._log = client, scheduler, log
        self._threads: dict[str, int] | None = None
        self._asked = self._seen = -math.inf
        self.some_ended = False

    def room(self) -> int:
        """Return the number of jobs that may be submitted at a time: that of the workers' threads.

        More would wait at workers, and Dask would suspect them where a worker ends.
        """
        now = time.monotonic()
        if now >= self._asked + _TICK_S:
            self._asked = now
            self._look(now)
        return sum(self._threads.values()) if self._threads else 0

    def _look(self, now: float) -> None:
        before = self._threads
        try:
            self._threads = self._client.nthreads(callback_timeout=CONNECT_S)
        except (OSError, RuntimeError, asyncio.TimeoutError) as error:
            raise self.lost() from error
        if before is None or bool(before) != bool(self._threads):
            count = f"workers: {len(self._threads)}, threads: {sum(self._threads.values())}"
            wait = f"waits for workers, {WAIT_S:.0f} s at most"
            self._log(f"{self._scheduler}: {count if self._threads else wait}")
        if before is None or self._threads:
            self._seen = now
        if before is not None and not before.keys() <= self._threads.keys():
            self.some_ended = True
        if now > self._seen + WAIT_S:
            raise Adv2eError(
                f"{self._scheduler}: no worker for {WAIT_S:.0f} s: start some, and call again"
            )

    def each(self, function: Callable[..., object], *arguments: object) -> None:
        """Call a function here and on each worker, but do not wait long for it."""
        function(*arguments)
        self._look(time.monotonic())
        there = [
            self._client.submit(function, *arguments, workers=[one], pure=False)
            for one in self._threads or ()
        ]
        with suppress(OSError, asyncio.TimeoutError):
            for one in there:
                one.exception(timeout=_ANSWER_S)

    def lost(self) -> Adv2eError:
        return Adv2eError(
            f"{self._scheduler}: the connection to the scheduler is lost: call again to go on"
        )


def _found(future: Future, job: Job) -> dict[str, Any] | None:
    """Return the result of a job; None: the connection is lost.

    Raises
    ------
    TimeoutError, OSError
        The result cannot be fetched yet, as the worker that held it is lost.
    """
    from distributed import KilledWorker  # noqa: PLC0415 - an extra

    if future.cancelled():
        return None
    try:
        found: dict[str, Any] = future.result(timeout=_ANSWER_S)
    except CancelledError:
        return None
    except Exception:
        if future.status != "error":
            raise
    else:
        return found
    error = future.exception()
    if isinstance(error, EndedError):
        return {"error": str(error)}
    if isinstance(error, KilledWorker):
        count = error.allowed_failures + 1
        return {"error": f"{job.source}: {count} workers ended while they had it"}
    return {  # it could not even begin
        "unfit": f"or the scheduler has no adv2e {__version__}, or another Python or Dask than"
        f" here: {type(error).__name__}: {one_line(error)}"
    }


# ---- what workers run


_lock = threading.Lock()
_processes: list[Workers] = []


def _do(job: Job, proof: Proof, texts: dict[str, bytes]) -> dict[str, Any]:
    """Return the result of :func:`adv2e.batches.work.do`; or ``unfit``, with the reason."""
    from distributed import Reschedule, Status, get_worker  # noqa: PLC0415 - an extra

    worker = get_worker()
    key = worker.get_current_task()

    def is_wanted() -> bool:
        task = worker.state.tasks.get(key)
        ending = worker.status in (Status.closing, Status.closed, Status.failed)
        return not ending and task is not None and task.state in ("executing", "long-running")

    told = _complaint(proof)
    if told:
        return {"unfit": f"{worker.address} {told}"}
    on = f" (on the worker {worker.address})"
    source = Path(job.source)
    if job.state is not None and source.exists() and not job.state.is_alike(state_of(source)):
        return {"error": f"{source}: is another one than where the batch runs{on}"}
    try:
        here = replace(
            job,
            effect_files=tuple(
                _file(name, texts[name], worker.local_directory) for name in job.effect_files
            ),
        )
        found = _workers(worker.state.nthreads).do(here, is_wanted)
    except EndedError:
        if is_wanted():
            raise
        raise Reschedule from None
    if "error" in found:
        found["error"] += on
    return found


_complaint = lru_cache(maxsize=1)(Proof.complaint)


def _workers(count: int) -> Workers:
    with _lock:
        if not _processes:
            workers = Workers(count)
            _processes.append(workers)
            # before the process waits for them to end by themselves
            Finalize(None, workers.remove_now, exitpriority=1)
        return _processes[0]


@lru_cache(maxsize=64)
def _file(name: str, text: bytes, folder: str) -> str:
    """Return a file of that name on this machine that holds a text: itself, or a copy in `folder`.

    `folder` is that of the worker, which Dask removes.
    """
    with suppress(OSError):
        if Path(name).read_bytes() == text:
            return name
    copy = Path(folder) / hashlib.sha256(text).hexdigest() / Path(name).name
    copy.parent.mkdir(parents=True, exist_ok=True)
    copy.write_bytes(text)
    return str(copy)


def _sweep(folders: Iterable[str]) -> None:
    for folder in folders:
        remove_abandoned(Path(folder))

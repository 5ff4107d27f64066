"""Conversions of which source or result has a URL: fetched, converted here, put there.

fsspec opens the URLs.  Nothing is converted over the network: a source is copied to a temporary
folder first, and the result from there.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from datetime import datetime
from importlib.util import find_spec
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from adv2e.errors import Adv2eError, DataError, MissingExtraError, UsageError
from adv2e.files.workspace import Workspace, remove_abandoned
from adv2e.process import cleanup

if TYPE_CHECKING:
    from adv2e.batch.work import Job

_RENAMING = {"file", "local", "sftp", "ssh", "smb", "hdfs", "arrow_hdfs", "webhdfs", "ftp"}
"""Protocols of file systems in which a file is seen while it is written, and can be renamed.

In object stores a file is there when it is whole, and renaming is copying.
"""

_DIGESTS = ("ETag", "etag", "md5Hash", "content_md5")
_TIMES = ("mtime", "LastModified", "last_modified", "created")


def is_url(name: str) -> bool:
    """Tell whether a name is a URL, such as s3://bucket/videos."""
    return "://" in name


def open_url(url: str) -> tuple[Any, str]:
    """Return the file system of a URL, and the path in it.

    Raises
    ------
    MissingExtraError
        There is no fsspec.
    Adv2eError
        It knows no such protocol, or what that needs is not installed.
    """
    if find_spec("fsspec") is None:
        raise MissingExtraError(url, "remote")
    from fsspec.core import url_to_fs  # noqa: PLC0415 - an extra

    try:
        system, path = url_to_fs(url)
    except ValueError as error:
        raise UsageError(f"{url}: {error}") from None
    except ImportError as error:
        raise Adv2eError(f"{url}: {error}") from None
    return system, str(path).rstrip("/")


@contextmanager
def reaching(url: str) -> Iterator[None]:
    """Make one line of what the clients of stores raise, which are all kinds of exceptions."""
    try:
        yield
    except Adv2eError:
        raise
    except Exception as error:
        reason = error.strerror if isinstance(error, OSError) else None
        text = reason or f"{type(error).__name__}: {' '.join(str(error).split())}"
        raise DataError(f"{url}: {text}") from error


def files_below(system: Any, path: str) -> dict[str, Mapping[str, Any]]:
    """Return the metadata of each file below a path, by relative name; "" for a path of a file.

    Raises
    ------
    DataError
        A name leads out of the folder.
    """
    system.invalidate_cache()
    found = {}
    for name, about in system.find(path, detail=True).items():
        below = name[len(path) :].lstrip("/")
        inside = name == path or name.startswith(f"{path}/")
        if not inside or {"..", "."} & {*below.split("/")} or {"\0", "\\"} & {*below}:
            raise DataError(f"{name}: names of files must not lead out of their folder")
        found[below] = about
    return found


def token(about: Mapping[str, Any]) -> str:
    """Return a token of the content of a file: its size, and a digest or its time of change."""
    digest = next((str(about[key]) for key in _DIGESTS if about.get(key)), "")
    return f"{about['size']} {digest or changed_s(about)}"


def changed_s(about: Mapping[str, Any]) -> float:
    """Return the time of the last change of a file [s]; 0: unknown."""
    when = next((about[key] for key in _TIMES if about.get(key)), 0)
    if isinstance(when, datetime):
        return when.timestamp()
    return float(when) if isinstance(when, (int, float)) else 0.0


def put(system: Any, source: Path, target: str) -> None:
    """Copy a file; nothing of that name is seen before it is whole."""
    protocols = {system.protocol} if isinstance(system.protocol, str) else {*system.protocol}
    if not protocols & _RENAMING:
        system.put_file(str(source), target)
        return
    folder, _, name = target.rpartition("/")
    system.makedirs(folder, exist_ok=True)
    part = f"{folder}/.{name}.part"  # what a killed run left is replaced
    system.put_file(str(source), part)
    system.mv(part, target)


class Scratch(cleanup.Unfinished):
    """A temporary folder; if this process is killed, the next one that makes one removes it."""

    def __init__(self) -> None:
        self._base = Path(tempfile.gettempdir())
        self._folder = Workspace(self._base)

    def __enter__(self) -> Path:
        remove_abandoned(self._base)
        cleanup.add(self)
        self._folder.make()
        folder = self._folder.written("0")
        folder.mkdir()
        return folder

    def __exit__(self, *_: object) -> None:
        self.remove_now()
        cleanup.drop(self)

    def remove_now(self) -> bool:
        """Remove it with all that is in it."""
        self._folder.remove()
        return True


def through(job: Job, do: Callable[[Job], dict[str, Any]]) -> dict[str, Any]:
    """Return the result of a job with URLs: source downloaded, `do` called, output uploaded.

    ``remote`` in it has the names of the uploaded files, beside the output or below it, each with
    its :func:`token`.
    """
    with Scratch() as folder:
        here = job
        if is_url(job.source) and not job.only_export:
            with reaching(job.source):
                here = replace(here, source=str(_fetch(job.source, folder / "source")))
        if is_url(job.output):
            (folder / "made").mkdir()
            name = PurePosixPath(job.output).name
            here = replace(here, output=str(folder / "made" / name))
        found = do(here)
        if "error" in found:
            told = found["error"].replace(here.source, job.source)
            found["error"] = told.replace(here.output, job.output)
        elif is_url(job.output):
            with reaching(job.output):
                found["remote"] = dict(_put_all(folder / "made", job.output))
        return found


def _fetch(url: str, folder: Path) -> Path:
    system, path = open_url(url)
    target = folder / PurePosixPath(path).name
    for name in files_below(system, path):
        file = target / name
        file.parent.mkdir(parents=True, exist_ok=True)
        system.get_file(f"{path}/{name}" if name else path, str(file))
    if not target.exists():
        raise DataError(f"{url}: no such file or folder")
    return target


def _put_all(made: Path, url: str) -> Iterator[tuple[str, str]]:
    """Put all files beside the output, those of the output itself last."""
    system, path = open_url(url)
    above, _, main = path.rpartition("/")
    if system.isdir(path):  # another run may have made more
        system.rm(path, recursive=True)
    files = [file for file in sorted(made.rglob("*")) if file.is_file()]
    for file in sorted(files, key=lambda one: one.relative_to(made).parts[0] == main):
        name = file.relative_to(made).as_posix()
        put(system, file, f"{above}/{name}")
        yield name, token(system.info(f"{above}/{name}"))

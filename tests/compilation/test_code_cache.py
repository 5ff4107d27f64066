"""The folder of compiled code: only what the user made himself, whole, is used."""

import os
import shutil
import stat
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from adv2e.compilation import code_cache
from adv2e.compilation.code_cache import CodeCache

SOMEBODY = 65534
posix = pytest.mark.skipif(os.name != "posix", reason="owners and modes of POSIX")
root = pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root gives files away"
)


@pytest.fixture
def base(tmp_path, monkeypatch):
    """Where the folder may lie: below one folder."""
    for name in ("NUMBA_CACHE_DIR", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("HOME", os.devnull)
    return tmp_path / "cache" / "adv2e"


def refused(why):
    cache = CodeCache("kernels-1")
    assert (cache.folder, cache.why_not) == (None, why)


@posix
def test_a_folder_is_made_for_the_user_alone(base):
    cache = CodeCache("kernels-1")
    assert cache.folder == (base / "kernels-1").resolve()
    for folder in (cache.folder, cache.folder.parent):
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert CodeCache("kernels-1").folder == cache.folder


@posix
@pytest.mark.parametrize("mode", [0o777, 0o770, 0o702])
@pytest.mark.parametrize("which", ["", "kernels-1"])
def test_a_folder_that_others_may_write_to_is_not_used(base, which, mode):
    CodeCache("kernels-1")
    folder = base / which
    folder.chmod(mode)
    refused(f"others may write to {folder} (chmod go-w would mend it)")
    folder.chmod(0o700)
    assert CodeCache("kernels-1").folder


@root
@pytest.mark.parametrize("which", ["", "kernels-1"])
def test_a_folder_of_another_user_is_not_used(base, which):
    CodeCache("kernels-1")
    os.chown(base / which, SOMEBODY, SOMEBODY)
    refused(f"{base / which} belongs to another user")


@root
def test_a_link_that_another_user_laid_is_not_followed(base):
    mine = base.parents[1] / "mine"
    (mine / "kernels-1").mkdir(mode=0o700, parents=True)
    mine.chmod(0o700)
    base.parent.mkdir()
    base.symlink_to(mine)
    assert CodeCache("kernels-1").folder == (mine / "kernels-1").resolve()
    os.chown(base, SOMEBODY, SOMEBODY, follow_symlinks=False)
    refused(f"{base} belongs to another user")


def test_what_is_in_the_way_or_full_or_cannot_be_locked_is_said(base, monkeypatch):
    usage = shutil.disk_usage("/")
    with monkeypatch.context() as patch:
        patch.setattr(code_cache.shutil, "disk_usage", lambda _: usage._replace(free=1 << 20))
        refused(f"{base / 'kernels-1'}: less than 64 MiB are free")
    with monkeypatch.context() as patch:
        patch.setattr(code_cache, "lock_file", lambda *_, **__: False)
        refused(f"{base / 'kernels-1'}: its file system knows no locks")
    shutil.rmtree(base)
    base.write_text("in the way")
    refused(f"{base}: File exists")


def test_the_first_folder_that_will_do_is_taken(base, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(base.parents[1] / "numba"))
    assert CodeCache("kernels-1").folder == base.parents[1] / "numba" / "adv2e" / "kernels-1"
    shutil.rmtree(base.parents[1] / "numba")
    (base.parents[1] / "numba").write_text("in the way")
    cache = CodeCache("kernels-1")
    assert cache.folder == base / "kernels-1"
    assert not cache.why_not


def test_only_what_the_manifest_lists_and_as_it_was_stays(base):
    cache = CodeCache("kernels-1")
    code = cache.checked("parts/f") / "kernel_0"
    code.mkdir(parents=True)
    for name in ("a.nbi", "a.1.nbc", "changed.nbc"):
        (code / name).write_bytes(bytes(range(60)))
    cache.note_files("parts/f")
    (code / "later.nbc").write_bytes(b"killed before it was noted")
    data = bytearray((code / "changed.nbc").read_bytes())
    data[7] ^= 1
    (code / "changed.nbc").write_bytes(data)
    CodeCache("kernels-1").checked("parts/f")
    assert sorted(path.name for path in code.iterdir()) == ["a.1.nbc", "a.nbi"]


def test_a_thread_that_gives_its_lock_back_leaves_that_of_another(base):
    cache, other = CodeCache("kernels-1"), CodeCache("kernels-1")
    cache.lock()
    cache.checked("parts/f")  # locks and unlocks
    thread = threading.Thread(target=other.checked, args=("parts/f",))
    thread.start()
    thread.join(0.3)
    assert thread.is_alive()  # it waits
    cache.unlock()
    thread.join(60)
    assert not thread.is_alive()


@pytest.mark.parametrize("manifest", [None, "", "[]", '{"a": '])
def test_without_a_manifest_nothing_stays(base, manifest):
    cache = CodeCache("kernels-1")
    folder = cache.checked("parts/f")
    code = folder / "kernel_0"
    code.mkdir(parents=True)
    (code / "a.nbi").touch()
    cache.note_files("parts/f")
    (folder / "manifest.json").unlink()
    if manifest is not None:
        (folder / "manifest.json").write_text(manifest)
    CodeCache("kernels-1").checked("parts/f")
    assert list(code.iterdir()) == []


def test_folders_that_nobody_used_for_a_month_are_removed(base):
    now, day = time.time(), 24 * 3600
    mine = CodeCache("kernels-mine").folder

    def folder(name, days, used_days=None):
        (base / name).mkdir()
        if used_days is not None:
            (base / name / "used").touch()
            os.utime(base / name / "used", (now - used_days * day,) * 2)
        os.utime(base / name, (now - days * day,) * 2)

    folder("kernels-former", 40)
    folder("kernels-old", 90, used_days=40)
    folder("kernels-in-use", 90, used_days=2)
    folder("kernels-new", 0)
    folder("others", 400)
    CodeCache("kernels-mine")  # looks once a day only
    assert (base / "kernels-former").exists()
    os.utime(mine / "used", (now - 2 * day,) * 2)
    CodeCache("kernels-mine")
    kept = ["kernels-in-use", "kernels-mine", "kernels-new", "others"]
    assert sorted(path.name for path in base.iterdir()) == kept
    assert (mine / "used").stat().st_mtime > now - day


def test_nobody_vouches_for_code_that_was_not_looked_at(base):
    """A process that keeps one form of a function has not looked at the files of the other."""
    planted = CodeCache("kernels-1").folder / "parts" / "f" / "index" / "f.nbc"
    planted.parent.mkdir(parents=True)
    planted.write_bytes(b"not ours")
    cache = CodeCache("kernels-1")
    cache.note_files("parts/f")
    cache.checked("parts/f")
    assert not planted.exists()


def test_the_lock_is_free_again_where_waiting_for_it_ended_early(base, monkeypatch):
    cache = CodeCache("kernels-1")

    def interrupted(*_, **__):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("adv2e.compilation.code_cache.lock_file", interrupted)
        with pytest.raises(KeyboardInterrupt):
            cache.lock()
    with ThreadPoolExecutor() as pool:
        pool.submit(cache.lock).result(timeout=10)

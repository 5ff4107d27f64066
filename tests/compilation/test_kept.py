"""Folders and files of compiled code: only what the user made himself, whole, is used."""

import os
import stat
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from adv2e import compiled as jit
from adv2e.compilation.kept import Place, note_use, place_for, read_kept, write_kept

SOMEBODY = 65534
posix = pytest.mark.skipif(os.name != "posix", reason="owners and modes of POSIX")
root = pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root gives files away"
)


@pytest.fixture
def caches(tmp_path, monkeypatch):
    """Where compiled code may be kept: one folder, and a folder for temporary ones."""
    for name in ("NUMBA_CACHE_DIR", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("HOME", os.devnull)
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    return tmp_path


def is_fresh(place, caches):
    """Tell whether a place is a new folder that only this process knows."""
    above = place.folder.parent.parent
    return above.parent == caches / "temporary" and list(place.folder.iterdir()) == []


@posix
def test_a_folder_is_made_for_the_user_alone(caches):
    place = place_for("kernels-1")
    assert place == Place((caches / "cache" / "adv2e" / "kernels-1").resolve())
    for folder in (place.folder, place.folder.parent):
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert place_for("kernels-1") == place
    assert list((caches / "temporary").iterdir()) == []


@posix
@pytest.mark.parametrize("mode", [0o777, 0o770, 0o702])
@pytest.mark.parametrize("which", ["adv2e", "adv2e/kernels-1"])
def test_a_folder_that_others_may_write_to_is_not_used(caches, which, mode):
    place_for("kernels-1")
    folder = caches / "cache" / which
    folder.chmod(mode)
    place = place_for("kernels-1")
    assert is_fresh(place, caches)
    assert place.why_lost == f"others may write to {folder} (chmod go-w would mend it)"
    folder.chmod(0o700)
    assert not place_for("kernels-1").why_lost


@root
@pytest.mark.parametrize("which", ["adv2e", "adv2e/kernels-1"])
def test_a_folder_of_another_user_is_not_used(caches, which):
    place_for("kernels-1")
    folder = caches / "cache" / which
    os.chown(folder, SOMEBODY, SOMEBODY)
    place = place_for("kernels-1")
    assert is_fresh(place, caches)
    assert place.why_lost == f"{folder} belongs to another user"


@root
def test_a_link_that_another_user_laid_is_not_followed(caches):
    mine = caches / "mine"
    (mine / "kernels-1").mkdir(mode=0o700, parents=True)
    mine.chmod(0o700)
    (caches / "cache").mkdir()
    link = caches / "cache" / "adv2e"
    link.symlink_to(mine)
    assert place_for("kernels-1").folder == (mine / "kernels-1").resolve()
    os.chown(link, SOMEBODY, SOMEBODY, follow_symlinks=False)
    assert is_fresh(place_for("kernels-1"), caches)


def test_without_a_folder_the_temporary_one_has_a_name_that_nobody_knew(caches):
    (caches / "cache").write_text("in the way")
    first, second = place_for("kernels-1"), place_for("kernels-1")
    assert is_fresh(first, caches)
    assert is_fresh(second, caches)
    assert first.folder != second.folder
    assert str(caches / "cache" / "adv2e") in first.why_lost
    assert not first.why_full


def test_the_fresh_folder_goes_with_the_process(caches):
    (caches / "cache").write_text("in the way")
    code = (
        "from adv2e import compiled as jit; print(jit._place().folder); print(jit.announcement())"
    )
    environment = {**os.environ, "TMPDIR": tempfile.gettempdir(), "TEMP": tempfile.gettempdir()}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    folder, announcement = done.stdout.splitlines()
    assert Path(folder).parents[2] == caches / "temporary"
    assert "in every run, as it cannot be kept: " in announcement
    assert str(caches / "cache") in announcement
    assert list((caches / "temporary").iterdir()) == []


def test_nowhere_to_write_is_no_error(caches, monkeypatch):
    (caches / "cache").write_text("in the way")
    monkeypatch.setattr(tempfile, "tempdir", str(caches / "nowhere"))
    place = place_for("kernels-1")
    assert place.why_lost
    assert place.why_full
    write_kept(place.folder / "a.code", b"code")
    assert read_kept(place.folder / "a.code") is None


def test_a_full_disk_is_noticed_before_anything_is_compiled(tmp_path, monkeypatch):
    resource = pytest.importorskip("resource")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 20, limits[1]))
    try:
        place = Place(tmp_path)
        assert place.why_full == f"{tmp_path}: File too large"
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    monkeypatch.setattr(jit, "_place", lambda: place)
    assert not jit.others_find_code()
    assert "in every run, as it cannot be kept: " in jit.announcement()
    monkeypatch.setattr(jit, "_place", lambda: Place(tmp_path))
    assert jit.others_find_code()
    assert jit.announcement() == "compiling the pixel's kernel (once; about half a minute)"


def test_what_was_kept_is_read_and_nothing_else(tmp_path):
    path = tmp_path / "a.code"
    data = bytes(range(60))
    write_kept(path, data)
    assert read_kept(path) == data
    whole = path.read_bytes()
    for bit in range(8 * len(whole)):
        damaged = bytearray(whole)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        assert read_kept(path) is None
    path.write_bytes(whole[:-1])
    assert read_kept(path) is None
    path.write_bytes(whole)
    assert read_kept(path) == data
    path.rename(tmp_path / "b.code")
    assert read_kept(tmp_path / "b.code") is None
    assert read_kept(path) is None
    assert [each.name for each in tmp_path.iterdir()] == ["b.code"]


@root
def test_a_file_of_another_user_is_not_read(tmp_path):
    path = tmp_path / "a.code"
    write_kept(path, b"code")
    os.chown(path, SOMEBODY, SOMEBODY)
    assert read_kept(path) is None


def test_folders_that_nobody_used_for_a_month_are_removed(tmp_path):
    now, day = time.time(), 24 * 3600

    def folder(name, days, used_days=None):
        (tmp_path / name).mkdir()
        (tmp_path / name / "code.nbc").touch()
        if used_days is not None:
            (tmp_path / name / "used").touch()
            os.utime(tmp_path / name / "used", (now - used_days * day,) * 2)
        os.utime(tmp_path / name, (now - days * day,) * 2)
        return tmp_path / name

    mine = folder("kernels-mine", 90)
    folder("kernels-former", 40)
    folder("kernels-old", 90, used_days=40)
    folder("kernels-in-use", 90, used_days=2)
    folder("kernels-new", 0)
    folder("others", 400)
    note_use(mine)
    kept = ["kernels-in-use", "kernels-mine", "kernels-new", "others"]
    assert sorted(path.name for path in tmp_path.iterdir()) == kept

    folder("kernels-late", 40)
    note_use(mine)  # looks once a day only
    assert (tmp_path / "kernels-late").exists()
    os.utime(mine / "used", (now - 2 * day,) * 2)
    note_use(mine)
    assert not (tmp_path / "kernels-late").exists()
    assert (mine / "used").stat().st_mtime > now - day

"""``adv2e.convert``: what a Python user gives and gets; files are those of the command."""

from __future__ import annotations

import numpy as np
import pytest
from pictures import picture

import adv2e
from adv2e.errors import OutputError, UsageError


@pytest.fixture
def clip(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save("clip.npy", np.stack([np.dstack([picture(k)] * 3) for k in range(5)]))
    return "clip.npy"


def test_it_does_what_the_command_does(clip, adv2e, tmp_path):
    import adv2e as package

    given = ("--fps", "100", "--start", "0.01", "--seed", "3")
    given += ("--set", "pixel.leak=null", "--set", "sensor=null")
    assert adv2e("convert", clip, "-o", "a.txt", "-c", "davis346", *given).status == 0
    config = package.load_config("davis346", ["pixel.leak=null", "sensor=null"], seed=3)
    done = package.convert(clip, tmp_path / "b.txt", config, fps=100, start_s=0.01, threads=1)
    assert (tmp_path / "a.txt").read_bytes() == (tmp_path / "b.txt").read_bytes()
    assert (tmp_path / "a.txt.json").read_bytes() == (tmp_path / "b.txt.json").read_bytes()
    assert done.events == len(package.read_events("a.txt").events) > 100
    assert (done.frames, done.output) == (4, str(tmp_path / "b.txt"))
    assert any(
        note.startswith("frames are srgb, white 255 (8-bit colour images;") for note in done.notes
    )


def test_the_default_output_is_that_of_the_command(clip):
    assert adv2e.convert(clip, fps=100).output == "clip.events.h5"
    with pytest.raises(OutputError, match=r"clip\.events\.h5: exists already"):
        adv2e.convert(clip, fps=100)
    assert adv2e.convert(clip, fps=100, overwrite=True).events > 0


def test_the_default_output_has_the_suffix_of_its_format(clip):
    assert adv2e.convert(clip, fps=100, format="evt2").output == "clip.events.raw"
    assert adv2e.convert(clip, fps=100, format="folder").output == "clip.events"
    assert len(adv2e.read_events("clip.events.raw").events) > 100


def test_a_doubt_is_a_warning_and_no_note(clip, tmp_path):
    (tmp_path / "times.txt").write_text("0\n33\n66\n100\n133\n")
    with pytest.warns(UserWarning, match=r"times\.txt: .*ms") as told:
        done = adv2e.convert(clip, "a.txt", timestamps="times.txt")
    assert told[0].filename == __file__
    assert all("frames are " in note or "times " in note for note in done.notes)


@pytest.mark.parametrize(("dtype", "light"), [(np.uint8, "srgb"), (np.uint16, "linear")])
def test_a_guess_of_the_light_is_a_warning_unless_it_is_stated(tmp_path, dtype, light):
    scale = np.iinfo(dtype).max // 255
    np.save(tmp_path / "a.npy", np.stack([scale * picture(k).astype(dtype) for k in range(5)]))
    with pytest.warns(UserWarning, match=f"are {light}, .*bit grey .*frames.encoding") as told:
        adv2e.convert(tmp_path / "a.npy", tmp_path / "a.txt", fps=100)
    assert [one.filename for one in told] == [__file__]
    stated = {"frames": {"encoding": light}}
    done = adv2e.convert(tmp_path / "a.npy", tmp_path / "b.txt", stated, fps=100)
    assert (tmp_path / "a.txt").read_bytes() == (tmp_path / "b.txt").read_bytes()
    assert any(note.startswith(f"frames are {light}") for note in done.notes)


def test_what_cannot_be(clip):
    with pytest.raises(UsageError, match="fps and timestamps both give the times"):
        adv2e.convert(clip, fps=100, timestamps="times.txt")


def test_a_configuration_is_not_written_over(clip, tmp_path):
    (tmp_path / "own.txt").write_text("pixel: {leak: null}\n")
    with pytest.raises(OutputError, match=r"own\.txt"):
        adv2e.convert(clip, "own.txt", tmp_path / "own.txt", fps=100, overwrite=True)
    assert (tmp_path / "own.txt").read_text() == "pixel: {leak: null}\n"

"""Inputs of every kind under names that trip libraries: what is read is the same."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile

import numpy as np
import pytest

from adv2e.files.regular import shown
from adv2e.formats.reading import read_events
from adv2e.rendering.films import GifFile
from adv2e.rendering.styles import Style
from adv2e.sources import open_source

NAMES = [
    "2024-05-01T12:30:00",
    "file:http:x",
    "-o",
    " two  blanks ",
    "%d of 100 %03d",
    "two\nlines",
    "*?[1]{a,b}",
    "q'\"`$x;y&#z",
    "\\back\\",
    "\u00e9\u20ac",
    "\x1b[31mred",
    os.fsdecode(b"\xff\xfe not UTF-8"),
    "n" * 200,
]


@pytest.fixture(params=NAMES, ids=lambda name: ascii(name)[1:20])
def odd(request, tmp_path):
    """Return a name in a folder of the same name that the file system allows."""
    folder = tmp_path / request.param
    try:
        folder.mkdir()
    except (OSError, UnicodeError):
        pytest.skip("the file system does not allow this name")
    return folder / request.param


def times_and_images(source):
    return [(frame.t_ns, frame.image.tobytes()) for frame in source.frames()]


@pytest.mark.parametrize(("suffix", "codec"), [("mp4", "mp4v"), ("avi", "MJPG"), ("mkv", "FFV1")])
def test_video(write_video, picture, odd, suffix, codec, monkeypatch):
    pictures = [picture(n, (32, 32, 3)) for n in range(4)]
    plain = write_video(f"plain.{suffix}", pictures, 25, codec)
    path = odd.parent / f"{odd.name}.{suffix}"
    shutil.copy(plain, path)
    expected = times_and_images(open_source(plain))
    assert len(expected) == 4
    assert times_and_images(open_source(path)) == expected
    monkeypatch.chdir(odd.parent)
    assert times_and_images(open_source(path.name)) == expected


def test_gif_whose_name_is_a_pattern(tmp_path, picture):
    path = tmp_path / "clip%d.gif"
    writer = GifFile(path, 20, Style())
    for n in range(3):
        writer.add(picture(n, (32, 32, 3)))
    writer.finish()
    writer.close()
    assert len(times_and_images(open_source(path))) == 3


def test_folder_of_images_and_timestamps(write_images, picture, odd, tmp_path):
    pictures = [picture(n) for n in range(3)]
    plain = write_images(pictures)
    folder = odd.parent / odd.name
    folder.mkdir()
    for n, image in enumerate(sorted(plain.iterdir())):
        shutil.copy(image, folder / f"{n} {odd.name}.png")
    times = odd.parent / f"{odd.name}.txt"
    times.write_text("0\n0.5\n2\n")
    (tmp_path / "plain.txt").write_text("0\n0.5\n2\n")
    expected = times_and_images(open_source(plain, timestamps=tmp_path / "plain.txt"))
    assert times_and_images(open_source(folder, timestamps=times)) == expected


def test_lists_name_images_by_what_they_are_called(write_images, picture, odd):
    plain = write_images([picture(n) for n in range(3)])
    folder = odd.parent / "frames"
    folder.mkdir()
    name = odd.name.strip()
    if "\n" in name or "\\" in name:
        pytest.skip("a list cannot hold this name: lines end, and backslashes separate folders")
    lines = []
    for n, image in enumerate(sorted(plain.iterdir())):
        shutil.copy(image, folder / f"{name}.{2 - n}.png")
        mark = '"' if " " in name else ""
        lines.append(f"0.{n} {mark}{name}.{2 - n}.png{mark}\n")
    (folder / "images.txt").write_bytes(os.fsencode("".join(lines)))
    expected = times_and_images(open_source(plain, fps=10))
    assert times_and_images(open_source(folder)) == expected


def test_npy(picture, odd):
    path = odd.parent / f"{odd.name}.npy"
    stack = np.stack([picture(n) for n in range(3)])
    np.save(odd.parent / "plain.npy", stack)
    shutil.move(odd.parent / "plain.npy", path)
    source = open_source(path, fps=10)
    assert [image for _, image in times_and_images(source)] == [image.tobytes() for image in stack]


def test_recording_as_folder_and_zip(write_images, picture, odd):
    images = write_images([picture(n) for n in range(3)], "images", "frame_{:08d}.png")
    listed = "".join(f"{n}.5 images/frame_{n:08d}.png\n" for n in range(3))
    events = "0.000001000 1 2 1\n1.250000000 3 4 0\n"
    folder = odd.parent / odd.name
    folder.mkdir()
    shutil.copytree(images, folder / "images")
    (folder / "images.txt").write_text(listed)
    (folder / "events.txt").write_text(events)
    packed = odd.parent / f"{odd.name}.zip"
    with zipfile.ZipFile(packed, "w") as archive:
        for file in [folder / "images.txt", folder / "events.txt", *(folder / "images").iterdir()]:
            archive.write(file, file.relative_to(folder).as_posix())
    assert times_and_images(open_source(folder)) == times_and_images(open_source(packed))
    for path in (folder, packed):
        assert read_events(path).events["t"].tolist() == [1, 1_250_000]


@pytest.mark.parametrize("suffix", ["txt", "h5", "npz"])
@pytest.mark.quick_cases(1)
def test_events(adv2e, odd, tmp_path, suffix):
    stack = np.repeat(np.arange(0, 250, 50, dtype=np.uint8), 16).reshape(5, 4, 4)
    np.save(tmp_path / "stack.npy", stack)
    plain = tmp_path / f"plain.{suffix if suffix != 'npz' else 'h5'}"
    done = adv2e("convert", tmp_path / "stack.npy", "--fps", "100", "-o", plain)
    assert done.status == 0, done.err
    expected = read_events(plain).events
    assert expected.size
    path = odd.parent / f"{odd.name}.{suffix}"
    if suffix == "npz":
        np.savez(tmp_path / "plain.npz", **{name: expected[name] for name in "txyp"})
        plain = tmp_path / "plain.npz"
    shutil.copy(plain, path)
    assert np.array_equal(read_events(path).events, expected)
    told = adv2e("info", path)
    assert told.status == 0, told.err
    assert shown(path) in told.out


def test_conversion_gives_the_same_events_and_stores_a_name(adv2e, write_video, picture, odd):
    plain = write_video("plain.mp4", [picture(n, (16, 16, 3)) for n in range(4)], 25, "mp4v")
    path = odd.parent / f"{odd.name}.mp4"
    shutil.copy(plain, path)
    written = []
    for number, source in enumerate((plain, path)):
        out = plain.parent / f"{number}.h5"
        done = adv2e("convert", source, "-o", out)
        assert done.status == 0, done.err
        written.append(read_events(out))
    assert np.array_equal(written[0].events, written[1].events)
    assert written[0].events.size
    assert written[1].metadata["source"]["name"] == shown(path.name)


@pytest.mark.parametrize("environment", [{"PYTHONIOENCODING": "ascii"}, {}])
@pytest.mark.quick_cases(1)
def test_messages_are_one_line_in_any_locale(tmp_path, environment):
    names = [tmp_path / f"{name}.mp4" for name in NAMES[5:12]]
    code = """if True:
        import contextlib, sys
        from adv2e.cli import main
        for name in sys.argv[1:]:
            for command in ("info", "convert"):
                with contextlib.suppress(SystemExit):
                    main([command, "--", name])
    """
    kept = {key: value for key, value in os.environ.items() if key not in environment}
    arguments = [os.fsencode(argument) for argument in (sys.executable, "-c", code, *names)]
    done = subprocess.run(arguments, capture_output=True, env={**kept, **environment}, check=False)
    lines = done.stderr.decode("utf-8", "strict").splitlines()
    assert len(lines) == 2 * len(names)
    for line in lines:
        assert line.startswith("adv2e: error: ")
        assert line.endswith(": no such file or folder") or "patterns are not read" in line

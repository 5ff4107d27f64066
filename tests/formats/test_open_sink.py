import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from adv2e.errors import OutputError, UsageError
from adv2e.events import make_events, sort_events
from adv2e.formats.reading import read_events
from adv2e.formats.writing import open_sink

NAMES = ["out.txt", "out.zip", "out.h5", "out.npz", "out.csv", "out"]
METADATA = {"adv2e": "1.2.3", "config": {"pixel": {"leak": None}}, "seed": 1}


def names(folder):
    return sorted(entry.name for entry in folder.iterdir())


def events_of(seed, count):
    rng = np.random.default_rng(seed)
    t = rng.integers(0, 2_000_000, count)
    x, y = rng.integers(0, 30, count), rng.integers(0, 20, count)
    return sort_events(make_events(t, x, y, rng.integers(0, 2, count)))


def frames_of(count):
    rng = np.random.default_rng(9)
    return [(k * 100_000_000, rng.integers(0, 256, (20, 30), dtype=np.uint8)) for k in range(count)]


def open_at(path, **options):
    return open_sink(path, width=30, height=20, metadata=METADATA, **options)


def content(path: Path):
    """Every file below `path`, by name."""
    if path.is_file():
        return {path.name: path.read_bytes()}
    return {
        str(file.relative_to(path)): file.read_bytes()
        for file in sorted(path.rglob("*"))
        if file.is_file()
    }


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_written_before_the_block_is_entered(tmp_path, name):
    open_at(tmp_path / name)

    assert names(tmp_path) == []


@pytest.mark.parametrize("name", NAMES)
def test_final_name_holds_nothing_unfinished(tmp_path, name):
    with open_at(tmp_path / name, with_frames=True) as sink:
        sink.write_frame(0, frames_of(1)[0][1])
        sink.write_events(events_of(0, 100))
        assert not (tmp_path / name).exists()
    assert (tmp_path / name).exists()


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
@pytest.mark.parametrize("name", NAMES)
def test_exception_leaves_nothing_not_even_made_folders(tmp_path, name, error):
    with pytest.raises(error), open_at(tmp_path / "new" / name, with_frames=True) as sink:
        for t_ns, image in frames_of(30):
            sink.write_frame(t_ns, image)
        sink.write_events(events_of(0, 200_000))
        raise error

    assert names(tmp_path) == []


@pytest.mark.parametrize("name", NAMES)
def test_existing_output_is_refused(tmp_path, name):
    with open_at(tmp_path / name):
        pass
    before = content(tmp_path)

    with pytest.raises(OutputError, match=r"out[.a-z0-9]*: exists already"):
        open_at(tmp_path / name)
    assert content(tmp_path) == before


@pytest.mark.parametrize("name", NAMES)
def test_overwriting_replaces_the_whole_output(tmp_path, name):
    with open_at(tmp_path / name, with_frames=True) as sink:
        for t_ns, image in frames_of(3):
            sink.write_frame(t_ns, image)
    with open_at(tmp_path / "fresh" / name) as sink:
        sink.write_events(events_of(1, 50))
    with open_at(tmp_path / name, overwrite=True) as sink:
        sink.write_events(events_of(1, 50))

    assert content(tmp_path / name) == content(tmp_path / "fresh" / name)


@pytest.mark.parametrize("name", NAMES)
def test_failed_overwriting_keeps_the_old_output(tmp_path, name):
    with open_at(tmp_path / name) as sink:
        sink.write_events(events_of(1, 50))
    before = content(tmp_path)

    with pytest.raises(ValueError), open_at(tmp_path / name, overwrite=True) as sink:
        sink.write_events(events_of(2, 50))
        raise ValueError

    assert content(tmp_path) == before


@pytest.mark.parametrize("name", [*NAMES, "out.raw"])
def test_bytes_do_not_depend_on_threads_or_on_how_events_and_frames_come(tmp_path, name):
    events, frames = events_of(3, 150_000), frames_of(12)

    with open_at(tmp_path / "a" / name, with_frames=True, threads=1) as sink:
        for t_ns, image in frames:
            sink.write_frame(t_ns, image)
        sink.write_events(events)
    with open_at(tmp_path / "b" / name, with_frames=True, threads=3) as sink:
        frames_left = list(frames)
        for part in np.array_split(events, 17):
            while frames_left and frames_left[0][0] <= part["t"][-1] * 1000:
                sink.write_frame(*frames_left.pop(0))
            sink.write_events(part)
        for frame in frames_left:
            sink.write_frame(*frame)

    assert content(tmp_path / "a" / name) == content(tmp_path / "b" / name)


def run_python(code, *arguments):
    """Run `code` in a fresh process that can import this module; return what it prints."""
    code = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})\n{code}"
    run = subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        check=True,
        capture_output=True,
        text=True,
    )
    assert run.stderr == ""
    return run.stdout


def write_all(folder):
    for name in NAMES:
        with open_at(folder / name, with_frames=True) as sink:
            for frame in frames_of(2):
                sink.write_frame(*frame)
            sink.write_events(events_of(4, 1000))


@pytest.mark.thorough
def test_bytes_do_not_depend_on_process_or_day(tmp_path):
    code = """
import time
time.time = lambda: 1e9
from pathlib import Path
from test_open_sink import write_all
write_all(Path(sys.argv[1]))
"""
    run_python(code, tmp_path / "a")
    write_all(tmp_path / "b")

    assert content(tmp_path / "a") == content(tmp_path / "b")


@pytest.mark.skipif(sys.platform == "win32", reason="needs resource limits")
@pytest.mark.thorough
def test_full_disk_is_one_line_and_leaves_nothing(tmp_path):
    code = """
import resource
from pathlib import Path
from adv2e.errors import OutputError
from test_open_sink import NAMES, events_of, open_at, write_all
write_all(Path(sys.argv[1]) / "first")  # compiles and imports all that is needed
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
for name in NAMES:
    try:
        with open_at(Path(sys.argv[1]) / "full" / name) as sink:
            sink.write_events(events_of(4, 200_000))
    except OutputError as error:
        print(error)
"""
    lines = run_python(code, tmp_path).splitlines()

    assert lines == [
        f"{tmp_path / 'full' / name}: cannot be written: File too large" for name in NAMES
    ]
    assert names(tmp_path) == ["first"]


def test_frames_are_stored_only_when_asked_for(tmp_path):
    for name in NAMES:
        with open_at(tmp_path / name) as sink:
            assert not sink.wants_frames
            sink.write_frame(0, frames_of(1)[0][1])
    assert not (tmp_path / "out" / "images").exists()


def test_text_holds_no_frames(tmp_path):
    assert not open_at(tmp_path / "out.txt", with_frames=True).wants_frames


def test_suffix_in_capitals_is_known(tmp_path):
    with open_at(tmp_path / "OUT.TXT") as sink:
        sink.write_events(events_of(0, 1))

    assert (tmp_path / "OUT.TXT").read_text().count("\n") == 1


def test_unknown_suffix_lists_what_exists(tmp_path):
    with pytest.raises(UsageError, match=r"out\.xyz: unknown suffix '\.xyz'.*\.h5.*\.txt") as info:
        open_at(tmp_path / "out.xyz")
    assert "\n" not in str(info.value)


def test_unknown_format_lists_what_exists(tmp_path):
    with pytest.raises(
        UsageError, match="--format xyz: unknown, must be one of h5, txt, zip, folder"
    ):
        open_at(tmp_path / "out.txt", format="xyz")


def test_unknown_layout_lists_what_exists(tmp_path):
    with pytest.raises(UsageError, match="--layout xyz: unknown, must be one of monash"):
        open_at(tmp_path / "out.h5", layout="xyz")


def test_layout_is_for_hdf5_only(tmp_path):
    with pytest.raises(UsageError, match="--layout monash: only HDF5"):
        open_at(tmp_path / "out.txt", layout="monash")


def test_layout_monash_is_the_default_of_hdf5(tmp_path):
    for name, options in (("a.h5", {}), ("b.h5", {"layout": "monash"}), ("c", {"format": "h5"})):
        with open_at(tmp_path / name, **options) as sink:
            sink.write_events(events_of(0, 10))

    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "c").read_bytes()


@pytest.mark.parametrize(
    "name",
    [
        *("a.h5", "a.npz", "a.txt", "a.csv", "a.zip", "a", "a.es"),
        *("a.aedat4", "a.aedat", "a.raw", "a.dat"),  # these begin with it
    ],
)
def test_what_is_known_only_at_the_end_is_in_the_description(tmp_path, name):
    events = events_of(4, 30_000)
    with open_at(tmp_path / name, with_frames=name == "a.zip") as sink:
        sink.write_events(events)
        sink.describe(late={"said": "at the end"})

    recording = read_events(tmp_path / name)
    for field in ("t", "x", "y", "p"):
        assert np.array_equal(recording.events[field], events[field])
    assert recording.metadata["seed"] == 1
    assert recording.metadata["late"] == {"said": "at the end"}

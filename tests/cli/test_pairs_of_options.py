"""Every pair of inputs, options and outputs of each command, in a few rows on tiny data.

A row ends well, and its output reads back; or it is refused in one line, and leaves nothing.
"""

from __future__ import annotations

import io
import itertools
import json
import random
import shutil
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from pictures import picture
from trees_of_batch import in_this_process
from video_files import written
from written_recordings import write_recording

from adv2e.batches import processes
from adv2e.events import make_events
from adv2e.formats.reading import read_events

NO: tuple[str, ...] = ()
VOICE = [NO, ("-q",), ("-v",), ("--progress",), ("--no-progress",)]
SET_BACK = [NO, ("--set-back", "continue"), ("--set-back", "sort")]
PART = {
    "start": [NO, ("--start", "0.02")],
    "stop": [NO, ("--stop", "0.08")],
    "crop": [NO, ("--crop", "2,4,12,6")],
}
TURN = [NO, ("--rotate180",)]
THREADS = [NO, ("--threads", "1"), ("--threads", "2")]
EXISTING = ["new", "there", "--overwrite"]
"""Nothing is there before; it was made before; or it was, and is to be replaced."""


def is_of(kind, *kinds):
    return kind.partition(" ")[0] in kinds


CONVERT = {
    "input": [
        *("clip.mp4", "pictures", "listed", "s.npy", "recording", "recording.zip"),
        *("recording --from events", "e.h5", "e.txt", "-"),
    ],
    "times": [NO, ("--fps", "50"), ("--timestamps", "t.txt", "--time-unit", "ms")],
    **PART,
    "turn": TURN,
    "bayer": [NO, ("--bayer", "grbg")],
    "damaged": [NO, ("--allow-damaged",)],
    "size": [NO, ("--size", "8x6"), ("-c", "own.yaml"), ("-c", "davis346", "--size", "8x6")],
    "set": [NO, ("--set", "readout.tick_us=10"), ("--set", "sampling.interpolation=flow")],
    "seed": [NO, ("--seed", "3")],
    "own": [NO, ("--effect", "own.py")],
    "t0": [NO, ("--t0", "zero"), ("--t0", "keep")],
    "back": SET_BACK,
    "outside": [NO, ("--crop-events",)],
    "output": [
        *("a.h5", "a.h5 --layout dsec", "a.h5 --with-frames", "a", "a.zip", "a.txt", "a.csv"),
        *("a.npz", "a.raw", "a.dat", "a.aedat4", "a.bag", "a.zip --format e2vid", "-"),
    ],
    "preview": [NO, ("--preview", "a.png"), ("--preview", "a.gif")],
    "causes": [NO, ("--causes",)],
    "threads": THREADS,
    "voice": VOICE,
    "existing": EXISTING,
}


def fits_convert(row):
    """Tell whether options go together as far as they are known: others are refused."""
    kind, output = row.get("input", ""), row.get("output", "")
    events = is_of(kind, "e.h5", "e.txt") or kind.endswith("events")
    of_frames = ("times", "bayer", "damaged", "size", "set", "seed", "own", "preview", "causes")
    if events and (any(row.get(name) for name in of_frames) or "--with-frames" in output):
        return False
    if kind and not events and (row.get("back") or row.get("outside")):
        return False
    if kind == "pictures" and row.get("times") == NO:
        return False  # it has no times
    if row.get("bayer") and is_of(kind, "clip.mp4"):
        return False  # its colours are there
    if output == "-":
        return not row.get("causes") and row.get("existing", "new") == "new"
    return not (kind.startswith("recording") and row.get("times"))


RENDER = {
    "input": ["frames.h5", "e.txt", "recording"],
    "output": ["a.mp4", "a.gif", "a.webm", "a.avi", "a.png"],
    "style": [NO, *(("--style", name) for name in ("black", "grey", "surface", "rate"))],
    "colours": [NO, ("--on-color", "#00ff00"), ("--off-color", "purple")],
    "window": [NO, ("--window", "5")],
    "speed": [NO, ("--speed", "0.5")],
    "instants": [NO, ("--at", "0.03"), ("--count", "2")],
    "beside": [NO, ("--beside",), ("--no-beside",)],
    "scale": [NO, ("--scale", "2")],
    "rate": [NO, ("--fps", "20")],
    "most": [NO, ("--max-pictures", "500")],
    **PART,
    "turn": TURN,
    "back": SET_BACK,
    "outside": [NO, ("--crop-events",)],
    "voice": VOICE,
    "existing": EXISTING,
}


def fits_render(row):
    film = row.get("output", "a.png") != "a.png"
    instants = row.get("instants", NO)
    if film and instants:
        return False
    if row.get("style") == ("--style", "rate") and (film or "--at" in instants):
        return False
    if "output" in row and not film and (row.get("rate") or row.get("speed") or row.get("most")):
        return False
    return not (row.get("beside") == ("--beside",) and row.get("input") == "e.txt")


VIEW = {
    "input": ["frames.h5", "e.txt", "recording", "recording.zip"],
    "output": ["a.html", "a"],
    "frames": [NO, ("--no-frames",)],
    **PART,
    "turn": TURN,
    "back": SET_BACK,
    "outside": [NO, ("--crop-events",)],
    "size": [NO, ("--size", "20x30")],
    "voice": VOICE,
    "existing": EXISTING,
}


INFO = {
    "input": ["clip.mp4", "pictures", "listed", "s.npy", "recording", "e.h5", "e.txt", "-"],
    "times": [NO, ("--fps", "50"), ("--timestamps", "t.txt", "--time-unit", "ms")],
    **PART,
    "turn": TURN,
    "bayer": [NO, ("--bayer", "grbg")],
    "damaged": [NO, ("--allow-damaged",)],
    "back": SET_BACK,
    "json": [NO, ("--json",)],
    "voice": VOICE,
}


def fits_info(row):
    kind = row.get("input", "")
    events = is_of(kind, "e.h5", "e.txt")
    if events and (row.get("times") or row.get("bayer") or row.get("damaged")):
        return False
    if kind and row.get("back") and not (events or kind == "recording"):
        return False
    if kind == "pictures" and row.get("times") == NO:
        return False
    return not (row.get("bayer") and kind == "clip.mp4") and not (
        kind == "recording" and row.get("times")
    )


EXPORT = {
    "input": ["frames.h5", "recording", "e.txt --size 16x12"],
    "to": [("--to", "voxel"), ("--to", "e2vid"), ("--to", "ev-segnet")],
    "cut": [("--window", "20ms"), ("--count", "50"), ("--at", "images"), NO],
    "bins": [NO, ("--bins", "3")],
    "normalise": [NO, ("--normalise", "e2vid"), ("--normalise", "event_cnn_minimal")],
    "polarity": [NO, ("--polarity", "split")],
    "span": [NO, ("--span", "window")],
    "rows": [NO, ("--rows", "8")],
    "counts": [NO, ("--counts", "raw")],
    "valid": [NO, ("--valid", "0.5")],
    "split": [NO, ("--split", "test")],
    **PART,
    "back": SET_BACK,
    "outside": [NO, ("--crop-events",)],
    "threads": THREADS,
    "voice": VOICE,
    "existing": EXISTING,
}
_OF_EXPORTS = {
    "voxel": ("bins", "normalise", "polarity", "span"),
    "e2vid": ("valid",),
    "ev-segnet": ("rows", "counts", "split"),
}


def fits_export(row):
    cut, text = row.get("cut"), row.get("input", "").startswith("e.txt")
    if "to" not in row:
        return not (text and cut == ("--at", "images"))
    to = row["to"][-1]
    foreign = {name for names in _OF_EXPORTS.values() for name in names} - {*_OF_EXPORTS[to]}
    if any(row.get(name) for name in foreign):
        return False
    if text and (to != "voxel" or cut == ("--at", "images")):
        return False  # it has no images
    if to == "voxel":
        return cut != NO
    return not cut or (to == "ev-segnet" and cut == ("--window", "20ms"))


OWN_SENSOR = ("-c", "davis346", "--set", "sensor=null")
COMPARE = {
    "input": ["frames.h5 e.h5", "e.txt e.h5", "recording frames.h5", "e.h5 e.txt"],
    "window": [NO, ("--window", "0.02")],
    "frames": [NO, ("--frames", "listed")],
    "model": [NO, ("--seed", "4"), ("--set", "pixel.leak=null"), OWN_SENSOR],
    **PART,
    "turn": TURN,
    "back": SET_BACK,
    "outside": [NO, ("--crop-events",)],
    "json": [NO, ("--json",)],
    "threads": THREADS,
    "voice": VOICE,
}


def fits_compare(row):
    text = row.get("input", "").startswith(("e.txt", "e.h5"))
    return not (text and row.get("model") and row.get("frames") == NO)


BATCH = {
    "input": ["tree", "listed"],
    "to": [NO, ("--export", "voxel", "--window", "20ms"), ("--export", "e2vid")],
    "times": [NO, ("--fps", "50")],
    "turn": TURN,
    "size": [NO, ("--size", "8x6")],
    "set": [NO, ("--set", "readout.tick_us=10"), ("-c", "davis346", "--size", "8x6")],
    "seed": [NO, ("--seed", "3")],
    "own": [NO, ("--effect", "own.py")],
    "format": [NO, ("--format", "txt"), ("--format", "folder"), ("--with-frames",)],
    "causes": [NO, ("--causes",)],
    "threads": [NO, ("--threads", "1")],
    "jobs": [NO, ("--jobs", "2")],
    "shard": [NO, ("--shard", "1/2")],
    "dry": [NO, ("--dry-run",)],
    "voice": VOICE,
    "existing": EXISTING,
}


def fits_batch(row):
    return not (row.get("size") and "--size" in (row.get("set") or ()))


COMMANDS = {
    "convert": (CONVERT, fits_convert),
    "render": (RENDER, fits_render),
    "view": (VIEW, lambda row: True),
    "info": (INFO, fits_info),
    "export": (EXPORT, fits_export),
    "compare": (COMPARE, fits_compare),
    "batch": (BATCH, fits_batch),
}


def rows_of(name):
    """Return rows, a way of each factor, in which all pairs occur that may stand together."""
    (factors, fits), rng, rows = COMMANDS[name], random.Random(1), []
    ways = [(f, way) for f, factor in factors.items() for way in factor]
    pairs = [pair for pair in itertools.combinations(ways, 2) if pair[0][0] != pair[1][0]]
    left = {frozenset(pair): None for pair in pairs if fits(dict(pair))}
    while left:
        pair = rng.choice([*left])
        found = filter(None, (completed(dict(pair), factors, fits, left, rng) for _ in range(20)))
        row = next(found, dict(pair))  # no row has it: a third option is against it
        for pair in itertools.combinations(row.items(), 2):
            left.pop(frozenset(pair), None)
        if len(row) == len(factors):
            rows.append({f: row[f] for f in factors})
    return rows


def completed(row, factors, fits, left, rng):
    """Return a row with a way of each factor, of which most pairs are left; or nothing."""
    for f in rng.sample([*factors], len(factors)):
        ways = [way for way in factors[f] if fits({**row, f: way})]
        if f in row:
            continue
        if not ways:
            return None
        gains = [sum(frozenset([(f, way), one]) in left for one in row.items()) for way in ways]
        row[f] = ways[gains.index(max(gains))]
    return row


OWN = """
from adv2e.effects.hooks import Hooks

class Dim(Hooks):
    "Takes light away."
    name = "dim"
    stage = "frames"
    def light(self, frames):
        for t_ns, light in frames:
            yield t_ns, light * 0.5
"""


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """Keep an input of each kind, frames 20 ms apart, all of 16x12 but for the film."""
    root = tmp_path_factory.mktemp("inputs")
    frames = [picture(3 * n, (12, 16)) for n in range(6)]
    written(root / "clip.mp4", "libx264", 50, numbers=range(6))
    for folder in ("pictures", "listed"):
        (root / folder).mkdir()
        for n, frame in enumerate(frames):
            cv2.imwrite(str(root / folder / f"{n}.png"), frame)
    times = [f"{20 * n / 1000:.3f} {n}.png\n" for n in range(6)]
    (root / "listed" / "images.txt").write_text("".join(times))
    np.save(root / "s.npy", np.array(frames))
    np.save(root / "s_ts.npy", np.arange(6) / 50)
    (root / "t.txt").write_text("".join(f"{7000 + 20 * n}\n" for n in range(6)))
    rng = np.random.default_rng(5)
    t = np.sort(rng.integers(0, 100_000, 2000))
    events = make_events(
        t, rng.integers(0, 16, 2000), rng.integers(0, 12, 2000), rng.integers(0, 2, 2000)
    )
    write_recording(root / "recording", [n / 50 for n in range(6)], frames, events)
    shutil.make_archive(str(root / "recording"), "zip", root / "recording")
    (root / "own.yaml").write_text("sensor: {width: 10, height: 8, fit: pad}\n")
    (root / "own.py").write_text(OWN)
    (root / "tree").mkdir()
    shutil.copytree(root / "listed", root / "tree" / "a")
    shutil.copytree(root / "recording", root / "tree" / "b")
    head = b"YUV4MPEG2 W16 H12 F50:1 Ip Cmono\n"
    (root / "pipe").write_bytes(head + b"".join(b"FRAME\n" + one.tobytes() for one in frames))
    return root


@pytest.fixture
def called(adv2e, inputs, tmp_path, monkeypatch):
    """Call a command among the inputs, with frames in its standard input."""
    monkeypatch.chdir(inputs)
    monkeypatch.setattr(processes, "run", in_this_process)
    if not (inputs / "e.h5").exists():
        for words in (
            ("recording", "--from", "events", "-o", "e.h5"),
            ("recording", "--from", "events", "-o", "e.txt"),
            ("recording", "--with-frames", "-o", "frames.h5"),
        ):
            assert adv2e("convert", *words).status == 0

    def call(*words):
        pipe = io.TextIOWrapper(io.BytesIO((inputs / "pipe").read_bytes()))
        monkeypatch.setattr(sys, "stdin", pipe)
        return adv2e(*words)

    return call


def bytes_below(path):
    files = sorted(path.rglob("*")) if path.is_dir() else [path]
    return {str(one): one.read_bytes() for one in files if one.is_file()}


def words_of(command, row, path):
    """Return the words of a row whose output, and preview, go to the folder of a path."""
    output = "-" if path.name == "-" else str(path)
    words = [*row["input"].split(), *([output] if command == "batch" else [])]
    words += row.get("output", "").split()[1:]
    for factor, way in row.items():
        if factor == "preview" and way:
            words += ["--preview", str(path.with_name(f"preview{Path(way[1]).suffix}"))]
        elif factor not in ("input", "output", "existing"):
            words += way
    return words if command in ("info", "compare", "batch") else [*words, "-o", output]


def is_whole(command, words, path, out):
    """Tell whether what a row made can be read back."""
    if command in ("info", "compare"):
        return json.loads(out) if "--json" in words else out
    if words[-2:] == ["-o", "-"]:
        return out
    if command == "convert":
        return read_events(path).events.size > 0
    if path.suffix in (".mp4", ".avi", ".webm", ".gif"):
        return cv2.VideoCapture(str(path)).read()[0]
    if command == "view":
        return "all events drawn" in path.read_text("utf-8")
    if path.suffix == ".png":
        return cv2.imread(str(path)) is not None
    return "--dry-run" in words or bytes_below(path)


@pytest.mark.thorough
def test_what_is_written_beside_events_does_not_change_them(called, tmp_path):
    nothing_beside = dict.fromkeys(("preview", "causes", "threads", "voice"), NO)
    for number, row in enumerate(rows_of("convert")[::3]):
        name = row["output"].split()[0]
        path, usual = (tmp_path / str(number) / one for one in (name, "usual.h5"))
        if name == "-":
            continue
        alone = {**row, **nothing_beside, "output": "usual.h5"}
        words = words_of("convert", row, path)
        for given in (words_of("convert", alone, usual), words):
            outcome = called("convert", *given)
            assert outcome.status == 0, (given, outcome.err)
        expected, found = read_events(usual), read_events(path)
        assert (found.width, found.height) == (expected.width, expected.height), words
        for name in "txyp":
            same = np.array_equal(found.events[name], expected.events[name])
            assert same, (name, words)


@pytest.mark.parametrize(
    "command",
    [pytest.param(one, marks=() if one == "info" else pytest.mark.thorough) for one in COMMANDS],
)
def test_each_pair_of_options_ends_well_or_is_refused_in_one_line(command, called, tmp_path):
    hold(command, rows_of(command), called, tmp_path)


@pytest.mark.parametrize("command", [one for one in COMMANDS if one != "info"])
def test_some_rows_of_options(command, called, tmp_path):
    hold(command, rows_of(command)[::10], called, tmp_path)


def hold(command, rows, called, tmp_path):
    refused = []
    for number, row in enumerate(rows):
        existing, name = row.get("existing", "new"), row.get("output", "a").split()[0]
        path = tmp_path / f"{command}{number}" / name
        words = words_of(command, row, path)
        outcome = called(command, *words)
        told = f"adv2e {command} {' '.join(words)}\n{outcome.err}"
        errors = [line for line in outcome.err.splitlines() if line.startswith("adv2e: error")]
        if outcome.status != 0:
            assert outcome.status in (1, 2), told
            assert len(errors) == 1, told
            assert not path.parent.exists() or not [*path.parent.iterdir()], told
            refused.append(told)
            continue
        assert errors == [], told
        assert is_whole(command, words, path, outcome.out), told
        if existing == "new" or "--dry-run" in words:
            continue
        before = bytes_below(path)
        again = called(command, *words, *(["--overwrite"] if existing == "--overwrite" else []))
        told = f"again: {told}{again.err}"
        if existing == "--overwrite" or command == "batch":
            assert again.status == 0, told
            assert is_whole(command, words, path, again.out), told
        else:
            assert (again.status, again.err.count("\n")) == (1, 1), told
            assert bytes_below(path) == before, told
        assert not [*path.parent.glob(".adv2e*")], told
    # a row of many options that is refused tests none of their pairs
    assert len(refused) <= len(rows) // 10, "\n".join(refused)

#!/usr/bin/env python
"""Go three ways from what people have to what they need, with the commands that a user would type.

GOPRO: a folder of sequences becomes a training set for E2VID.  DDD17: the frames of a recording
become events, which are compared with its own.  A photo becomes a film of EVT 3.0, which a library
that is not ours reads::

    python scripts/journeys.py --gopro GOPRO_Large_all/train --ddd17 recording.hdf5
    python scripts/journeys.py --photo a.jpg -o out

Each way is shown as it goes, command by command.  What lies in the folder of ``-o`` stays there.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click

SECONDS = "2"
"""Of each sequence and recording that are converted; all of a photo's."""


def run(*command: str | Path) -> str:
    """Run a command of adv2e, show it and what it says, and return that."""
    words = [str(word) for word in command]
    click.echo(f"$ adv2e {' '.join(words)}")
    done = subprocess.run(
        [sys.executable, "-m", "adv2e", *words], capture_output=True, text=True, check=False
    )
    click.echo((done.stderr + done.stdout).rstrip())
    if done.returncode:
        raise click.ClickException(f"exit status {done.returncode}")
    return done.stdout


def gopro(folder: Path, out: Path) -> None:
    """Make a training set of the sequences in a folder."""
    sequences = sorted(path for path in folder.iterdir() if path.is_dir())
    made = [out / f"{sequence.name}.h5" for sequence in sequences]
    for sequence, target in zip(sequences, made, strict=True):
        run(
            *("convert", sequence, "-o", target, "-c", "davis346", "--with-frames"),
            *("--stop", SECONDS),
        )
    run("export", *made, "-o", out / "training", "--to", "e2vid")
    import h5py  # noqa: PLC0415

    for name in ("train", "valid"):
        for line in (out / "training" / f"{name}.txt").read_text("utf-8").splitlines():
            with h5py.File(line) as file:
                intervals = file.attrs["num_imgs"] - 1
                events = file["events/ts"].size
            click.echo(f"{name}: {Path(line).name}: {intervals} intervals, {events:,} events")


def ddd17(recording: Path, out: Path) -> None:
    """Simulate the frames of a recording, and compare the events with its own."""
    run("info", recording, "--rotate180")
    made = out / "simulated.h5"
    run(
        *("convert", recording, "--rotate180", "-c", "davis346", "--stop", SECONDS, "-o", made),
    )
    run("compare", recording, made, "--rotate180")


def photo(picture: Path, out: Path) -> None:
    """Move a sensor before a picture, and read the events as another library does."""
    made = out / "photo.raw"
    run("convert", picture, "--motion", "saccade", "--size", "346x260", "-o", made)
    import faery  # noqa: PLC0415

    stream = faery.events_stream_from_file(made)
    events = stream.to_array()
    click.echo(
        f"faery: {events.size:,} events on {'x'.join(map(str, stream.dimensions()))} pixels, up to"
        f" {events['t'][-1]} us"
    )


@contextmanager
def _folder(output: Path | None) -> Iterator[Path]:
    if output is not None:
        output.mkdir(parents=True, exist_ok=True)
        yield output
        return
    with tempfile.TemporaryDirectory() as scratch:
        yield Path(scratch)


@click.command()
@click.option("--gopro", "gopro_folder", type=click.Path(path_type=Path), help="GOPRO sequences.")
@click.option("--ddd17", "ddd17_file", type=click.Path(path_type=Path), help="A DDD17 recording.")
@click.option("--photo", "photo_file", type=click.Path(path_type=Path), help="A picture.")
@click.option("-o", "--output", type=click.Path(path_type=Path), help="Folder to leave it in.")
def main(
    gopro_folder: Path | None, ddd17_file: Path | None, photo_file: Path | None, output: Path | None
) -> None:
    """Show ways from data sets to training sets and viewers."""
    ways: list[tuple[str, Callable[[Path, Path], None], Path | None]] = [
        ("gopro", gopro, gopro_folder),
        ("ddd17", ddd17, ddd17_file),
        ("photo", photo, photo_file),
    ]
    if not any(source for *_, source in ways):
        raise click.UsageError("give --gopro, --ddd17 or --photo")
    with _folder(output) as out:
        for name, go, source in ways:
            if source is not None:
                (out / name).mkdir(exist_ok=True)
                go(source, out / name)


if __name__ == "__main__":
    main()

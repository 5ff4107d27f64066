#!/usr/bin/env python
"""How often ``adv2e diagnose`` names what a recording holds and its declared model lacks.

Recordings come from the brute-force camera of the tests, which shares no code with adv2e; what they
hold is hidden from the diagnosis.  Kinds of recordings:

nothing         the camera is just as declared: how often is anything found?
library         one effect that adv2e knows: is it named, and fitted?
leave-one-out   the same, with the effect left out of adv2e's library: is a wrong name given?
outside         one effect that adv2e does not know
pairs           two effects at once
own-period      (if asked for) the readout of frames that are not those of the recording

::

    python scripts/studies/diagnosis.py run results
    python scripts/studies/diagnosis.py run results --kinds library --sizes middle --shard 3/16
    python scripts/studies/diagnosis.py run ordinary --fps 60 --bits 8 --interpolation flow
    python scripts/studies/diagnosis.py run light --known-light --size 24x18
    python scripts/studies/diagnosis.py report results -o diagnosis.md
    python scripts/studies/diagnosis.py record echo.zip echo

``run`` adds a line of JSON for each case to a file in its folder and skips what is there already
from the same commit, so that it can be stopped at any time; all kinds and effects come in turn.
``report`` writes Markdown tables and a figure from what there is.  ``record`` keeps one of the
recordings, to be diagnosed by hand.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
from writing import load_pyplot, one_line_errors, write_report

from studies.cases import (
    KINDS,
    LIBRARY,
    MIDDLE,
    NO_SIZE,
    NOTHING,
    OUTSIDE,
    OWN_PERIOD,
    PAIRS,
    SIZES,
    Case,
    Plan,
    catalogue,
    shard,
)
from studies.results import ENDING, append, finished, identity, latest, read


def _names(known: tuple[str, ...]) -> Callable[..., tuple[str, ...]]:
    """Return what reads names out of a list, with commas between them, in the list's order."""

    def read_names(ctx: click.Context, param: click.Parameter, text: str) -> tuple[str, ...]:
        names = text.split(",")
        for name in names:
            if name not in known:
                raise click.BadParameter(f"{name!r}: none of {', '.join(known)}", ctx, param)
        return tuple(name for name in known if name in names)

    return read_names


def _shard(ctx: click.Context, param: click.Parameter, text: str) -> tuple[int, int]:
    number, _, count = text.partition("/")
    if number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count):
        return int(number), int(count)
    raise click.BadParameter(f"{text!r}: must be I/N with I from 1 to N, such as 3/16", ctx, param)


def _size(ctx: click.Context, param: click.Parameter, text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if width.isdecimal() and height.isdecimal() and min(int(width), int(height)) >= 8:
        return int(width), int(height)
    raise click.BadParameter(f"{text!r}: must be as 48x36, at least 8x8", ctx, param)


def _of_recordings(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options on how recordings are made."""
    options = [
        click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True),
        click.option(
            "--size", metavar="WxH", default="48x36", callback=_size, show_default=True,
            help="Sensor.",
        ),
        click.option("--seconds", type=click.FloatRange(min=0.1), default=0.8, show_default=True),
        click.option("--fps", type=click.FloatRange(min=10.0), default=500.0, show_default=True),
        click.option(
            "--bits", type=click.Choice(["8", "16"]), default="16", help="Of the frames.",
            show_default=True,
        ),
        click.option(
            "--interpolation", type=click.Choice(["linear", "flow"]), default="linear",
            show_default=True,
        ),
        click.option(
            "--known-light", is_flag=True, help="No frames: a lamp that leaps, rests and swings."
        ),
    ]  # fmt: skip
    for option in reversed(options):
        command = option(command)
    return command


def _setup(size: tuple[int, int], seconds: float, bits: str, **more: Any) -> Any:
    from studies.run import Setup  # noqa: PLC0415 - it loads the simulator

    return Setup(*size, seconds, bits=int(bits), **more)


@click.group()
def main() -> None:
    """Study how often 'adv2e diagnose' is right."""


@main.command("run")
@click.argument("folder", type=click.Path(file_okay=False, path_type=Path))
@click.option(
    "--kinds", callback=_names((*KINDS, OWN_PERIOD)), default=",".join(KINDS), show_default=True
)
@click.option("--sizes", callback=_names(SIZES), default=",".join(SIZES), show_default=True)
@click.option("--only", multiple=True, metavar="EFFECT", help="Only with this effect. Repeatable.")
@click.option(
    "--shard", "part", metavar="I/N", callback=_shard, default="1/1", show_default=True,
    help="The I-th of N parts.",
)  # fmt: skip
@click.option("--repeats", type=click.IntRange(min=1), default=1, show_default=True)
@click.option("--nothing", type=click.IntRange(min=0), default=100, show_default=True)
@_of_recordings
@click.option("--threads", type=click.IntRange(min=1), default=1, show_default=True)
@click.option("--most", type=click.IntRange(min=1), help="Stop after so many cases.")
@click.option("-v", "verbose", is_flag=True, help="Show what competes.")
def run(
    folder: Path, kinds: tuple[str, ...], sizes: tuple[str, ...], only: tuple[str, ...],
    part: tuple[int, int], seed: int, repeats: int, nothing: int, threads: int, most: int | None,
    verbose: bool, **recording: Any,
) -> None:  # fmt: skip
    """Record and diagnose the cases that FOLDER does not have yet."""
    from adv2e.diagnosis.fitting.library import OF_FRAMES  # noqa: PLC0415
    from adv2e.diagnosis.fitting.library import names as library_names  # noqa: PLC0415
    from studies import run as running  # noqa: PLC0415 - it loads the simulator

    say = partial(click.echo, err=True)
    setup = _setup(**recording)
    known = [one for one in library_names() if not (setup.known_light and one in OF_FRAMES)]
    lacking = [name for name in catalogue.LIBRARY if name not in known]
    if lacking:
        say(f"not in adv2e's library, skipped: {', '.join(lacking)}")
    for name in only:
        if name not in (*catalogue.LIBRARY, *catalogue.OUTSIDE):
            raise click.BadParameter(
                f"{name!r}: the camera has no such effect", param_hint="--only"
            )
    plan = Plan(
        kinds, sizes, [name for name in catalogue.LIBRARY if name in known], only, repeats,
        nothing, seed,
    )  # fmt: skip
    commit = running.commit()
    done = finished(read(folder))

    def is_done(case: Case) -> bool:
        stub = {"key": case.key, "study_seed": seed, "setup": vars(setup), "commit": commit}
        return identity(stub) in done

    cases = shard(plan.cases(), *part)
    left = [case for case in cases if not is_done(case)]
    say(f"commit {commit}: {len(left)} of {len(cases)} cases left")
    path = folder / f"{part[0]}-of-{part[1]}{ENDING}"
    for number, case in enumerate(left[:most], 1):
        say(f"[{number}/{len(left)}] {case.key}, scene {case.scene(seed)}")
        log = (lambda text: say(f"    {text}")) if verbose else (lambda text: None)
        line = running.diagnosed(case, setup, seed, threads, log)
        append(path, {**line, "commit": commit, "lacking": lacking})
        say(f"    {_said(line)}")


@main.command("record")
@click.argument("path", metavar="FILE.zip", type=click.Path(dir_okay=False, path_type=Path))
@click.argument("effects", metavar="[EFFECT]...", nargs=-1)
@click.option("--effect-size", type=click.Choice(SIZES), default=MIDDLE, show_default=True)
@_of_recordings
def record(
    path: Path, effects: tuple[str, ...], effect_size: str, seed: int, **recording: Any
) -> None:
    """Keep the study's recording with EFFECTs that are not declared.

    Beside FILE.zip come FILE.declared.yaml, what a diagnosis may know, and FILE.truth.yaml; with
    --known-light also FILE.stimulus.csv, for 'adv2e diagnose --light'.
    """
    if path.suffix != ".zip":
        raise click.BadParameter(f"{path}: must end with .zip", param_hint="FILE.zip")
    for one in (path, path.with_suffix(".declared.yaml"), path.with_suffix(".truth.yaml")):
        if one.exists():
            raise click.ClickException(f"{one}: is there already; choose another name")
    known = (*catalogue.LIBRARY, *catalogue.OUTSIDE)
    unknown = [name for name in effects if name not in known]
    if unknown or len(effects) > 2:
        what = f"{unknown[0]!r}: none of {', '.join(known)}" if unknown else "two at most"
        raise click.BadParameter(what, param_hint="EFFECT")
    of_one = LIBRARY if {*effects} <= {*catalogue.LIBRARY} else OUTSIDE
    kind = (NOTHING, of_one, PAIRS)[len(effects)]
    case = Case(kind, effects, effect_size if effects else NO_SIZE, 0)
    path.parent.mkdir(parents=True, exist_ok=True)
    setup = _setup(**recording)
    setup.camera_for(case, seed).record(path)
    if setup.known_light:
        setup.read(path, case, seed)
    click.echo(f"{path}: {case.key}, scene {case.scene(seed)}")


@main.command("report")
@click.argument("folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option(
    "-o", "--output", type=click.Path(dir_okay=False, path_type=Path), metavar="FILE.md",
    required=True,
)  # fmt: skip
@click.option("--commit", help="Cases of this commit.  [default: of the last case finished]")
@one_line_errors()
def report(folder: Path, output: Path, commit: str | None) -> None:
    """Write tables of the cases in FOLDER to FILE.md, and a figure beside it."""
    from studies.tables import draw  # noqa: PLC0415 - it loads the simulator
    from studies.tables import report as tables  # noqa: PLC0415

    lines = latest(read(folder))
    if not lines:
        raise click.ClickException(f"{folder}: no finished cases in it; 'run' makes them")
    commits = Counter(line["commit"] for line in lines)
    chosen = commit or max(lines, key=lambda line: line["ended"])["commit"]
    if chosen not in commits:
        held = ", ".join(f"{name} ({count})" for name, count in commits.items())
        raise click.BadParameter(f"{chosen!r}: none of {held}", param_hint="--commit")
    wanted = [line for line in lines if line["commit"] == chosen]
    load_pyplot()  # before anything is written
    write_report(tables(wanted, chosen), output)
    draw(wanted, output.with_suffix(".png"))


def _said(line: dict[str, object]) -> str:
    if "failed" in line:
        return f"failed: {line['failed']}"
    found = ", ".join(one["name"] for one in line["found"]) or "nothing"
    others = f" (or {', '.join(line['alternatives'])})" if line["alternatives"] else ""
    return f"{line['verdict']}: {found}{others}, {line['seconds']['diagnosis']} s"


if __name__ == "__main__":
    main()

"""A diagnosis in one call, from files to a report: what ``adv2e diagnose`` does."""

from __future__ import annotations

import difflib
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from adv2e.config import Config, Written, files_among, load_config, names_of, written_keys
from adv2e.config.user_effects import user_effects
from adv2e.diagnosis.configurations import without_user_effects
from adv2e.diagnosis.data.evidence import part_of, read_evidence
from adv2e.diagnosis.diagnose import diagnose as diagnose_evidence
from adv2e.diagnosis.fitting.library import names
from adv2e.diagnosis.known_light import read_known_light
from adv2e.errors import UsageError
from adv2e.geometry import Rectangle, parse_rectangle
from adv2e.process import bars
from adv2e.reports.files import check_folder, write_reports
from adv2e.reports.result import Diagnosis


def diagnose(
    recording: str | Path,
    declared: Written | Sequence[Written] | None = None,
    *,
    light: str | Path | None = None,
    output: str | Path | None = None,
    without: Sequence[str] = (),
    fit_thresholds: bool = False,
    time_unit: str | None = None,
    rotate180: bool = False,
    track: str | int | None = None,
    start_s: float | None = None,
    stop_s: float | None = None,
    crop: str | tuple[int, int, int, int] | None = None,
    set_back: str | None = None,
    crop_events: bool = False,
    overwrite: bool = False,
    threads: int | None = None,
    progress: bool = False,
) -> Diagnosis:
    """Find what a recording holds that its simulation lacks.

    It takes minutes, as the recording is simulated some thousand times.

    Parameters
    ----------
    recording : str or Path
        Frames and events on one clock: a DAVIS240C folder or zip, or HDF5.  With `light`, events
        of any format.
    declared : Config, or what :func:`adv2e.load_config` takes, optional
        What is known of the camera.  A `sensor` must have the size of the recording.
    light : str or Path, optional
        Table of what the light was, in the place of frames: see
        :mod:`adv2e.diagnosis.known_light`.
    output : str or Path, optional
        Folder for report.html, report.json and model.yaml.  Default: none is written.
    without : sequence of str
        Effects that are not to be tried.
    fit_thresholds : bool
        The contrast thresholds are not known: they are fitted first.
    time_unit : {'s', 'ms', 'us', 'ns'}, optional
        Unit of the times in lists.
    rotate180 : bool
        Turn frames and events by half a turn, as for a camera that was mounted upside down.
    track : str or int, optional
        Which one to read of several streams: its number from 0, or its name.
    start_s, stop_s : float, optional
        Part to look at [s after the first frame].
    crop : (int, int, int, int) or str, optional
        First column, first row, columns and rows of the part of the sensor to look at.
    set_back, crop_events
        See :func:`adv2e.read_events`.
    overwrite : bool
        Replace the folder of an earlier report.
    threads : int, optional
        Default: all cores.  The result does not depend on it.
    progress : bool
        Show the stage and the number of simulations on stderr.

    Returns
    -------
    Diagnosis
        Among others `verdict`, `sentence`, `effects`, `errors`, and `model`, the configuration
        found, which :func:`adv2e.load_config` takes.

    Raises
    ------
    DataError, ConfigError, OutputError, UsageError
        What is wrong with the recording, the configuration, the folder, or the arguments.

    Examples
    --------
    >>> from adv2e import diagnose, load_config
    >>> found = diagnose("recording.zip", "declared.yaml")
    >>> found.verdict, [effect.name for effect in found.effects]
    ('explained', ['refractory'])
    >>> dead_time = load_config(found.model).pixel.refractory.period_us
    """
    try:
        part = None if crop is None else parse_rectangle(crop)
    except ValueError as error:
        raise UsageError(f"crop: {error}") from None
    return diagnose_file(
        recording,
        load_config(declared),
        name=names_of(declared),
        written=written_keys(declared),
        also_read=files_among(declared),
        light=light,
        output=output,
        without=without,
        fit_thresholds=fit_thresholds,
        part=(start_s, stop_s, part),
        reading={
            "time_unit": time_unit,
            "rotate180": rotate180,
            "track": track,
            "set_back": set_back,
            "crop_events": crop_events,
        },
        overwrite=overwrite,
        threads=threads,
        progress=progress,
    )


def diagnose_file(
    recording: str | Path,
    declared: Config,
    *,
    name: str,
    written: Collection[str],
    also_read: Iterable[str | Path],
    light: str | Path | None,
    output: str | Path | None,
    without: Sequence[str],
    fit_thresholds: bool,
    part: tuple[float | None, float | None, Rectangle | None],
    reading: dict[str, Any],
    overwrite: bool,
    threads: int | None,
    progress: bool,
    say: Callable[[str], None] | None = None,
    log: Callable[[str], None] = lambda text: None,
) -> Diagnosis:
    """Do what :func:`diagnose` does, with a configuration that was loaded.

    `name` and `written` are what it was made from and the keys that somebody wrote; `also_read` are
    files that must not be written over; `reading` is for :func:`adv2e.read_events`, and `part` what
    of the recording is looked at (:func:`adv2e.diagnosis.data.evidence.part_of`); `log` takes lines
    for people, and `say` those that tell now and then how far it is, where no bar does.
    """
    check_names(without, names(declared))
    _check_own_names(declared)
    declared = without_user_effects(declared, written)
    if output is not None:
        inputs = [recording, *([] if light is None else [light]), *also_read]
        check_folder(output, overwrite=overwrite, inputs=inputs)
    with _stages(progress, say) as tell:
        evidence = (
            read_evidence(recording, declared.sensor, **reading)
            if light is None
            else read_known_light(recording, light, declared.sensor, **reading)
        )
        evidence = part_of(evidence, *part)
        found = diagnose_evidence(
            evidence,
            declared,
            declared_name=name or "the defaults",
            without=without,
            free_thresholds=fit_thresholds,
            threads=threads,
            written=written,
            progress=lambda now: tell(now.stage, now.simulations),
            log=log,
        )
    if output is not None:
        write_reports(found, output, overwrite=overwrite)
    return found


SAY_EVERY_S = 30.0
USUAL = 1300
"""Simulations of a diagnosis that finds its effect at once; others take up to nine times as many
(the README of this package)."""


def how_far(stage: str, simulations: int, seconds: float) -> str:
    """Return the stage of a diagnosis, and an estimate of the time left."""
    text = f"{stage}: {simulations:,} simulations in {seconds:.0f} s"
    if not simulations:
        return text
    if simulations >= USUAL:
        return f"{text}; it takes longer where no single effect explains all"
    left_s = seconds * (USUAL / simulations - 1)
    return f"{text}; about {max(10, round(left_s, -1)):.0f} s more where one effect explains all"


@contextmanager
def _stages(shown: bool, say: Callable[[str], None] | None) -> Iterator[Callable[[str, int], None]]:
    """Show a stage and the number of simulations done; how many there will be, nobody knows.

    Without a bar, `say` is told the same now and then.
    """
    began = said = time.monotonic()
    layout = "{desc}: {n_fmt} simulations in {elapsed}"
    last = "reading the recording"
    with bars.bar(desc=last, bar_format=layout, disable=not shown) as bar:

        def tell(stage: str, simulations: int) -> None:
            nonlocal last, said
            bar.update(simulations - bar.n)
            now = time.monotonic()
            if say is not None and not shown and now - said >= SAY_EVERY_S:
                said = now
                say(how_far(stage, simulations, now - began))
            if stage != last:
                bar.set_description_str(stage)
                last = stage

        yield tell


def check_names(without: Sequence[str], known: Sequence[str]) -> None:
    """Raise UsageError for an effect that is not known."""
    for name in without:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f"did you mean '{near[0]}'?" if near else f"one of {', '.join(known)}"
            raise UsageError(f"--without {name}: no such effect, {hint}")


def _check_own_names(config: Config) -> None:
    """Raise UsageError for an effect of the user's own that has the name of a built-in one."""
    known = names()
    for name in user_effects(config):
        if name in known:
            raise UsageError(f"--effect: {name}: a built-in effect has that name; choose another")

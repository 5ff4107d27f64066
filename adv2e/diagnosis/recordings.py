"""A diagnosis in one call, from files to a report: what ``adv2e diagnose`` does."""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from adv2e.background import default_threads
from adv2e.config import Config, Written, files_among, load_config, names_of, written_keys
from adv2e.config.user_effects import user_effects
from adv2e.diagnosis.configurations import without_user_effects
from adv2e.diagnosis.data.evidence import part_of, read_evidence
from adv2e.diagnosis.diagnose import diagnose as diagnose_evidence
from adv2e.diagnosis.film.diagnose import diagnose_films
from adv2e.diagnosis.film.recordings import Pair, read_pairs, read_recordings
from adv2e.diagnosis.fitting.library import names
from adv2e.diagnosis.known_light import read_known_light
from adv2e.errors import UsageError, did_you_mean
from adv2e.files.regular import shown
from adv2e.options import DiagnoseOptions, EventInput, chosen, crop_of, size_of, takes
from adv2e.process import bars
from adv2e.reports.files import so_far, write_reports
from adv2e.reports.result import Diagnosis

if TYPE_CHECKING:
    from typing_extensions import Unpack


@takes(DiagnoseOptions)
def diagnose(
    recording: str | Path | Sequence[str | Path],
    declared: Written | Sequence[Written] | None = None,
    *,
    output: str | Path | None = None,
    **options: Unpack[DiagnoseOptions],
) -> Diagnosis:
    """Find what a recording holds that its simulation lacks.

    It takes minutes, as the recording is simulated some thousand times.

    Parameters
    ----------
    recording : str or Path, or a sequence of them
        Frames and events on one clock: a DAVIS240C folder or zip, or HDF5.  With `light` or
        `film`, events of any format; with `film`, several of one camera.  With `films`, ().
    declared : Config, or what :func:`adv2e.load_config` takes, optional
        What is known of the camera.  A `sensor` must have the size of the recording.
    output : str or Path, optional
        Folder for report.html, report.json and model.yaml, which hold what is known so far until it
        is finished.  Default: none is written.
    **options
        See :class:`adv2e.options.DiagnoseOptions`, :mod:`adv2e.diagnosis.known_light` for
        `light`, and :mod:`adv2e.diagnosis.film` for `film` and `films`.

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
    given = [recording] if isinstance(recording, (str, Path)) else recording
    return diagnose_file(
        given,
        load_config(declared, size=size_of(options)),
        name=names_of(declared),
        written=written_keys(declared),
        also_read=files_among(declared),
        output=output,
        **options,
    )


@takes(DiagnoseOptions)
def diagnose_file(
    recordings: Sequence[str | Path],
    declared: Config,
    *,
    name: str,
    written: Collection[str],
    also_read: Iterable[str | Path],
    output: str | Path | None,
    say: Callable[[str], None] | None = None,
    log: Callable[[str], None] = lambda text: None,
    **options: Unpack[DiagnoseOptions],
) -> Diagnosis:
    """Diagnose as :func:`diagnose` does, with a configuration that was loaded.

    `name` and `written` are what it was made from and the keys that somebody wrote; `also_read` are
    files that must not be written over; `log` takes lines for people, and `say` those that tell now
    and then how far it is, where no bar does.
    """
    light, without, overwrite = options["light"], options["without"], options["overwrite"]
    # a part begins with what its pixels saw before
    whole: EventInput = {"start_s": None, "stop_s": None, "crop": None}
    reading: EventInput = {**chosen(EventInput, options), **whole}
    del reading["size"]  # that of the sensor is in the configuration
    check_names(without, names(declared))
    for one in user_effects(declared):
        if one in names():
            raise UsageError(f"--effect: {one}: a built-in effect has that name; choose another")
    declared = without_user_effects(declared, written)
    pairs, seen = _pairs(recordings, options)
    inputs = [*recordings, *seen, *also_read]
    kept = nullcontext() if output is None else so_far(output, overwrite=overwrite, inputs=inputs)
    with kept as known, _stages(options["progress"], say) as tell:
        about: dict[str, Any] = {
            "declared_name": name or "the defaults",
            "without": without,
            "free_thresholds": options["fit_thresholds"],
            "written": written,
            "log": log,
            "known": known,
        }
        threads = options["threads"] or default_threads()
        if pairs:
            films = read_recordings(pairs, declared.sensor, **reading)
            shown_as = recordings[0] if len(recordings) == 1 else options["films"] or pairs[0][0]
            found = diagnose_films(
                films, shown(shown_as), declared, threads=threads, progress=tell, **about
            )
        else:
            evidence = (
                read_evidence(recordings[0], declared.sensor, **reading)
                if light is None
                else read_known_light(recordings[0], light, declared.sensor, **reading)
            )
            evidence = part_of(evidence, options["start_s"], options["stop_s"], crop_of(options))
            found = diagnose_evidence(evidence, declared, threads=threads, progress=tell, **about)
        if output is not None:
            write_reports(found, output, overwrite=overwrite)
    return found


def _pairs(
    recordings: Sequence[str | Path], options: DiagnoseOptions
) -> tuple[list[Pair], list[str | Path]]:
    """Return recordings with their films, none without films; and what else is read.

    Raises
    ------
    UsageError
        Options contradict one another, or there is no recording, or one too many.
    DataError
        As :func:`read_pairs` raises it.
    """
    light, film, films = options["light"], options["film"], options["films"]
    given = {"--light": light, "--film": film, "--films": films}
    named = [option for option, value in given.items() if value is not None]
    if len(named) > 1:
        raise UsageError(f"{' and '.join(named)}: give one of them, what the camera saw")
    if film is None and films is None:
        if len(recordings) != 1:
            raise UsageError(
                f"{len(recordings)} recordings are given: one is diagnosed, or with --film or"
                " --films those of one camera before known pictures; an output is put behind -o"
            )
        return [], [] if light is None else [light]
    if any(options[name] is not None for name in ("start_s", "stop_s", "crop")):
        raise UsageError(f"{named[0]}: leave --start, --stop and --crop out: all of it was seen")
    if film is not None:
        if not recordings:
            raise UsageError("--film: give the recordings of events, too")
        return [(one, film) for one in recordings], [film]
    if recordings:
        raise UsageError("--films: its table names the events: give no RECORDING")
    assert films is not None
    pairs = read_pairs(films)
    return pairs, [films, *(name for pair in pairs for name in pair)]


SAY_EVERY_S = 20.0
_FEW = 50
"""Simulations before which nobody knows how long one takes."""
_REST = 31
"""Columns of a bar beside the stage."""
USUAL = 1200
"""Simulations of a diagnosis that finds its effect at once; others take up to seven times as many
(the README of this package)."""


def how_far(stage: str, simulations: int, seconds: float) -> str:
    """Return the stage of a diagnosis, and an estimate of the time left."""
    text = f"{stage}: {simulations:,} simulations in {seconds:.0f} s"
    if simulations < _FEW:
        return text
    if simulations >= USUAL:
        return f"{text}; it takes longer where no single effect explains all"
    left_s = seconds * (USUAL / simulations - 1)
    return f"{text}; about {max(10, round(left_s, -1)):.0f} s more where one effect explains all"


@contextmanager
def _stages(shown: bool, say: Callable[[str], None] | None) -> Iterator[Callable[[str, int], None]]:
    """Show a stage and the number of simulations done; how many there will be, nobody knows.

    Without a bar, `say` is told the same now and then, also where no simulation ends meanwhile.
    """
    began = time.monotonic()
    layout = "{desc}: {n_fmt} simulations in {elapsed}"
    last, done, ended = "reading the recording", 0, threading.Event()
    with bars.bar(desc=last, bar_format=layout, disable=not shown) as bar:

        def tell(stage: str, simulations: int) -> None:
            nonlocal last, done
            bar.update(simulations - bar.n)
            if stage != last:
                # a line that is too long for the terminal would be drawn again below itself
                bar.set_description_str(stage[: shutil.get_terminal_size().columns - _REST])
            last, done = stage, simulations

        def follow() -> None:
            every_s = 1.0 if shown else min(SAY_EVERY_S, threading.TIMEOUT_MAX)
            while not ended.wait(every_s):
                if shown:
                    bar.refresh()
                elif say is not None:
                    say(how_far(last, done, time.monotonic() - began))

        clock = threading.Thread(target=follow, name="adv2e-how-far", daemon=True)
        clock.start()
        try:
            yield tell
        finally:
            ended.set()
            clock.join()


def check_names(without: Sequence[str], known: Sequence[str]) -> None:
    for name in without:
        if name not in known:
            hint = did_you_mean(name, known) or f"one of {', '.join(known)}"
            raise UsageError(f"--without {name}: no such effect, {hint}")

"""``adv2e diagnose``: what a recording holds that its simulation lacks."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from adv2e.cli import options

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from adv2e.cli.options import Log
    from adv2e.config import Config


@click.command("diagnose")
@click.argument("recording", metavar="RECORDING")
@options.config_options
@options.run_options
@click.option(
    "--without",
    "without",
    multiple=True,
    metavar="EFFECT",
    help="Leave an effect out of the library. Repeatable.",
)
@click.option(
    "--fit-thresholds",
    is_flag=True,
    help="The contrast thresholds are not known: fit them first, to the totals of ON and OFF.",
)
@options.time_unit_option
def command(
    recording: str,
    config: Callable[[], Config],
    output: str | None,
    overwrite: bool,
    without: tuple[str, ...],
    fit_thresholds: bool,
    time_unit: str | None,
    threads: int | None,
    progress: bool,
    log: Log,
) -> None:
    """Find what a recording holds that its simulation lacks.

    RECORDING holds frames and events on one clock: a DAVIS240C folder or zip, or HDF5. The
    configuration (-c) says what is known of the camera. The events are simulated from the frames;
    where the recording differs from all simulations by more than chance, the effect that the
    declared model lacks is looked for, fitted, and judged on data that it was not fitted to.

    DIR (-o; default: <stem>.diagnosis) gets report.html with the pictures, report.json, and
    model.yaml, the declared model with what was found, for 'adv2e convert -c'.

    \b
    Examples:
      adv2e diagnose recording.zip -c declared.yaml -o diagnosis
      adv2e diagnose recording.zip -c davis346 --without flicker
    """
    from pathlib import Path

    from adv2e.config import names_of, written_keys
    from adv2e.config.user_effects import user_effects
    from adv2e.diagnosis.configurations import without_user_effects
    from adv2e.diagnosis.data.evidence import read_evidence
    from adv2e.diagnosis.diagnose import diagnose
    from adv2e.diagnosis.fitting.library import names
    from adv2e.files.names import shown
    from adv2e.reports.files import check_folder, write_reports
    from adv2e.reports.summary import summary_text

    declared = config()
    check_names(without, names(declared))
    _check_own_names(user_effects(declared), names())
    options_given = click.get_current_context().params
    given = options_given["config_files"], options_given["sets"]
    written = written_keys(*given)
    declared = without_user_effects(declared, written)
    folder = Path(output or f"{Path(recording).stem}.diagnosis")
    check_folder(folder, overwrite=overwrite, inputs=[recording, *options.files_given()])
    with _stages(progress) as tell:
        tell("reading the recording", 0)
        evidence = read_evidence(recording, time_unit)
        found = diagnose(
            evidence,
            declared,
            declared_name=names_of(*given) or "the defaults",
            without=without,
            free_thresholds=fit_thresholds,
            threads=threads,
            written=written,
            progress=lambda now: tell(now.stage, now.simulations),
            log=lambda text: log(text, 1),
        )
    write_reports(found, folder, overwrite=overwrite)
    for line in summary_text(found).splitlines():
        log(line)
    log(shown(f"report: {folder / 'report.html'}"))


@contextmanager
def _stages(shown: bool) -> Iterator[Callable[[str, int], None]]:
    """Show a stage and the number of simulations done; how many there will be, nobody knows."""
    from tqdm import tqdm

    layout = "{desc}: {n_fmt} simulations in {elapsed}"
    with tqdm(bar_format=layout, leave=False, disable=not shown) as bar:
        last = ""

        def tell(stage: str, simulations: int) -> None:
            nonlocal last
            bar.update(simulations - bar.n)
            if stage != last:
                bar.set_description_str(stage)
                last = stage

        yield tell


def check_names(without: Sequence[str], known: Sequence[str]) -> None:
    """Raise UsageError for an effect that is not known."""
    import difflib

    from adv2e.errors import UsageError

    for name in without:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f"did you mean '{near[0]}'?" if near else f"one of {', '.join(known)}"
            raise UsageError(f"--without {name}: no such effect, {hint}")


def _check_own_names(own: Iterable[str], known: Sequence[str]) -> None:
    """Raise UsageError for an effect of the user's own that has the name of a built-in one."""
    from adv2e.errors import UsageError

    for name in own:
        if name in known:
            raise UsageError(f"--effect: {name}: a built-in effect has that name; choose another")

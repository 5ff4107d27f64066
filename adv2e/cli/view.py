"""``adv2e view``: a page on which to look at events in a browser."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from adv2e.cli import completion, options
from adv2e.cli.commands import Command
from adv2e.options import ViewOptions

if TYPE_CHECKING:
    from adv2e.cli.options import Log


@click.command("view", cls=Command)
@click.argument("events", metavar="EVENTS", shell_complete=completion.files)
@options.output_options
@options.reporting_options
@options.declared_options(ViewOptions, help={"start_s": "Here, whichever is earlier."})
def command(
    events: str, output: str | None, overwrite: bool, log: Log, progress: bool, given: Any
) -> None:
    """Make a page on which to play events in a browser.

    \b
    Examples:
      adv2e view clip.events.h5
      adv2e view urban.zip -o urban.html --start 1 --stop 3

    EVENTS is a file of events or a recording, of any format that is read. The page is one file of 3
    MB at most, which needs no network. It plays the events, and turns them in x, y and time, above
    their rates. Of many events it draws some, evenly spread, and says how many; the rates count
    all. The frames of a recording lie beneath.

    Without -o, it is <stem>.view.html in the current folder. 'Keys' on the page lists its keys.
    """
    from adv2e.rendering.view import view

    if output is None:
        path = Path(events)
        output = f"{path.resolve().name if path.is_dir() else path.stem}.view.html"
    view(events, output, doubt=log, **given, overwrite=overwrite, progress=progress)
    log(f"{output}: written")

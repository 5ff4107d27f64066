#!/usr/bin/env python
"""Make the README's pictures of the demonstration and of its report, by the commands beside them.

The picture of the demonstration is two of the six parts of the one that ``adv2e demo`` makes; that
of the report is what a browser shows of the ``report.html`` that ``adv2e diagnose`` writes::

    python scripts/readme_pictures.py

It needs Chromium on PATH, and tells the finding: the README quotes it.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import click
import cv2
import numpy as np
from writing import as_written, one_line_errors

PICTURES = Path(__file__).resolve().parents[1] / ".readme"
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
SIZE = 820, 824
"""Width and height of what the browser shows: finding, error and events [pixels]."""

PART = 716, 298
"""Width and height of a part of the picture of the demonstration [pixels]."""
MOVING, AT_REST = (708, 0), (0, 298)
"""Column and row where the parts begin that are shown."""

_OPTIONS = ("--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run")
_DIAGNOSE = ("diagnose", "demo/recording.zip", "-c", "demo/declared.yaml", "-o", "found/")


def two_parts(whole: Path, picture: Path) -> None:
    """Write two parts of the picture of the demonstration, one below the other."""
    pixels = cv2.imread(str(whole))
    parts = [pixels[y : y + PART[1], x : x + PART[0]] for x, y in (MOVING, AT_REST)]
    cv2.imwrite(str(picture), np.concatenate(parts), [cv2.IMWRITE_PNG_COMPRESSION, 9])


def shown_by(browser: str, report: Path, picture: Path) -> None:
    """Write what a browser shows first of a page."""
    with tempfile.TemporaryDirectory() as profile:
        subprocess.run(
            [
                *(browser, *_OPTIONS, f"--user-data-dir={profile}"),
                f"--window-size={SIZE[0]},{SIZE[1]}",
                *(f"--screenshot={picture}", report.resolve().as_uri()),
            ],
            capture_output=True, check=True, timeout=120,
        )  # fmt: skip


@click.command(help=as_written(__doc__))
@one_line_errors()
def main() -> None:
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise click.ClickException(f"none of {', '.join(BROWSERS)} is on PATH: install one")
    with tempfile.TemporaryDirectory() as folder:
        for command in (("demo", "-o", "demo"), _DIAGNOSE):
            subprocess.run([sys.executable, "-m", "adv2e", *command], cwd=folder, check=True)
        two_parts(Path(folder, "demo/clip.events.png"), PICTURES / "demo.png")
        shown_by(browser, Path(folder, "found/report.html"), PICTURES / "report.png")


if __name__ == "__main__":
    main()

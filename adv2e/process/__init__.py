"""Process of the command: signals, standard streams, cleanup, limits of the machine."""

import sys
from pathlib import Path


def python_command(code: str, *words: str) -> list[str]:
    """Return the command by which this Python runs `code`, and no file of the current folder.

    It looks for modules where this one does, but for the current folder, which stands there as an
    empty name where Python was given a command or runs at a prompt.
    """
    home = str(Path(__file__).parents[2])  # last: nothing in it can stand for another module
    path = [place for place in (*sys.path, home) if place not in ("", ".")]
    # in another mode it would write names in other bytes
    told = ["-X", f"utf8={sys.flags.utf8_mode}", *["-I"] * sys.flags.isolated]
    # until the path is set nothing is imported but `sys`, which is no file
    return [sys.executable, *told, "-c", f"import sys; sys.path[:] = {path!a}; {code}", *words]

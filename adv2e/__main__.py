"""The command ``adv2e``, and the same as ``python -m adv2e``."""

import atexit
import gc
import os
import signal
import sys


def collect_seldom() -> None:
    """Look for cycles among many objects at a time only, and at the end of the program not at all.

    Imports make tens of thousands of objects that stay, and compiling a million; looking through
    them again and again takes longer than a short run may.
    """
    gc.set_threshold(200_000, 20, 20)
    atexit.register(gc.freeze)


def _leave_current_folder() -> None:
    """Look in the current folder, which ``-m`` puts first, for no library."""
    try:
        here = os.getcwd()  # noqa: PTH109 - as little as can be is imported before
    except OSError:
        return
    if sys.path[:1] == [here]:
        del sys.path[0]


def _fill_standard_streams() -> None:
    """Open those that were closed, or a file that is written would be taken for one of them."""
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(descriptor)


def main() -> None:
    """Run the command line; a signal that comes while it is imported ends it quietly, too."""
    collect_seldom()
    has_usual = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if has_usual:  # it has a traceback printed
        signal.signal(signal.SIGINT, lambda number, frame: os._exit(128 + number))
    _fill_standard_streams()
    from adv2e.process.signals import stop_on_signals  # noqa: PLC0415
    from adv2e.process.standard_error import keep_errors_for_ourselves  # noqa: PLC0415

    if has_usual:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    stop_on_signals()
    keep_errors_for_ourselves()
    from adv2e.cli import main as command  # noqa: PLC0415

    command()


if __name__ == "__main__":
    _leave_current_folder()
    main()

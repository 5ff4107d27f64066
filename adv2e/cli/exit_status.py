"""Running a command: whatever ends it becomes one line on stderr and an exit status.

====== ===================================================================================
0      done
1      a file, its content or the machine is at fault; or a bug of ours
2      the command line alone is wrong
129    the terminal went away (SIGHUP)
130    interrupted (SIGINT, Ctrl-C)
141    the reader of our standard output went away; nothing is said
143    told to stop (SIGTERM)
====== ===================================================================================

The first SIGINT while frames come through a pipe ends those, and is no interruption: 0.  Any other
signal removes unfinished files and ends the program where it is; see
:mod:`adv2e.process.signals`.
"""

from __future__ import annotations

import io
import os
import signal
import sys
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

import click

from adv2e.errors import Adv2eError, Adv2eWarning, is_for_users, one_line
from adv2e.files.regular import shown
from adv2e.process.machine import machine_complaint
from adv2e.process.signals import Terminated, last_words

VERBOSITY = "adv2e.verbosity"
"""Key of ``click.Context.meta`` that holds how often -v was given."""

_CLOSED_OUTPUT = 128 + 13  # SIGPIPE, which Windows does not name


def complain(text: str) -> None:
    """Write one line to stderr, whatever characters and line breaks `text` holds."""
    with suppress(OSError):  # nobody is left to read it
        click.echo(f"adv2e: {shown(text)}", err=True)


@contextmanager
def warnings_for_people() -> Iterator[None]:
    """Show warnings of ours, and of a user's own effect, as lines; none of what libraries warn us.

    Nothing changes where whoever looks for a fault asked Python for warnings (``-W``).
    """
    usual = warnings.showwarning

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        if is_for_users(message, filename):
            place = "" if isinstance(message, Adv2eWarning) else f"{filename}:{lineno}: "
            complain(f"warning: {place}{message}")

    if not sys.warnoptions:
        warnings.showwarning = show
    try:
        yield
    finally:
        warnings.showwarning = usual


@contextmanager
def reporting(context: click.Context | None = None) -> Iterator[None]:
    """Turn what the body raises into a line on stderr and SystemExit.

    `context` knows whether -vv asked for tracebacks.
    """
    try:
        with _as_signalled():
            yield
    except click.exceptions.Exit:
        raise
    except click.ClickException as error:
        complain(f"error: {_click_text(error)}")
        raise SystemExit(error.exit_code) from None
    except Adv2eError as error:
        complain(f"error: {error}")
        raise SystemExit(error.exit_status) from None
    except BrokenPipeError:
        _silence(sys.stdout)
        raise SystemExit(_CLOSED_OUTPUT) from None
    except (KeyboardInterrupt, click.Abort) as error:
        complain(last_words(error))
        raise SystemExit(128 + signal.SIGINT) from None
    except Terminated as error:
        complain(last_words(error))
        raise SystemExit(error.exit_status) from None
    except Exception as error:
        raise SystemExit(_explained(error, context)) from None


def _explained(error: Exception, context: click.Context | None) -> int:
    """Print an exception that is not one of adv2e as an error message; return the exit status."""
    traced = context is not None and context.meta.get(VERBOSITY, 0) >= 2
    if traced:
        traceback.print_exc()
    if told := machine_complaint(error):
        complain(f"error: {told}")
    elif isinstance(error, OSError):
        place = f"{error.filename}: " if isinstance(error.filename, str) else ""
        complain(f"error: {place}{error.strerror or error}")
    else:
        hint = "" if traced else "; run with -vv for the traceback"
        complain(f"error: internal error: {type(error).__name__}: {one_line(error)}{hint}")
    return 1


@contextmanager
def _as_signalled() -> Iterator[None]:
    """Let what a signal raised end the body as itself.

    When a signal comes while the main thread runs compiled code, that code returns a result with
    the exception set, and Python makes a SystemError of it, at each level.
    """
    try:
        yield
    except SystemError as error:
        cause: BaseException | None = error
        while isinstance(cause, SystemError):
            cause = cause.__cause__
        if isinstance(cause, (KeyboardInterrupt, Terminated)):
            raise cause from None
        raise


def _click_text(error: click.ClickException) -> str:
    text = " ".join(error.format_message().split()).rstrip(".")
    if isinstance(error, click.UsageError) and error.ctx is not None:
        if isinstance(error, click.MissingParameter) and isinstance(error.param, click.Argument):
            text += f": {' '.join(error.ctx.get_usage().split()[1:])}"
        text += f" (see '{error.ctx.command_path} --help')"
    return text


def print_any_character() -> None:
    """Let standard output escape characters that it has no code for, as standard error does."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def flush_stdout(*, quiet: bool) -> None:
    """Write out what standard output still holds, with an exit status of its own if that fails.

    `quiet`: an error has been told already, and is to stay the only line.  What standard error
    still holds makes no failure, as it does for Python.
    """
    with suppress(ValueError, AttributeError):  # closed
        try:
            sys.stderr.flush()
        except OSError:
            _silence(sys.stderr)
    if sys.stdout is None or sys.stdout.closed:
        return
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        _silence(sys.stdout)
        raise SystemExit(_CLOSED_OUTPUT) from None
    except OSError as error:
        _silence(sys.stdout)
        if not quiet:
            complain(f"error: standard output: {error.strerror}")
            raise SystemExit(1) from None


def _silence(stream: TextIO) -> None:
    """Point a stream at nothing, so that Python does not fail again when it closes it."""
    with suppress(OSError, ValueError, AttributeError):
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, stream.fileno())
        os.close(nothing)

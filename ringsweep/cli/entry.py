"""Entry point of the command line: runs a command, reports errors in one line, returns the exit status."""

from __future__ import annotations

import io
import logging
import os
import re
import signal
import sys
import threading
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout, suppress
from typing import Any

from ringsweep.cli.parser import build_parser
from ringsweep.errors import InputError, escaped, nearest_name, print_error, shortened


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments; those of the process by default.

    Returns
    -------
    int
        Exit status: 0 if done, 2 if the input is wrong, 130 after Ctrl-C, 143 after SIGTERM, 1 after anything else, and
        if every run has failed.
    """
    _prepare_streams()
    parser = build_parser()
    given = sys.argv[1:] if argv is None else list(argv)
    if not given:
        parser.print_help()
        return 2
    arguments, unknown = parser.parse_known_args(given)
    if unknown:
        # With the hyphens, which all have in common, --units would be near --boundaries.
        near = nearest_name(unknown[0].lstrip("-"), re.findall(r"--([a-z-]+)", arguments.parser.format_usage()))
        apart = any(word.startswith("-") for word in given) and not unknown[0].startswith("-")
        hint = "; a value with a space needs quotes: --set 'drive.amplitude=2 rad/s'" if apart else ""
        if "--set" in given and "=" in unknown[0]:
            hint = f"; each value has its own --set: --set {unknown[0]}"
        hint = f"; did you mean --{near}?" if unknown[0].startswith("-") and near else hint
        parser.error(f"unrecognized arguments: {' '.join(unknown)}{hint}")
    logging.basicConfig(stream=sys.stderr, level=logging.WARNING)
    logging.getLogger().handlers[0].setFormatter(_Formatter())
    level = logging.DEBUG if arguments.verbose else logging.WARNING if arguments.quiet else logging.INFO
    logging.getLogger("ringsweep").setLevel(level)
    # Numbers for a program are no message.
    out = None if arguments.quiet and not getattr(arguments, "json", False) else _Escaped(sys.stdout)
    try:
        with _terminable(), _warnings_in_one_line(), redirect_stdout(out):
            status = arguments.command(arguments)
            print(end="", flush=True)
    except InputError as error:
        return _fail(str(error), 2, error)
    except KeyboardInterrupt as error:
        number = signal.SIGTERM if signal.SIGTERM in error.args else signal.SIGINT
        status = _fail("interrupted", 128 + number, error)
        if argv is None:
            # A regular exit would wait for a compilation that other threads have begun.
            with suppress(OSError):
                sys.stdout.flush()
            os._exit(status)
        return status
    except BrokenPipeError:
        # The reader of the output, such as `head`, has closed it.
        _give_up_unwritable_output()
        return 0
    except Exception as error:
        if arguments.verbose:
            traceback.print_exception(error)
        _give_up_unwritable_output()
        if library := _importing(error):
            return _fail(f"{library} cannot be loaded ({error}): is one of its environment variables wrong?", 2, error)
        if isinstance(error, OSError) and error.strerror:
            return _fail(": ".join([str(error.filename)] * (error.filename is not None) + [error.strerror]), 1, error)
        return _fail(shortened(f"{type(error).__name__}: {error}", 1500), 1, error)
    return status or 0


def _importing(error: BaseException) -> str | None:
    """Name of the outermost library whose import has raised an error; None if another one was under way."""
    for frame, _ in traceback.walk_tb(error.__traceback__):
        module = str(frame.f_globals.get("__name__")).partition(".")[0]
        if frame.f_code.co_name == "<module>" and module not in ("ringsweep", "__main__"):
            return module
    return None


def _prepare_streams() -> None:
    """Let streams that the shell has closed lead nowhere, and escape characters that the encoding of stdout lacks."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            # Else the next file would get the number of the stream.
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


def _give_up_unwritable_output() -> None:
    """Keep the interpreter from trying again at its end to write what cannot be written."""
    try:
        sys.stdout.flush()
    except OSError:
        sys.stdout = None


@contextmanager
def _terminable() -> Iterator[None]:
    """Let SIGTERM do what Ctrl-C does; the interrupt has its number."""

    def terminate(number: int, _: Any) -> None:
        raise KeyboardInterrupt(number)

    if threading.current_thread() is not threading.main_thread():
        # Only the main thread can handle signals.
        yield
        return
    before = signal.signal(signal.SIGTERM, terminate)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def _warnings_in_one_line() -> Iterator[None]:
    """Log warnings of libraries, which may quote what a file holds, without the lines of code that they come from."""
    with warnings.catch_warnings():
        logger = logging.getLogger("ringsweep")
        # What follows the first line may be the traceback of an error that a library has handled.
        warnings.showwarning = lambda message, *_: logger.warning("%s", str(message).strip().partition("\n")[0])
        yield


def _fail(message: str, status: int, error: BaseException) -> int:
    print_error("; ".join([message, *getattr(error, "__notes__", [])]))
    return status


class _Escaped(io.TextIOBase):
    """Text stream that hands on what it is given, with control characters escaped."""

    def __init__(self, stream: Any):
        self._stream = stream

    def write(self, text: str) -> int:
        """Write a text."""
        with _named_output():
            self._stream.write(escaped(text))
        return len(text)

    def flush(self) -> None:
        """Flush the stream."""
        with _named_output():
            self._stream.flush()


@contextmanager
def _named_output() -> Iterator[None]:
    """Name the output in errors of writing it, as errors about files name the file."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, "the output cannot be written") from error


class _Formatter(logging.Formatter):
    """Log messages with the prefix ``ringsweep:``, and with control characters escaped."""

    def format(self, record: logging.LogRecord) -> str:
        return escaped(f"ringsweep: {super().format(record)}")

"""Standard output and error as the shell gave them in; streams that any text can be printed to, and signals as exceptions, out.

A closed stream swallows what is printed, a full one ends the command with one line, one that is not UTF-8 gets plain letters.
"""

from __future__ import annotations

import codecs
import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType
from typing import TextIO
from unicodedata import category

CANNOT_WRITE = 1
"""Exit code where standard output cannot be written."""
PLAIN = {
    "•": "*", "…": "...", "–": "-", "—": "-", "−": "-", "×": "x", "±": "+-", "°": " deg", "→": "->", "≥": ">=", "≤": "<=",
    "“": '"', "”": '"', "‘": "'", "’": "'", "─": "-", "━": "-", "│": "|", "┃": "|",
} | dict.fromkeys("╭╮╰╯┌┐└┘├┤┬┴┼", "+")  # fmt: skip
"""Signs -> what is printed for them where the stream cannot show them."""
PLAINLY = "dlama-plainly"
STOPPING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class Stopped(KeyboardInterrupt):
    """A signal asked this process to stop: SIGINT (Ctrl-C), SIGTERM or SIGHUP. Its argument is the signal's number."""

    @property
    def exit_code(self) -> int:
        """As shells have it: 130, 143, 129."""
        return 128 + int(self.args[0])

    @property
    def word(self) -> str:
        """For the line that says so."""
        return "interrupted" if self.args[0] == signal.SIGINT else f"ended by {signal.Signals(self.args[0]).name}"


def _replace_unencodable(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    failed = error.object[error.start : error.end]
    return "".join(PLAIN.get(sign) or sign.encode("ascii", "backslashreplace").decode() for sign in failed), error.end


def printable(text: str) -> str:
    """The text with what would act on a terminal (control characters but line breaks, marks of direction) escaped."""
    return "".join(
        sign
        if sign == "\n" or category(sign) not in ("Cc", "Cf", "Zl", "Zp")
        else sign.encode("unicode_escape").decode("ascii")
        for sign in text
    )


codecs.register_error(PLAINLY, _replace_unencodable)


def print_line(kind: str, message: str) -> None:
    """One line on standard error that begins with its kind (error, warning, note); never wrapped, and coloured on a terminal."""
    line = printable(" ".join(message.split()))
    if not sys.stderr.isatty():
        with contextlib.suppress(OSError):  # standard error is full: the work continues
            print(f"{kind}: {line}", file=sys.stderr, flush=True)
        return
    from dlama.apps.terminal.bars import print_colored

    print_colored(kind, line)


def open_closed_streams() -> None:
    """Streams 0 to 2 that the shell closed swallow what is written; else the next file opened would get their number."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115, PTH123


def show_any_text() -> None:
    """What a stream's encoding lacks is printed plainly: no text, and no file's name, is an error."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors=PLAINLY)


@contextlib.contextmanager
def signals_raise() -> Iterator[None]:
    """Meanwhile the first SIGINT, SIGTERM or SIGHUP raises Stopped, so that drafts are removed; a second one ends the process."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def second(number: int, frame: FrameType | None) -> None:
        os._exit(128 + number)

    def first(number: int, frame: FrameType | None) -> None:
        for each in STOPPING:
            signal.signal(each, second)
        raise Stopped(number)

    def ignored_exception(unraisable: sys.UnraisableHookArgs) -> None:
        """Where nobody can catch it, as in a callback of a C library (kernels are compiled so), it comes again a little later."""
        stopped = unraisable.exc_value
        if not isinstance(stopped, Stopped):
            hook(unraisable)
            return
        for each in before:
            signal.signal(each, first)
        later = threading.Timer(0.05, signal_main_thread, stopped.args)
        later.daemon = True
        later.start()

    hook = sys.unraisablehook
    ignored = [
        each for each in STOPPING if signal.getsignal(each) == signal.SIG_IGN
    ]  # nohup, and commands in the background
    before = {each: signal.signal(each, first) for each in STOPPING if each not in ignored}
    sys.unraisablehook = ignored_exception
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for each, handler in before.items():
            signal.signal(each, handler)


def signal_main_thread(number: int) -> None:
    """Send a signal to the main thread, which it wakes where it waits."""
    if sys.platform == "win32":
        signal.raise_signal(number)
    else:
        signal.pthread_kill(threading.main_thread().ident or 0, number)


def find_write_error(stream: TextIO) -> OSError | None:
    """What went wrong with what was printed to a stream; None: it is all out. From now on a failed stream swallows everything."""
    try:
        with contextlib.suppress(ValueError):  # closed
            stream.flush()
    except OSError as error:
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        return error
    return None

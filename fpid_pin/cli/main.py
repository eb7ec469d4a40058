"""The `fpid-pin` command: how errors and Ctrl-C reach the user."""

import errno
import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, NoReturn

from fpid_pin import own_code
from fpid_pin.exceptions import FpidError, FpidWarning
from fpid_pin.text import cut, visible

#: What a shell makes of a program that Ctrl-C has ended.
STOPPED = 130


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; errors a user can act on are plain lines and exit status 2."""
    warnings.showwarning = _plain_warning
    try:
        with _interruptible() as interrupted:
            try:
                _run(sys.argv[1:] if arguments is None else arguments)
                sys.stdout.flush()
                return 0
            except (Exception, KeyboardInterrupt) as error:
                # A library may have made something else of Ctrl-C on its way. Told here, so that
                # what it has left half made goes before complaints are shown again.
                return _stopped() if interrupted else _tell(error)
    except KeyboardInterrupt:
        return _stopped()


def program() -> NoReturn:
    """Run the command line as a program of its own: what ``fpid-pin`` starts."""
    status = main()
    # All is done: Ctrl-C while Python takes itself down would print a traceback.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.exit(status)


def _stopped() -> int:
    _say("stopped")
    return STOPPED


def _run(arguments: list[str]) -> None:
    # Imported late: Ctrl-C is taken care of by now.
    from typer import Exit
    from typer.main import get_command

    from fpid_pin.cli.commands import app

    try:
        # Typer's own way in makes a status of Ctrl-C, and nothing of a pipe that nobody reads.
        with get_command(app).make_context("fpid-pin", [*arguments]) as context:
            context.command.invoke(context)
    except Exit:  # --help and --version
        pass
    except SystemExit:
        # Rich leaves in silence where its output is such a pipe.
        raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE)) from None


def _tell(error: BaseException) -> int:
    """Say in one line what went wrong, and return the exit status; raise what is our own fault."""
    if isinstance(error, FpidError):
        for text in str(error).splitlines():
            _say(text)
    elif isinstance(error, OSError):
        # A write that fails does not say where; of files it is known by now (`files.unwritable`).
        where = "standard output" if error.filename is None else os.fsdecode(error.filename)
        _say(f"{where}: {error.strerror or error}")
        _give_up_output()
    elif isinstance(error, MemoryError):
        _say("out of memory")
    elif type(error).__name__ == "NoArgsIsHelpError":
        sys.stderr.write(f"{error}\n")
    elif hasattr(error, "format_message"):
        # Of how it was called: an unknown command or option, a missing argument.
        _say(cut(error.format_message()))
    elif place := own_code.place_of(error):
        _say(f"{place}: {type(error).__name__}: {error}")
    else:
        raise error
    return 2


def _say(text: str) -> None:
    # Standard error may be as full or as closed as standard output.
    with suppress(OSError, ValueError):
        sys.stderr.write(f"fpid-pin: {visible(text)}\n")
        sys.stderr.flush()


def _give_up_output() -> None:
    """Write what is left to nowhere, where standard output takes no more: Python tries at exit."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        with suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, sys.stdout.fileno())
            os.close(nowhere)


def _plain_warning(
    message: Warning | str, category: type[Warning], *_: object, **__: object
) -> None:
    kind = "" if issubclass(category, FpidWarning) else f"{category.__name__}: "
    _say(f"warning: {kind}{message}")


@contextmanager
def _interruptible() -> Iterator[list[int]]:
    """Let Ctrl-C raise `KeyboardInterrupt`; give a list that is not empty once it has.

    Where Python may not let an exception pass (a callback, a destructor) it prints it and goes on;
    Ctrl-C is then heard again, after it. From then on destructors of what is left half made
    complain to nobody.
    """
    heard: list[int] = []

    def interrupt(*_: object) -> None:
        heard.append(1)
        raise KeyboardInterrupt

    def lost(unraisable: Any) -> None:
        if isinstance(unraisable.exc_value, KeyboardInterrupt):
            signal.setitimer(signal.ITIMER_REAL, 0.001)
        elif not heard:
            hook(unraisable)

    before, hook = signal.getsignal(signal.SIGINT), sys.unraisablehook
    # `nohup` and a shell's background jobs do not hear it; another thread cannot.
    if before is signal.SIG_IGN or threading.current_thread() is not threading.main_thread():
        yield heard
        return
    signal.signal(signal.SIGINT, interrupt)
    alarm = signal.signal(signal.SIGALRM, interrupt)
    sys.unraisablehook = lost
    try:
        yield heard
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, alarm)
        signal.signal(signal.SIGINT, before)
        sys.unraisablehook = hook


if __name__ == "__main__":
    program()

"""Where the command `fpid-pin` begins: Ctrl-C is a status from the first import on.

Importing the package takes a third of a second, in which Python would answer Ctrl-C with a
traceback. A module of its own, since importing any part of a package imports its top first.
"""

import atexit
import os
import signal
import sys


def _stop(*_: object) -> None:
    # Nothing is begun yet, or all is done: there is nothing to clean up.
    os.write(2, b"fpid-pin: stopped\n")
    os._exit(130)


def main() -> int:
    """Run the command line; see `fpid_pin.cli.main`."""
    from fpid_pin.cli.main import main as command

    return command()


# Ignored is what `nohup` and a shell's background jobs want of it.
if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, _stop)
    # The first to be registered is the last to be called. What Python does after it, it does with
    # signals as they were at birth: Ctrl-C would end by a signal what has already ended well.
    atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)

if __name__ == "__main__":
    sys.exit(main())

"""Programs that tests run and things that they wait for, none of them for ever."""

import contextlib
import os
import subprocess
import threading
import time

import psutil

#: Seconds after which something hangs: far more than anything takes, on a busy machine too.
PATIENCE = 120.0
#: Whether all attacks are made, or the few that a suite has time for.
FULL = os.environ.get("FPID_TORTURE") == "full"


def finished(arguments, **options):
    """Run a program to its end, `PATIENCE` at most, and return its status and what it said."""
    given = {"capture_output": True, "text": True, "timeout": PATIENCE, "check": False}
    return subprocess.run(arguments, **(given | options))


@contextlib.contextmanager
def started(arguments, **options):
    """Start a program for the length of a block, which at its end waits for it.

    It is killed after `PATIENCE`, so that reading what it says and waiting for its end are
    bounded, and it is killed when the block fails.
    """
    with subprocess.Popen(arguments, **options) as child:
        watch = threading.Timer(PATIENCE, killed, [child])
        watch.start()
        try:
            yield child
            child.wait()
        except BaseException:
            killed(child)
            raise
        finally:
            watch.cancel()


def killed(child):
    """Kill a program, unless it has ended, and all that it has started."""
    if child.poll() is not None:
        return
    with contextlib.suppress(psutil.NoSuchProcess):
        family = psutil.Process(child.pid).children(recursive=True)
        child.kill()
        for process in family:
            with contextlib.suppress(psutil.NoSuchProcess):
                process.kill()


def wait_until(condition, seconds=PATIENCE):
    """Wait until a condition holds; return whether it does."""
    limit = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > limit:
            return False
        time.sleep(0.02)
    return True


def ended(thread):
    """Wait for a thread; return whether it has ended."""
    thread.join(PATIENCE)
    return not thread.is_alive()


def until(page, expression):
    """Wait for an expression, from outside: our pages forbid evaluating strings within them."""
    limit = time.monotonic() + PATIENCE
    while not page.evaluate(expression):
        assert time.monotonic() < limit, f"{expression} is not true after {PATIENCE} s"
        page.wait_for_timeout(50)

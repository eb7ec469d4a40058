"""What work needs of this machine: packages that may be missing, memory, time."""

import importlib
import importlib.util
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from fpid_pin.exceptions import ArgumentError, FpidError

#: Work longer than this is taken for a mistake [s].
MOST_SECONDS = 30 * 86400.0
#: A step of one joint on a usual processor [s]; a guess within a factor of some three.
STEP_SECONDS = 3e-7
# Where Linux tells a container how much it may have.
_CONTAINER = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")


@cache
def _blas() -> Any:
    # Both are there by then, each with a BLAS of its own.
    import scipy.linalg  # noqa: F401
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let BLAS work on one thread, in this block or the function that is decorated.

    The matrices of an arm are small: shared out over threads they take longer, where other work
    goes on up to thirty times as long, since each waits for the others.
    """
    with _blas().limit(limits=1, user_api="blas"):
        yield


def keep_to_one_thread() -> None:
    """Let BLAS work on one thread from now on: processes that share the cores have one each."""
    _blas().limit(limits=1, user_api="blas")


def installed(module: str) -> bool:
    """Return whether a module of an extra can be imported."""
    return importlib.util.find_spec(module) is not None


def needed(module: str, extra: str) -> Any:
    """Import a module of an extra; where it is not installed, say what to install."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        if error.name is not None and error.name.split(".")[0] != module.split(".")[0]:
            raise  # it is there, and lacks something itself
        raise FpidError(
            f"{module}: expected it to be installed (pip install 'fpid_pin[{extra}]'), got none"
        ) from None


def memory() -> int:
    """Return how much memory there is for this process [bytes]."""
    limits = [os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")]
    for path in _CONTAINER:
        try:
            limits.append(int(Path(path).read_text(encoding="ascii")))
        except (OSError, ValueError):  # another system, or "max"
            continue
    return min(limits)


def require_memory(name: str, what: str, size: float) -> None:
    """Refuse what takes `size` bytes where there are fewer."""
    if size > (there := memory()):
        raise ArgumentError(
            name, f"work that fits into {there / 1e9:.3g} GB of memory",
            f"{what}: about {size / 1e9:.3g} GB",
        )  # fmt: skip


def require_time(name: str, what: str, joint_steps: float) -> None:
    """Refuse what takes longer than `MOST_SECONDS`, by the steps of single joints in it."""
    seconds = joint_steps * STEP_SECONDS
    if seconds > MOST_SECONDS:
        most, asked = MOST_SECONDS / 86400.0, seconds / 86400.0
        raise ArgumentError(
            name, f"work of {most:g} days at most", f"{what}: about {asked:.3g} days"
        )

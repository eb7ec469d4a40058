"""Modules of a user's own that a configuration names: run once, and again in worker processes.

A configuration is data, and nothing in it is executed; with ``import = "my_laws.py"`` it asks for
code to be run, which is done only where the user has allowed it.
"""

import importlib.util
import sys
from collections.abc import Sequence
from contextvars import ContextVar
from pathlib import Path

from fpid_pin.exceptions import ConfigError, FpidError
from fpid_pin.text import cut, shown

#: Whether configurations may name modules to be run.
allowed: ContextVar[bool] = ContextVar("allowed", default=False)
_PREFIX = "fpid_pin_own_"


def load(paths: Sequence[Path]) -> None:
    """Run modules, each once in a process; what they describe has its names from then on."""
    for path in paths:
        label = cut(str(path))
        if not allowed.get():
            raise ConfigError(
                f"import: expected --allow-import, as the code of {label} is run, got none"
            )
        if not path.is_file():
            raise ConfigError(f"import: expected a Python file, got {shown(label)}, which is none")
        _run(path.resolve())


def loaded() -> list[str]:
    """Return the files that were run here: what a worker process has to run as well."""
    found = (m for name, m in sys.modules.items() if name.startswith(_PREFIX))
    return [str(module.__file__) for module in found]


def load_again(paths: Sequence[str]) -> None:
    """Run in a worker what was run in its parent."""
    for path in paths:
        _run(Path(path))


def _run(path: Path) -> None:
    # Pickled objects name their class's module: one name for the file, in every process.
    name = f"{_PREFIX}{path.stem}"
    before = sys.modules.get(name)
    if before is not None and before.__file__ == str(path):
        return
    if before is not None:
        raise ConfigError(f"import: expected files of different names, got {path.name} twice")
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ConfigError(f"import: expected a Python file, got {shown(path.name)}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        kind = "" if isinstance(error, FpidError) else f"{type(error).__name__}: "
        raise ConfigError(f"import: {path.name}{_line(error, path)}: {kind}{error}") from None


def place_of(error: BaseException) -> str:
    """Return where in a module of the user's own an error was raised, as `own.py:7`, or nothing."""
    places = [(Path(path).name, _line(error, Path(path))) for path in loaded()]
    return next((name + line for name, line in places if line), "")


def _line(error: BaseException, path: Path) -> str:
    """Return in which line of a file an error was raised, as `:7`."""
    line = getattr(error, "lineno", None) if isinstance(error, SyntaxError) else None
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == str(path):
            line = trace.tb_lineno
        trace = trace.tb_next
    return "" if line is None else f":{line}"

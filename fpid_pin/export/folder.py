"""`export_c`: a controller as a folder of C99 that can be built, checked, and put on a robot."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin import checks, descriptions
from fpid_pin.control import Controller
from fpid_pin.exceptions import ExportError, FileFormatError
from fpid_pin.export import vectors
from fpid_pin.export.build import readme
from fpid_pin.export.c_source import CSource
from fpid_pin.export.law import start
from fpid_pin.files import hidden_folder, kind_of, sync, sync_tree
from fpid_pin.references import Hold
from fpid_pin.simulation.toml import toml_text

if TYPE_CHECKING:
    from fpid_pin.arms import Arm
    from fpid_pin.simulation import Experiment

#: Of test vectors: some hundred megabytes.
MOST_TICKS = 1_000_000


def export_c(
    controller: Controller,
    arm: Arm,
    step: float,
    folder: str | Path,
    *,
    horizon: float = 3600.0,
    ticks: int = 2000,
    experiment: Experiment | None = None,
    toml: str | None = None,
) -> Path:
    """Write a controller as C99: the kernels that simulate, printed, with a proof that they are.

    Parameters
    ----------
    controller
        Any law by its functions (`Controller`'s first two forms), with whatever it has.
    arm
        The nominal arm: its joints, effort limits, and its model where the law uses it.
    step
        Sampling period [s]; part of the controller.
    folder
        A new folder.
    horizon
        Longest time that it will run [s]; fractional memories are fitted for it.
    ticks
        Length of ``vectors.bin``, at most; a million is the most.
    experiment
        What ``vectors.bin`` is recorded in; None: motions within the joints' limits, and errors
        from none to half a radian, whatever the controller answers.
    toml
        The configuration that made it; None: one is written from `controller` and `arm`.

    Returns
    -------
    Path
        Of the folder, with ``fpid.h``, ``fpid.c``, ``fpid_parameters.c``, ``example.c``,
        ``fpid_check.c``, ``vectors.bin``, ``CMakeLists.txt``, ``README.md`` and
        ``controller.toml``.

    Raises
    ------
    ExportError
        A folder that exists, too many joints, a law in plain Python, or one with a line that has no
        counterpart in C.
    ArgumentError
        A design without modes.
    """
    path = Path(folder)
    if kind_of(path) is not None:
        raise ExportError(f"{path}: expected a new folder, got one that exists")
    step = checks.number("step", step, above=0.0)
    ticks = checks.integer("ticks", ticks, low=1, high=MOST_TICKS)
    checks.instance("controller", controller, Controller, "a controller")
    controller = controller.on(arm, step=step, horizon=horizon)
    state = start(controller, arm, step, horizon)
    source = CSource(state)
    ticks = min(ticks, round(horizon / step))
    if experiment is None:
        inputs = vectors.signals(arm, step, ticks)
    else:
        inputs = vectors.simulated(experiment, controller, ticks)
    proof = vectors.answers(controller, arm, step, horizon, inputs)
    if not np.isfinite(proof.torque).all():
        raise ExportError(
            f"{type(controller).__name__}: its torques do not stay finite where they have no "
            "effect: give an experiment to record vectors in"
        )
    made_by = toml if toml is not None else _toml(controller, arm, step, horizon)
    try:
        with hidden_folder(path) as hidden:
            temporary = hidden / "new"
            temporary.mkdir()
            write_sources(source, temporary)
            proof.write(temporary / "vectors.bin")
            (temporary / "controller.toml").write_text(made_by, encoding="utf-8")
            text = readme(state, temporary, source.exact)
            (temporary / "README.md").write_text(text, encoding="utf-8")
            sync_tree(temporary)
            os.rename(temporary, path)
        sync(path.parent)
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be written ({error.strerror})") from None
    return path


def write_sources(source: CSource, folder: Path) -> None:
    """Write all that is compiled, and how, into a folder that exists."""
    for name, text in source.files.items():
        (folder / name).write_text(text, encoding="utf-8")


def _toml(controller: Controller, arm: Arm, step: float, horizon: float) -> str:
    rest = Hold(tuple(arm.home.tolist()))
    table = {
        "format": 1,
        "arm": descriptions.to_dict(arm),
        "reference": descriptions.to_dict(rest),
        "simulation": {"step": step},
        "controller": [descriptions.to_dict(controller)],
    }
    return f"# Exported with --horizon {horizon:g}.\n{toml_text(table)}"

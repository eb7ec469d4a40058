"""Every controller under every condition: simulated together, each run with a file of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fpid_pin.cli.names import file_names
from fpid_pin.cli.progress import progress_bar
from fpid_pin.cli.summary import Entry
from fpid_pin.control import Controller
from fpid_pin.simulation import Experiment, simulate


def simulate_pairs(
    experiments: Mapping[str, Experiment],
    controllers: Mapping[str, Controller],
    taken: Sequence[str] = (),
) -> list[Entry]:
    """Simulate every pair, condition by condition.

    Parameters
    ----------
    experiments, controllers
        By the names of conditions, and of controllers.
    taken
        File names, without their ending, that are given already.
    """
    keys = [(condition, label) for condition in experiments for label in controllers]
    many = len(experiments) > 1
    files = file_names([key if many else key[1:] for key in keys], taken=taken)
    with progress_bar(f"simulating {len(keys)} runs") as progress:
        runs = simulate(
            [experiments[condition] for condition, _ in keys],
            [controllers[label] for _, label in keys],
            progress=progress,
        )
    return [
        Entry(*key, run, f"{file}.npz") for key, run, file in zip(keys, runs, files, strict=True)
    ]

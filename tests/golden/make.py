"""Make runs.npz anew: see README.md for when this is right.

python tests/golden/make.py
"""

from __future__ import annotations

import json
import sys

import numpy as np
from cases import CASES, SENSITIVE
from recording import FILE, MARGIN, SHIFT, SMALLEST, FloatArray, difference, record


def main() -> None:
    """Simulate all cases three times, the start as it is and moved either way, and write them."""
    arrays: dict[str, FloatArray] = {}
    outcomes, sensitive = {}, set()
    for name, case in CASES.items():
        outcomes[name], golden = record(case)
        moved = [record(case, shift) for shift in (SHIFT, -SHIFT)]
        if any(outcome != outcomes[name] for outcome, _ in moved):
            raise SystemExit(f"{name}: its outcome hangs on {SHIFT:g} rad; choose another case")
        for key, array in golden.items():
            arrays[f"{name}/{key}"] = array
            found = np.max([difference(array, other[key]) for _, other in moved], axis=0)
            arrays[f"{name}/{key}/sensitivity"] = found
        if MARGIN * arrays[f"{name}/q/sensitivity"].max() > SMALLEST:
            sensitive.add(name)
    np.savez_compressed(FILE, outcomes=np.array(json.dumps(outcomes)), **arrays)
    sys.stdout.write(f"{len(CASES)} cases, {FILE.stat().st_size / 1e6:.2f} MB\n")
    for name in sorted(sensitive ^ SENSITIVE):
        what = "add to" if name in sensitive else "take from"
        sys.stdout.write(f"{what} SENSITIVE in cases.py: {name!r}\n")


if __name__ == "__main__":
    main()

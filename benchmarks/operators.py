"""Fractional operators: accuracy against cost, ours and other packages', on the same signals.

    python benchmarks/operators.py [--quick] [--out DIR]

D^alpha for alpha = 0.5 and 0.9 of sin t, t^1.5, exp(-t) and a chirp from 0.5 to 4.5 Hz, sampled at
1 ms for 20 s: largest error at 60 times spread over the record, divided by the largest exact value
there. Cost: time a sample, one signal; ours also in a population, with its ratio to one `pin.aba`.
Other packages take part where they are installed (``pip install fpid_pin[peers]``). With --out the
table is also written as operators.md, with a figure operators.png.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import gamma

import fpid_pin as fp
from fpid_pin import fractional as fr
from fpid_pin.fractional.exponential_sum import _table

STEP, HORIZON = 1e-3, 20.0
ORDERS = (0.5, 0.9)
SIGNALS: dict[str, tuple[Callable[[Any], Any], Callable[[Any], Any]]] = {
    "sin t": (np.sin, np.cos),
    "t^1.5": (lambda t: t**1.5, lambda t: 1.5 * np.sqrt(t)),
    "exp -t": (lambda t: np.exp(-t), lambda t: -np.exp(-t)),
    "chirp": (
        lambda t: np.sin(2 * np.pi * (0.5 + 0.1 * t) * t),
        lambda t: 2 * np.pi * (0.5 + 0.2 * t) * np.cos(2 * np.pi * (0.5 + 0.1 * t) * t),
    ),
}
Result = tuple[np.ndarray, float]
PEERS = ("pycaputo", "differint", "numfracpy", "fotf")


def exact(rate: Callable[[Any], Any], order: float, t: float) -> float:
    """Caputo's integral in u = lag^(1-alpha), whose integrand is smooth for these orders.

    1/(1 - alpha) is 2 and 10: the lag is a polynomial of u. Gauss-Legendre on 6,000 panels.
    """
    nodes, weights = np.polynomial.legendre.leggauss(12)
    # Panels fine where the lag is long: a chirp turns fastest there per unit of u.
    edges = np.linspace(0.0, t, 6001) ** (1.0 - order)
    half = 0.5 * np.diff(edges)[:, None]
    u = edges[:-1, None] + half * (1.0 + nodes)
    values = rate(np.maximum(t - u ** (1.0 / (1.0 - order)), 0.0))
    return float((half * weights * values).sum() / gamma(2.0 - order))


def streamed(design: fr.Design, f: np.ndarray, df: np.ndarray | None, order: float) -> Result:
    """Run a bank over one signal."""
    rule = "differenced" if df is None else "measured"
    bank = fr.Bank(design, order, step=STEP, horizon=HORIZON, rate=rule)
    out = np.empty_like(f)
    begin = time.perf_counter()
    for k in range(f.size):
        bank.update(f[k], None if df is None else df[k], out[k, ...])
    return out, (time.perf_counter() - begin) / f.size


def whole(function: Callable[[], np.ndarray], samples: int) -> Result:
    """Time a function of the whole record."""
    begin = time.perf_counter()
    out = function()
    return out, (time.perf_counter() - begin) / samples


def ours() -> dict[str, Callable[..., Result]]:
    """Return our methods: name -> method(f, df, functions, order, times)."""
    designs: list[tuple[str, fr.Design, bool]] = [
        ("24 modes", fr.ExponentialSum(24), True),
        ("32 modes", fr.ExponentialSum(32), True),
        ("40 modes", fr.ExponentialSum(40), True),
        ("32 modes, rate unknown", fr.ExponentialSum(32), False),
        ("CRONE N = 5", fr.Crone(1e-2, 1e3, 5), True),
        ("CRONE N = 10, 2 decades wider", fr.Crone(1e-2, 1e3, 10, 2.0), True),
    ]
    methods: dict[str, Callable[..., Result]] = {}
    for name, design, known in designs:
        methods["fpid_pin " + name] = lambda f, df, _, order, __, d=design, k=known: streamed(
            d, f, df if k else None, order
        )
    methods["fpid_pin caputo(), recorded"] = lambda f, df, _, order, __: whole(
        lambda: fr.caputo(f, order, STEP), f.size
    )
    methods["fpid_pin caputo(design=L1()), recorded"] = lambda f, df, _, order, __: whole(
        lambda: fr.caputo(f, order, STEP, design=fr.L1()), f.size
    )
    methods["fpid_pin caputo(rate=), recorded"] = lambda f, df, _, order, __: whole(
        lambda: fr.caputo(f, order, STEP, rate=df), f.size
    )
    methods["fpid_pin grunwald_letnikov(), recorded"] = lambda f, df, _, order, __: whole(
        lambda: fr.grunwald_letnikov(f - f[0], order, STEP), f.size
    )
    return methods


def peers(quick: bool) -> dict[str, Callable[..., Result]]:
    """Return the methods of other packages that are installed.

    They are called as their documentation says, all for Caputo's derivative: those that know only
    Grünwald-Letnikov's are given f - f(0).
    """
    methods: dict[str, Callable[..., Result]] = {}
    if installed("pycaputo") and not quick:
        from pycaputo.differentiation import caputo, diff
        from pycaputo.differentiation import grunwald_letnikov as pycaputo_gl
        from pycaputo.grid import make_uniform_points

        def by_pycaputo(
            method: type, f: np.ndarray, function: Callable[[Any], Any], order: float
        ) -> Result:
            points = make_uniform_points(f.size, a=0.0, b=HORIZON)
            return whole(lambda: diff(method(order), function, points), f.size)

        methods["pycaputo L1"] = lambda f, _, function, order, __: by_pycaputo(
            caputo.L1, f, function, order
        )
        methods["pycaputo GL"] = lambda f, _, function, order, __: by_pycaputo(
            pycaputo_gl.GrunwaldLetnikov, f, lambda t: function(t) - f[0], order
        )
    if installed("differint"):
        from differint import differint

        def by_differint(f: np.ndarray, order: float) -> Result:
            # An even number of points: with an odd one it returns one value fewer.
            n = f.size - 1
            result, cost = whole(
                lambda: differint.GL(order, list(f[:n] - f[0]), 0.0, (n - 1) * STEP, n), n
            )
            return np.append(result, np.nan), cost

        methods["differint GL"] = lambda f, _, __, order, ___: by_differint(f, order)
    if installed("numfracpy"):
        import numfracpy

        def by_numfracpy(
            method: Callable[..., float],
            f: np.ndarray,
            function: Callable[[Any], Any],
            order: float,
            checked: np.ndarray,
        ) -> Result:
            # One point a call, each a loop over the past: a few points are enough to see.
            few = checked[checked < 2000][::6]
            out = np.full(f.size, np.nan)
            begin = time.perf_counter()
            for k in few:
                out[k] = method(function, (k + 0.5) * STEP, STEP, order)
            return out, (time.perf_counter() - begin) / few.size

        methods["numfracpy L1 (first 2 s)"] = lambda f, _, function, order, checked: by_numfracpy(
            numfracpy.Caputo_der1, f, function, order, checked
        )
        methods["numfracpy GL (first 2 s)"] = lambda f, _, function, order, checked: by_numfracpy(
            numfracpy.GLDer1, f, lambda t: function(t) - f[0], order, checked
        )
    return methods


def installed(name: str) -> bool:
    """Say whether a package is installed."""
    try:
        importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


def accuracy_and_cost(quick: bool) -> tuple[list[str], dict[str, tuple[float, float]]]:
    """Return the table's lines, and (cost, worst error) of every method."""
    samples = round(HORIZON / STEP) + 1
    t = np.arange(samples) * STEP
    checked = np.unique(np.geomspace(1, samples - 2, 60).astype(int))
    truth: dict[tuple[str, float], np.ndarray] = {}
    for name, (_, rate) in SIGNALS.items():
        for order in ORDERS:
            truth[name, order] = np.array([exact(rate, order, t[k]) for k in checked])
    head = ["method", *SIGNALS, "us a sample"]
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    points: dict[str, tuple[float, float]] = {}
    for name, method in (ours() | peers(quick)).items():
        cells, costs, worst = [], [], 0.0
        for signal, (function, rate) in SIGNALS.items():
            largest = 0.0
            for order in ORDERS:
                want = truth[signal, order]
                got, cost = method(function(t), rate(t), function, order, checked)
                error = np.abs(got[checked] - want) / np.abs(want).max()
                largest = max(largest, float(np.nanmax(error)))
                costs.append(cost)
            cells.append(f"{largest:.1e}")
            worst = max(worst, largest) if signal != "t^1.5" else worst
        points[name] = (min(costs), worst)
        lines.append(f"| {name} | " + " | ".join(cells) + f" | {1e6 * min(costs):.2f} |")
    return lines, points


def population_cost() -> list[str]:
    """Return the cost in a population, beside one `pin.aba` call of the two-link arm."""
    import pinocchio as pin

    arm = fp.Arm.two_link()
    model, data = arm.model, arm.model.createData()
    q = np.zeros(model.nv)
    aba, lines = [], []
    banks = {}
    rng = np.random.default_rng(0)
    for runs in (1, 60, 240):
        order = rng.uniform(0.05, 0.95, (2, runs, 2))
        bank = fr.Bank(fr.ExponentialSum(24), order, step=STEP, horizon=HORIZON)
        banks[runs] = (bank, *rng.normal(size=(2, *order.shape)), np.empty(order.shape))
    times: dict[int, list[float]] = {runs: [] for runs in banks}
    for _ in range(40):  # interleaved: a noisy machine is then equally noisy to all
        begin = time.perf_counter()
        for _ in range(500):
            pin.aba(model, data, q, q, q)
        aba.append((time.perf_counter() - begin) / 500)
        for runs, (bank, value, rate, out) in banks.items():
            begin = time.perf_counter()
            for _ in range(100):
                bank.update(value, rate, out)
            times[runs].append((time.perf_counter() - begin) / 100)
    lines.append(
        f"one pin.aba of the two-link arm: {1e9 * min(aba):.0f} ns"
        f" (median {1e9 * np.median(aba):.0f})"
    )
    for runs, taken in times.items():
        each = 1e9 * min(taken) / runs
        ratio = min(taken) / runs / min(aba)
        middle = 1e9 * float(np.median(taken)) / runs
        lines.append(
            f"{runs} runs, 2 joints, both terms, 24 modes: {each:.0f} ns a run and step"
            f" (median {middle:.0f}), {ratio:.2f} of an aba"
        )
    return lines


def fitting_cost() -> list[str]:
    """Return the time a fit takes, poles and 1,000 different orders."""
    lines = []
    orders = np.linspace(0.0, 1.0, 1000)
    for modes, horizon in ((24, 20.0), (32, 20.0), (40, 20.0), (24, 3600.0), (32, 3600.0)):
        design = fr.ExponentialSum(modes)
        fits, sets = [], []
        for _ in range(3):
            _table.cache_clear()
            begin = time.perf_counter()
            design.coefficients(0.5, step=STEP, horizon=horizon)
            fits.append(time.perf_counter() - begin)
            begin = time.perf_counter()
            design.coefficients(orders, step=STEP, horizon=horizon)
            sets.append(time.perf_counter() - begin)
        error = design.worst_error(step=STEP, horizon=horizon)
        lines.append(
            f"{modes} modes, {horizon:g} s: kernel within {error:.1e},"
            f" fit {1e3 * min(fits):.0f} ms, 1,000 orders {1e3 * min(sets):.0f} ms"
        )
    return lines


def draw(points: dict[str, tuple[float, float]], path: Path) -> None:
    """Draw worst error (smooth signals) against cost."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    axes = figure.subplots()
    for index, (name, (cost, error)) in enumerate(points.items()):
        own = name.startswith("fpid_pin")
        axes.loglog(1e6 * cost, error, "o" if own else "s", color="tab:blue" if own else "tab:red")
        axes.annotate(
            name.removeprefix("fpid_pin "),
            (1e6 * cost, error),
            xytext=(5, 4 if index % 2 else -9),
            textcoords="offset points",
            fontsize=7,
        )
    axes.margins(x=0.25, y=0.1)
    axes.set_xlabel("time a sample, one signal [us]")
    axes.set_ylabel("largest error of sin, exp and chirp [of the largest value]")
    axes.set_title("D^0.5 and D^0.9, 1 ms, 20 s; blue: fpid_pin, red: other packages")
    axes.grid(True, which="major", alpha=0.4)
    figure.savefig(path, dpi=150)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="leave out what takes minutes")
    parser.add_argument("--out", type=Path, help="folder for operators.md and operators.png")
    arguments = parser.parse_args()
    lines, points = accuracy_and_cost(arguments.quick)
    absent = [name for name in PEERS if not installed(name)]
    if absent:
        lines += ["", "not installed, not compared: " + ", ".join(absent)]
    lines += ["", *population_cost(), "", *fitting_cost()]
    text = "\n".join(lines)
    print(text)
    if arguments.out is not None:
        arguments.out.mkdir(parents=True, exist_ok=True)
        (arguments.out / "operators.md").write_text(text + "\n", encoding="utf-8")
        draw(points, arguments.out / "operators.png")


if __name__ == "__main__":
    main()

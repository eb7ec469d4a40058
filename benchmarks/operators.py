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
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from common import table
from scipy.special import gamma
from speed import aba_calls, turn_by_turn

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
SAMPLES = round(HORIZON / STEP) + 1
#: Where results are compared.
CHECKED = np.unique(np.geomspace(1, SAMPLES - 2, 60).astype(int))
Result = tuple[np.ndarray, float]
PEERS = ("pycaputo", "differint", "numfracpy", "fotf")


class Signal(NamedTuple):
    """A signal and its rate, sampled, the function itself, and the order of its derivative."""

    f: np.ndarray
    rates: np.ndarray
    function: Callable[[Any], Any]
    order: float

    def at(self, shifted: bool) -> Callable[[Any], Any]:
        """Return the function, or the one less its first value."""
        return lambda t: self.function(t) - (self.f[0] if shifted else 0.0)


Method = Callable[[Signal], Result]


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

    def run() -> np.ndarray:
        for k in range(f.size):
            bank.update(f[k], None if df is None else df[k], out[k, ...])
        return out

    return whole(run, f.size)


def whole(function: Callable[[], np.ndarray], samples: int) -> Result:
    """Return what a function of the whole record returns, and its time a sample [s]."""
    begin = time.perf_counter()
    out = function()
    return out, (time.perf_counter() - begin) / samples


def ours() -> dict[str, Method]:
    """Return our methods by name."""
    designs: list[tuple[str, fr.Design, bool]] = [
        ("24 modes", fr.ExponentialSum(24), True),
        ("32 modes", fr.ExponentialSum(32), True),
        ("40 modes", fr.ExponentialSum(40), True),
        ("32 modes, rate unknown", fr.ExponentialSum(32), False),
        ("CRONE N = 5", fr.Crone(1e-2, 1e3, 5), True),
        ("CRONE N = 10, 2 decades wider", fr.Crone(1e-2, 1e3, 10, 2.0), True),
    ]
    methods: dict[str, Method] = {
        name: lambda s, d=design, k=known: streamed(d, s.f, s.rates if k else None, s.order)
        for name, design, known in designs
    }
    recorded: dict[str, Callable[[Signal], np.ndarray]] = {
        "caputo(), recorded": lambda s: fr.caputo(s.f, s.order, STEP),
        "caputo(design=L1()), recorded": lambda s: fr.caputo(s.f, s.order, STEP, design=fr.L1()),
        "caputo(rate=), recorded": lambda s: fr.caputo(s.f, s.order, STEP, rate=s.rates),
        "grunwald_letnikov(), recorded": lambda s: fr.grunwald_letnikov(
            s.f - s.f[0], s.order, STEP
        ),
    }
    for name, function in recorded.items():
        methods[name] = lambda s, f=function: whole(lambda: f(s), s.f.size)
    return {f"fpid_pin {name}": method for name, method in methods.items()}


def peers(quick: bool) -> dict[str, Method]:
    """Return the methods of other packages that are installed.

    They are called as their documentation says, all for Caputo's derivative: those that know only
    Grünwald-Letnikov's are given f - f(0).
    """
    methods: dict[str, Method] = {}
    if installed("pycaputo") and not quick:
        from pycaputo.differentiation import caputo, diff
        from pycaputo.differentiation import grunwald_letnikov as pycaputo_gl
        from pycaputo.grid import make_uniform_points

        for name, kind, shifted in (
            ("pycaputo L1", caputo.L1, False), ("pycaputo GL", pycaputo_gl.GrunwaldLetnikov, True),
        ):  # fmt: skip

            def by_pycaputo(s: Signal, kind: Any = kind, shifted: bool = shifted) -> Result:
                points = make_uniform_points(s.f.size, a=0.0, b=HORIZON)
                given = s.at(shifted)
                return whole(lambda: diff(kind(s.order), given, points), s.f.size)

            methods[name] = by_pycaputo
    if installed("differint"):
        from differint import differint

        def by_differint(s: Signal) -> Result:
            # An even number of points: with an odd one it returns one value fewer.
            n = s.f.size - 1
            given = list(s.f[:n] - s.f[0])
            result, cost = whole(lambda: differint.GL(s.order, given, 0.0, (n - 1) * STEP, n), n)
            return np.append(result, np.nan), cost

        methods["differint GL"] = by_differint
    if installed("numfracpy"):
        import numfracpy

        # One point a call, each a loop over the past: a few points are enough to see.
        few = CHECKED[CHECKED < 2000][::6]
        for name, method, shifted in (
            ("numfracpy L1 (first 2 s)", numfracpy.Caputo_der1, False),
            ("numfracpy GL (first 2 s)", numfracpy.GLDer1, True),
        ):

            def by_numfracpy(s: Signal, method: Any = method, shifted: bool = shifted) -> Result:
                out, given = np.full(s.f.size, np.nan), s.at(shifted)

                def run() -> np.ndarray:
                    out[few] = [method(given, (k + 0.5) * STEP, STEP, s.order) for k in few]
                    return out

                return whole(run, few.size)

            methods[name] = by_numfracpy
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
    t = np.arange(SAMPLES) * STEP
    truth = {
        (name, order): np.array([exact(rate, order, t[k]) for k in CHECKED])
        for name, (_, rate) in SIGNALS.items()
        for order in ORDERS
    }
    rows, points = [], {}
    for name, method in (ours() | peers(quick)).items():
        costs, largest = [], dict.fromkeys(SIGNALS, 0.0)
        for (signal, order), want in truth.items():
            function, rate = SIGNALS[signal]
            got, cost = method(Signal(function(t), rate(t), function, order))
            error = np.abs(got[CHECKED] - want) / np.abs(want).max()
            largest[signal] = max(largest[signal], float(np.nanmax(error)))
            costs.append(cost)
        points[name] = (min(costs), max(x for key, x in largest.items() if key != "t^1.5"))
        rows.append([name, *(f"{x:.1e}" for x in largest.values()), f"{1e6 * min(costs):.2f}"])
    return table(["method", *SIGNALS, "us a sample"], rows), points


def population_cost() -> list[str]:
    """Return the cost in a population, beside one `pin.aba` call of the two-link arm."""
    rng, works = np.random.default_rng(0), {}
    for runs in (1, 60, 240):
        order = rng.uniform(0.05, 0.95, (2, runs, 2))
        bank = fr.Bank(fr.ExponentialSum(24), order, step=STEP, horizon=HORIZON)
        value, rate, out = *rng.normal(size=(2, *order.shape)), np.empty(order.shape)

        def many(b: Any = bank, value: Any = value, rate: Any = rate, out: Any = out) -> None:
            for _ in range(100):
                b.update(value, rate, out)

        works[runs] = many
    unit, *times = turn_by_turn([aba_calls(fp.Arm.two_link()), *works.values()], 40)
    lines = [f"one pin.aba of the two-link arm: {1e6 * unit:.0f} ns"]
    for runs, taken in zip(works, times, strict=True):
        lines.append(
            f"{runs} runs, 2 joints, both terms, 24 modes: {1e7 * taken / runs:.0f} ns a run and "
            f"step, {10.0 * taken / runs / unit:.2f} of an aba"
        )
    return lines


def fitting_cost() -> list[str]:
    """Return the time a fit takes, poles and 1,000 different orders."""
    lines, orders = [], np.linspace(0.0, 1.0, 1000)
    for modes, horizon in ((24, 20.0), (32, 20.0), (40, 20.0), (24, 3600.0), (32, 3600.0)):
        design = fr.ExponentialSum(modes)

        def fit(order: Any, design: Any = design, horizon: float = horizon) -> None:
            _table.cache_clear()
            design.coefficients(order, step=STEP, horizon=horizon)

        one, many = turn_by_turn([partial(fit, 0.5), partial(fit, orders)], 3)
        error = design.worst_error(step=STEP, horizon=horizon)
        lines.append(
            f"{modes} modes, {horizon:g} s: kernel within {error:.1e}, fit {1e3 * one:.0f} ms, "
            f"with 1,000 orders {1e3 * many:.0f} ms"
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
            name.removeprefix("fpid_pin "), (1e6 * cost, error), fontsize=7,
            xytext=(5, 4 if index % 2 else -9), textcoords="offset points",
        )  # fmt: skip
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

"""How good are the fractional operators, and what does the paper's own realisation do?

D^alpha for alpha = 0.5 and 0.9 of sin t, t^1.5, exp(-t) and a chirp from 0.5 to 4.5 Hz, sampled at
1 ms for 20 s: largest error at 60 times spread over the record, divided by the largest exact value
there. Cost: time a sample, one signal; ours also in a population, in units of one `pin.aba` call.
Other packages take part where they are installed (``pip install fpid_pin[peers]``).

Then section 5.1 with the published orders by Oustaloup's filter (CRONE) for several bands and N, of
which the paper gives neither, and by the default design with fewer and more modes, against the
operator itself: 40 modes, which are within 1e-11 rad of the kernel integrated over the whole past
(tests/simulation/test_independent_operator.py). The last row starts as a block at rest in Simulink
does: it sees the error jump to e(0).
"""

import dataclasses
import time
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
from common import Bench, aba_calls, panels, run, turn_by_turn
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
SAMPLES = round(HORIZON / STEP) + 1
#: Where results are compared.
CHECKED = np.unique(np.geomspace(1, SAMPLES - 2, 60).astype(int))
Result = tuple[np.ndarray, float]
PEERS = ("pycaputo", "differint")


class Signal(NamedTuple):
    """A signal and its rate, sampled, the function itself, and the order of its derivative."""

    f: np.ndarray
    rates: np.ndarray
    function: Callable[[Any], Any]
    order: float


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

    def bank(design: fr.Design, known: bool = True) -> Method:
        return lambda s: streamed(design, s.f, s.rates if known else None, s.order)

    def recorded(function: Callable[[Signal], np.ndarray]) -> Method:
        return lambda s: whole(lambda: function(s), s.f.size)

    methods = {
        "24 modes": bank(fr.ExponentialSum(24)),
        "32 modes": bank(fr.ExponentialSum(32)),
        "40 modes": bank(fr.ExponentialSum(40)),
        "32 modes, rate unknown": bank(fr.ExponentialSum(32), known=False),
        "CRONE N = 5": bank(fr.Crone(1e-2, 1e3, 5)),
        "CRONE N = 10, 2 decades wider": bank(fr.Crone(1e-2, 1e3, 10, 2.0)),
        "caputo(), recorded": recorded(lambda s: fr.caputo(s.f, s.order, STEP)),
        "caputo(design=L1()), recorded": recorded(
            lambda s: fr.caputo(s.f, s.order, STEP, design=fr.L1())
        ),
        "caputo(rate=), recorded": recorded(
            lambda s: fr.caputo(s.f, s.order, STEP, rate=s.rates)
        ),
        "grunwald_letnikov(), recorded": recorded(
            lambda s: fr.grunwald_letnikov(s.f - s.f[0], s.order, STEP)
        ),
    }  # fmt: skip
    return {f"fpid_pin {name}": method for name, method in methods.items()}


def peers(quick: bool) -> dict[str, Method]:
    """Return the methods of other packages that are installed.

    They are called as their documentation says, all for Caputo's derivative: those that know only
    Grünwald-Letnikov's are given f - f(0).
    """
    methods: dict[str, Method] = {}
    if find_spec("pycaputo") and not quick:
        from pycaputo.differentiation import caputo, diff
        from pycaputo.differentiation import grunwald_letnikov as pycaputo_gl
        from pycaputo.grid import make_uniform_points

        def by_pycaputo(s: Signal, kind: Any, first: float) -> Result:
            points = make_uniform_points(s.f.size, a=0.0, b=HORIZON)
            return whole(
                lambda: diff(kind(s.order), lambda t: s.function(t) - first, points), s.f.size
            )

        methods["pycaputo L1"] = lambda s: by_pycaputo(s, caputo.L1, 0.0)
        methods["pycaputo GL"] = lambda s: by_pycaputo(s, pycaputo_gl.GrunwaldLetnikov, s.f[0])
    if find_spec("differint"):
        from differint import differint

        def by_differint(s: Signal) -> Result:
            # An even number of points: with an odd one it returns one value fewer.
            n = s.f.size - 1
            given = list(s.f[:n] - s.f[0])
            result, cost = whole(lambda: differint.GL(s.order, given, 0.0, (n - 1) * STEP, n), n)
            return np.append(result, np.nan), cost

        methods["differint GL"] = by_differint
    return methods


def accuracy(bench: Bench) -> None:
    t = np.arange(SAMPLES) * STEP
    truth = {
        (name, order): np.array([exact(rate, order, t[k]) for k in CHECKED])
        for name, (_, rate) in SIGNALS.items()
        for order in ORDERS
    }
    rows, points = [], {}
    for name, method in (ours() | peers(bench.quick)).items():
        costs, largest = [], dict.fromkeys(SIGNALS, 0.0)
        for (signal, order), want in truth.items():
            function, rate = SIGNALS[signal]
            got, cost = method(Signal(function(t), rate(t), function, order))
            error = np.abs(got[CHECKED] - want) / np.abs(want).max()
            largest[signal] = max(largest[signal], float(np.nanmax(error)))
            costs.append(cost)
        points[name] = (min(costs), max(x for key, x in largest.items() if key != "t^1.5"))
        rows.append([name, *(f"{x:.1e}" for x in largest.values()), f"{1e6 * min(costs):.2f}"])
    cost, error = points["fpid_pin 24 modes"]
    others = [name for name in points if "fpid_pin" not in name or "CRONE" in name]
    best = min(others, key=lambda name: points[name][1])
    bench.say(
        f"24 modes, the default, are within {error:.1e} of the exact derivative of the smooth "
        f"signals, at {1e6 * cost:.0f} us a sample and in constant memory; the best of CRONE and "
        f"other packages, {best}, within {points[best][1]:.1e} at {1e6 * points[best][0]:.0f} us."
    )
    bench.table(["method", *SIGNALS, "us a sample"], rows)
    if absent := [name for name in PEERS if not find_spec(name)]:
        bench.say("Not installed, not compared: " + ", ".join(absent))
    bench.figure(drawn(points), "operators.png", "Error against cost of the operators")


def drawn(points: dict[str, tuple[float, float]]) -> Any:
    """Draw worst error (smooth signals) against cost."""
    figure, axes = panels((9.0, 6.0))
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
    return figure


def population(bench: Bench) -> None:
    """Print the cost in a population, beside one `pin.aba` call of the two-link arm."""
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
    told = ", ".join(
        f"of {runs}: {1e7 * taken / runs:.0f} ns, {10.0 * taken / runs / unit:.2f} of one `pin.aba`"
        for runs, taken in zip(works, times, strict=True)
    )
    bench.say(f"Two joints, both terms, 24 modes take, a run and step, in a population {told}.")


def fits(bench: Bench) -> None:
    """Print the time that a fit takes, poles and 1,000 different orders."""
    rows, orders = [], np.linspace(0.0, 1.0, 1000)
    for modes, horizon in ((24, 20.0), (32, 20.0), (40, 20.0), (24, 3600.0), (32, 3600.0)):
        design = fr.ExponentialSum(modes)

        def fit(order: Any, design: Any = design, horizon: float = horizon) -> None:
            _table.cache_clear()
            design.coefficients(order, step=STEP, horizon=horizon)

        times = turn_by_turn([partial(fit, 0.5), partial(fit, orders)], 1 if bench.quick else 3)
        error = design.worst_error(step=STEP, horizon=horizon)
        rows.append([modes, f"{horizon:g}", f"{error:.1e}", *(f"{1e3 * x:.0f}" for x in times)])
    heads = ["modes", "horizon [s]", "kernel within", "one order [ms]", "1,000 orders [ms]"]
    bench.say("What a fit takes:")
    bench.table(heads, rows)


def realisation(bench: Bench) -> None:
    experiment, paper = fp.paper_experiment(), fp.paper_controller()

    def simulated(design: fr.Design, start: str = "caputo") -> fp.Run:
        law = dataclasses.replace(paper, design=design, initialisation=start)
        return fp.simulate(experiment, law)

    bands = ((1e-2, 1e2), (1e-2, 1e3), (1e-3, 1e3), (1e-3, 1e4), (1e-4, 1e4))
    designs: list[tuple[str, int, fr.Design]] = [
        (f"CRONE, {low:g} to {high:g} rad/s, N = {n}", 2 * n + 1, fr.Crone(low, high, n))
        for low, high in (bands[1:2] if bench.quick else bands)
        for n in ((5,) if bench.quick else (2, 5, 10, 20))
    ]
    designs += [(f"{m} modes", m, fr.ExponentialSum(m)) for m in (12, 16, 24, 32)]
    runs = [(name, poles, simulated(design)) for name, poles, design in designs]
    at_rest = simulated(fr.Crone(1e-2, 1e3, 5), "grunwald_letnikov")
    runs.append(("CRONE, 0.01 to 1000 rad/s, N = 5, block at rest", 11, at_rest))
    exact, rows, late = simulated(fr.ExponentialSum(40)).q, [], {}
    for name, poles, seen in runs:
        gap = 1e3 * np.abs(seen.q - exact)
        late[name] = gap[len(gap) // 2 :].max()
        cost, peak = fp.costs.QuadraticCost().of(seen.metrics), np.abs(seen.torque).max()
        most = float(f"{gap.max():.2g}")
        rows.append([name, poles, f"{most:g}", f"{late[name]:.2g}", f"{cost:.4f}", f"{peak:.4g}"])
    crone = "CRONE, 0.01 to 1000 rad/s, N = 5"
    bench.say(
        "The paper's own realisation in its own experiment: difference of the joint angles from "
        f"those of the operator itself. {crone} is {late[crone]:.2g} mrad off in the last half, "
        f"as many modes {late['12 modes']:.2g}, the default {late['24 modes']:.2g}; a block at "
        f"rest kicks joint 2 with {np.abs(at_rest.torque).max():,.0f} N m."
    )
    heads = ["operator", "poles", "largest [mrad]", "last half [mrad]", "cost (33)", "peak [N m]"]
    bench.table(heads, rows)


if __name__ == "__main__":
    run(__doc__, accuracy, population, fits, realisation)

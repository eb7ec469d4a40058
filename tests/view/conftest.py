"""Runs made by formula, where what is seen matters and not what was simulated; and a browser."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from bounded import until
from robots import joint, link, robot, write

from fpid_pin import (
    AdaptiveFpid,
    Arm,
    Experiment,
    Run,
    paper_controller,
    simulate,
    suggest_gains,
)
from fpid_pin.references import Sinusoid
from fpid_pin.simulation import Outcome
from fpid_pin.simulation.recorded import describe_run

MakeRun = Callable[..., Run]


@pytest.fixture(scope="session")
def make_run() -> MakeRun:
    def make(
        arm: Arm,
        duration: float = 2.0,
        name: str = "wave",
        lag: float = 0.3,
        integer: bool = False,
        rows: int | None = None,
    ) -> Run:
        n, h = arm.n, 1e-3
        order = 1.0 if integer else 0.9
        law = AdaptiveFpid(
            10.0, 5.0, 3.0, integral_order=order, derivative_order=order, name=name,
            supervisor=paper_controller().supervisor if n == 2 else None,
        )  # fmt: skip
        job = Experiment(arm, Sinusoid(0.4, 1.5, offset=arm.home), duration=duration)
        t = np.arange(round(duration / h) + 1) * h
        q_ref = arm.home + 0.4 * np.sin(1.5 * t)[:, np.newaxis] * np.ones(n)
        q = arm.home + 0.4 * np.sin(1.5 * t - lag)[:, np.newaxis] * np.ones(n)
        v = 0.6 * np.cos(1.5 * t)[:, np.newaxis] * np.ones(n)
        u = 5.0 * np.cos(3.0 * t)[:, np.newaxis] * np.linspace(1.0, 2.0, n)
        gain = 10.0 + np.cumsum(np.abs(u), axis=0) * 1e-4
        signals = dict.fromkeys(("kp", "ki", "kd"), gain) | {
            "u_fpid": u, "u_s": np.zeros_like(u), "s": q_ref - q,
            "lyapunov": (q_ref - q)[:, 0] ** 2,
        }  # fmt: skip
        stop = len(t) if rows is None else rows
        outcome = Outcome(True, duration)
        if rows is not None:
            outcome = Outcome(False, rows * h, arm.joint_names[0], "speed 2e3 rad/s")
        return Run(
            t[:stop], q[:stop], v[:stop], q_ref[:stop], v[:stop], u[:stop],
            signals={k: x[:stop] for k, x in signals.items()}, outcome=outcome, step=h,
            planned_rows=len(t), meta=describe_run(job, law, "pinocchio") | {"name": name},
        )  # fmt: skip

    return make


@pytest.fixture(scope="session")
def two_link() -> Arm:
    return Arm.two_link()


@pytest.fixture(scope="session")
def wave(make_run: MakeRun, two_link: Arm) -> Run:
    return make_run(two_link)


#: A column that turns, a carriage that goes up it, a boom that comes out.
JOINTS = (("revolute", "0 0 1", 0.0), ("prismatic", "0 0 1", 0.3), ("prismatic", "1 0 1", 0.2))


@pytest.fixture(scope="session")
def scara(tmp_path_factory: pytest.TempPathFactory) -> Arm:
    limit = '<limit lower="-0.4" upper="0.6" effort="90" velocity="2"/>'
    parts = [link(f"l{k}", 1.0, 0.02) for k in range(4)]
    for k, (kind, axis, z) in enumerate(JOINTS):
        origin = f'0 0 {z}" rpy="0 0 {0.3 * (k + 1)}'
        parts.append(joint(f"j{k + 1}", f"l{k}", f"l{k + 1}", kind, limit, axis, origin))
    return Arm.from_urdf(write(tmp_path_factory.mktemp("scara"), robot(*parts)))


@pytest.fixture(scope="session")
def scara_run(scara: Arm) -> Run:
    reference = Sinusoid(amplitude=[0.3, 0.2, 0.2], frequency=3.0, phase=[0, 1, 2])
    return simulate(Experiment(scara, reference, duration=0.2), suggest_gains(scara))


@pytest.fixture(scope="session")
def visit(browser: Any) -> Callable[..., Any]:
    """Return what opens a page for the length of a block.

    At its end nothing may have gone wrong in it (unless `sound` is false), and it must have asked
    for nothing but itself. Pages are small: software draws them.
    """

    @contextmanager
    def visit(
        address: str, ready: str = "window.fpidPin !== undefined",
        size: tuple[int, int] = (420, 300), sound: bool = True, **options: Any,
    ) -> Iterator[Any]:  # fmt: skip
        page = browser.new_page(viewport={"width": size[0], "height": size[1]}, **options)
        asked: list[str] = []
        errors: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on("console", lambda said: errors.extend([said.text] * (said.type == "error")))
        try:
            page.goto(address)
            until(page, ready)
            yield page
        finally:
            page.close()
        assert errors == [] or not sound
        own = (address.partition("#")[0], "blob:", "data:")
        assert [url for url in asked if not url.startswith(own)] == []

    return visit

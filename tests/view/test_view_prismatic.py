"""An arm that slides, as a page and a still picture show it."""

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.arms import Arm
from fpid_pin.simulation import Comparison
from fpid_pin.view import export_html, plots
from fpid_pin.view.portrait import portrait
from fpid_pin.view.shapes import solid_surface

#: A column that turns, a carriage that goes up it, a boom that comes out.
JOINTS = (("revolute", "0 0 1", 0.0), ("prismatic", "0 0 1", 0.3), ("prismatic", "1 0 1", 0.2))


@pytest.fixture(scope="module")
def scara(tmp_path_factory):
    text = '<robot name="column"><link name="l0"/>'
    for k, (kind, axis, z) in enumerate(JOINTS, start=1):
        text += (
            f'<link name="l{k}"><inertial><mass value="1"/><inertia ixx="0.02" iyy="0.02" '
            'izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="j{k}" type="{kind}"><parent link="l{k - 1}"/><child link="l{k}"/>'
            f'<origin xyz="0 0 {z}" rpy="0 0 {0.3 * k}"/><axis xyz="{axis}"/>'
            '<limit lower="-0.4" upper="0.6" effort="90" velocity="2"/></joint>'
        )
    path = tmp_path_factory.mktemp("scara") / "column.urdf"
    path.write_text(f"{text}</robot>", encoding="utf-8")
    return Arm.from_urdf(path)


@pytest.fixture(scope="module")
def run(scara):
    reference = fp.references.Sinusoid(amplitude=[0.3, 0.2, 0.2], frequency=3.0, phase=[0, 1, 2])
    return fp.simulate(fp.Experiment(scara, reference, duration=0.2), fp.suggest_gains(scara))


@pytest.mark.browser
def test_a_page_moves_it_as_pinocchio_does(visit, run, tmp_path):
    file = export_html(run, tmp_path / "run.html")
    with visit(f"{file.as_uri()}#t=0.1") as page:
        page.evaluate("fpidPin.seek(0.1)")
        page.evaluate(
            "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
        )
        view, q = "fpidPin.views[0].arm", run.q[100]
        at = page.evaluate(f"{view}.turns.map(([turn]) => turn.position.length())")
        assert at == pytest.approx([0.0, abs(q[1]), abs(q[2])], abs=1e-4)
        tool = page.evaluate(f"{view}.tool({q.tolist()}).toArray()")
        assert tool == pytest.approx(run.arm.tool_pose(q)[:3, 3], abs=1e-6)
        assert page.evaluate("fpidPin.views[0].arcs.length") == 3


def test_a_portrait_has_every_joint_and_a_scale(scara):
    (axes,) = portrait(scara).axes
    texts = [text.get_text() for text in axes.texts]
    assert texts[:3] == ["1", "2", "3"]
    assert texts[3].endswith(" m")
    dashes = [line.get_linestyle() for line in axes.lines[:3]]
    assert dashes == ["--", "-", "-"]


def test_a_portrait_is_of_the_pose_that_is_asked_for(scara):
    def top(q):
        (axes,) = portrait(scara, q).axes
        corners = np.concatenate([path.vertices for path in axes.collections[0].get_paths()])
        return corners.max(axis=0)

    low, high = top([0.0, -0.3, 0.0]), top([0.0, 0.5, 0.0])
    assert high[1] > low[1] + 0.5
    with pytest.raises(fp.FpidError, match=r"q: expected shape \(3,\)"):
        portrait(scara, [0.0])


VOLUMES = [
    ("box", (1.0, 2.0, 3.0), 6.0),
    ("sphere", (1.0,), 4.0 / 3.0 * np.pi),
    ("cylinder", (1.0, 2.0), 2.0 * np.pi),
    ("capsule", (1.0, 2.0), 2.0 * np.pi + 4.0 / 3.0 * np.pi),
    ("cone", (1.0, 3.0), np.pi),
    ("ellipsoid", (1.0, 2.0, 3.0), 8.0 * np.pi),
]


def test_solids_are_closed_and_as_large_as_they_should_be():
    """Their volume by pyramids from the centre; round ones are a little smaller, being edged."""
    for kind, size, volume in VOLUMES:
        vertices, triangles = solid_surface(kind, size)
        # Every triangle is seen from outside with its corners anticlockwise.
        pyramids = np.linalg.det(vertices[triangles]) / 6.0
        assert (pyramids > -1e-12).all(), kind
        assert pyramids.sum() == pytest.approx(volume, rel=1e-9 if kind == "box" else 0.05), kind


def labels(figure):
    return [axes.get_ylabel() for axes in figure.axes]


def test_figures_and_tables_say_metres_and_newtons(run):
    assert labels(plots.tracking(run)) == ["angle, rad", "position, m", "position, m"]
    assert labels(plots.error(run)) == ["$q_d - q$, rad", "$q_d - q$, m", "$q_d - q$, m"]
    assert labels(plots.torque(run)) == ["torque, N m", "force, N", "force, N"]
    assert labels(plots.phase_plane(run))[:2] == ["$\\dot e$, rad/s", "$\\dot e$, m/s"]
    assert labels(plots.comparison([run]))[2:4] == ["$q_d - q$, m", "force, N"]
    together = labels(plots.plot(run))[:3]
    assert together == ["position, rad, m", "$q_d - q$, rad, m", "torque, N m, N"]
    rows = Comparison(("nominal",), ("law",), (run,)).joint_rows()
    assert [row["joint"] for row in rows] == ["j1", "j2 [m, N]", "j3 [m, N]"]

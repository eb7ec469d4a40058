"""A replay as a table of plain values, and as the file that holds it."""

import base64
import warnings

import numpy as np
import pytest
from bounded import FULL
from robots import joint, link, robot, write

from fpid_pin import Arm, FpidWarning, Run
from fpid_pin.arms import names
from fpid_pin.cli.commands import view
from fpid_pin.exceptions import ArgumentError, FpidError
from fpid_pin.view import export_html
from fpid_pin.view.replay import replay_scene, to_script_json
from fpid_pin.view.shapes import portrait, shapes_of, solid_surface, stage
from fpid_pin.view.style import captions_of

MESH = '<visual><geometry><mesh filename="package://nowhere/{}.stl"/></geometry></visual>'
NO_MESHES = robot(
    link("a"), *(link(x, visual=MESH.format(x), com="0.2 0 0") for x in "bc"),
    joint("one", "a", "b"), joint("two", "b", "c", origin="0.5 0 0"),
)  # fmt: skip


def decode(scene, number):
    entry = scene["buffers"][number]
    kind = {"f4": "<f4", "u2": "<u2", "u4": "<u4"}[entry["type"]]
    return np.frombuffer(base64.b64decode(entry["data"]), dtype=kind)


def test_frames_are_samples_of_the_run_its_last_among_them(wave):
    whole = replay_scene([wave], fps=30.0)
    scene = whole["groups"][0]["runs"][0]
    t = decode(whole, scene["t"])
    assert (t[0], t[-1]) == (0.0, wave.t[-1])
    assert 1.0 / np.diff(t)[:-1] == pytest.approx(30.0, rel=0.02)
    rows = np.rint(t / wave.step).astype(int)
    for name in ("q", "q_ref", "torque"):
        assert decode(whole, scene[name]) == pytest.approx(getattr(wave, name)[rows].ravel())


def test_meshes_keep_their_shape_to_a_hundredth_of_a_millimetre(make_run):
    arm = Arm.from_example("xarm7")
    scene = replay_scene([make_run(arm)], fps=10)
    for shape, table in zip(shapes_of(arm), scene["arms"][0]["shapes"], strict=True):
        vertices = decode(scene, table["vertices"]).reshape(-1, 3) * table["scale"] + table["low"]
        assert np.abs(vertices - shape.vertices).max() < 1e-5
        assert np.array_equal(decode(scene, table["triangles"]), shape.triangles.ravel())


@pytest.mark.parametrize("name", [1, 3, *(names() if FULL else ["kinova", "so100", "talos_arm"])])
def test_planar_arms_and_every_arm_of_the_catalogue_are_drawn_whole(name):
    planar = isinstance(name, int)
    arm = Arm.planar(np.full(name, 0.4), np.ones(name)) if planar else Arm.from_example(name)
    assert stage([arm], [arm.home[np.newaxis]]).planar >= planar
    _, geometry = arm.visual()
    shapes = shapes_of(arm)
    assert len(shapes) >= len(geometry.geometryObjects)
    assert {s.joint for s in shapes} >= set(range(arm.n))
    for shape in shapes:
        assert all(0.0 <= c <= 1.0 for c in shape.colour)
        assert np.allclose(shape.placement[:3, :3].T @ shape.placement[:3, :3], np.eye(3))


def test_an_arm_without_its_meshes_is_drawn_from_primitives(tmp_path):
    arm = Arm.from_urdf(write(tmp_path, NO_MESHES))
    with pytest.warns(FpidWarning, match="2 mesh file"):
        shapes = shapes_of(arm)
    assert {s.joint for s in shapes} == {0, 1}
    link = max((s for s in shapes if s.joint == 0), key=lambda s: np.ptp(s.vertices[:, 2]))
    assert np.ptp(link.vertices[:, 2]) == pytest.approx(0.5)
    assert np.allclose(link.placement[:3, 3], (0.25, 0.0, 0.0))


def test_equal_arms_are_described_once(make_run):
    runs = [make_run(Arm.from_example("ur5"), name=name) for name in ("a", "b")]
    one, two = replay_scene(runs[:1], fps=10), replay_scene(runs, fps=10)
    assert len(two["arms"]) == 1
    assert len(to_script_json(two)) < 1.05 * len(to_script_json(one))


def test_arms_stand_side_by_side_without_touching(make_run, two_link):
    motions = [make_run(two_link).q] * 3
    place = stage([two_link] * 3, motions)
    gaps = np.diff(place.offsets[:, 0])
    assert (gaps > 1.8).all()
    assert abs(place.offsets.sum()) < 1e-12
    assert place.floor < -0.5
    assert place.towards[1] < -0.9


def test_captions_are_told_apart(wave):
    assert captions_of([wave, wave], None) == ["wave (1)", "wave (2)"]
    with pytest.raises(ArgumentError, match=r"captions: expected 2 \(one a run\), got 1"):
        captions_of([wave, wave], ["only"])


def test_view_writes_a_page_of_several_files(make_run, two_link, tmp_path, capsys):
    files = [make_run(two_link, name=n).save(tmp_path / f"{n}.npz") for n in ("a", "b")]
    view(files, html=tmp_path / "out.html", caption=["left", "right"])
    text = (tmp_path / "out.html").read_text()
    assert "left / right" in text
    assert "opens in any browser" in capsys.readouterr().out


def test_bad_input_is_named(wave, make_run, two_link):
    with pytest.raises(ArgumentError, match="fps: expected a number in"):
        replay_scene([wave], fps=0.0)
    with pytest.raises(ArgumentError, match="runs: expected at least one run"):
        replay_scene([])
    with pytest.raises(ArgumentError, match="run: expected at least one sample"):
        replay_scene([make_run(two_link, rows=0)])


def test_a_run_of_one_sample_can_be_shown(make_run, two_link):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = replay_scene([make_run(two_link, rows=1)])
    assert scene["groups"][0]["duration"] == 0.0
    assert scene["groups"][0]["runs"][0]["outcome"].startswith("diverged at")


@pytest.mark.parametrize(("name", "most"), [("two_link", 1.5e6), ("ur5", 6e6)])
def test_twenty_seconds_make_a_page_within_the_budget(make_run, two_link, tmp_path, name, most):
    arm = two_link if name == "two_link" else Arm.from_example(name)
    make_run(arm, duration=20.0).save(tmp_path / "run.npz")
    path = export_html(Run.load(tmp_path / "run.npz"), tmp_path / "run.html")
    assert path.stat().st_size < most


def test_the_same_run_gives_the_same_page_with_the_names_of_those_whose_work_is_in_it(
    make_run, tmp_path
):
    run = make_run(Arm.from_example("asr_twodof"))
    one, two = (export_html(run, tmp_path / f"{k}.html").read_bytes() for k in "ab")
    assert one == two
    for credit in (b"Three.js Authors", b"qbmove"):
        assert credit in one


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
    with pytest.raises(FpidError, match=r"q: expected shape \(3,\)"):
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

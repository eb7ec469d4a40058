import pytest

from fpid_pin import Arm, Run
from fpid_pin.exceptions import ArgumentError, FileFormatError
from fpid_pin.view import export_html


@pytest.mark.parametrize(("name", "megabytes"), [("two_link", 1.5), ("ur5", 6.0)])
def test_twenty_seconds_make_a_page_within_the_budget(make_run, tmp_path, name, megabytes):
    make = Arm.two_link if name == "two_link" else (lambda: Arm.from_example(name))
    make_run(make(), duration=20.0).save(tmp_path / "run.npz")
    path = export_html(Run.load(tmp_path / "run.npz"), tmp_path / "run.html")
    assert path.stat().st_size < megabytes * 1e6


def test_credits_of_embedded_meshes_are_in_the_page(make_run, tmp_path):
    arm = Arm.from_example("asr_twodof")
    text = export_html(make_run(arm), tmp_path / "run.html").read_text()
    assert "qbmove" in text


def test_a_failed_export_leaves_what_was_there(wave, tmp_path):
    path = tmp_path / "run.html"
    path.write_text("before")
    with pytest.raises(ArgumentError):
        export_html(wave, path, captions=["a", "b"])
    assert path.read_text() == "before"
    with pytest.raises(FileFormatError, match="cannot be written"):
        export_html(wave, path / "below.html")
    assert [file.name for file in tmp_path.iterdir()] == ["run.html"]


def test_the_same_run_gives_the_same_page(wave, tmp_path):
    one, two = (export_html(wave, tmp_path / f"{k}.html").read_bytes() for k in "ab")
    assert one == two
    assert b"Three.js Authors" in one

import pytest

from fpid_pin.cli.commands import live, view
from fpid_pin.cli.configuration import demo_config
from fpid_pin.exceptions import ArgumentError, ConfigError, FileFormatError


def test_view_writes_a_page_of_several_files(make_run, two_link, tmp_path, capsys):
    files = [make_run(two_link, name=n).save(tmp_path / f"{n}.npz") for n in ("a", "b")]
    view(files, html=tmp_path / "out.html", caption=["left", "right"])
    text = (tmp_path / "out.html").read_text()
    assert "left / right" in text
    assert "opens in any browser" in capsys.readouterr().out


def test_view_names_what_is_wrong_with_a_file_and_with_captions(wave, tmp_path):
    (tmp_path / "text.npz").write_text("not a run")
    with pytest.raises(FileFormatError, match="expected a run file"):
        view([tmp_path / "text.npz"], html=tmp_path / "out.html")
    with pytest.raises(ArgumentError, match="captions"):
        view([wave.save(tmp_path / "run.npz")], html=tmp_path / "out.html", caption=["a", "b"])
    assert not (tmp_path / "out.html").exists()


@pytest.fixture
def config(tmp_path):
    path = tmp_path / "job.toml"
    path.write_text(demo_config().text)
    return path


def test_live_prints_lateness_with_and_without_the_view(config, capsys):
    live(config, duration=0.5, baseline=0.3, browser=False)
    text = capsys.readouterr().out
    for words in ("without the view: 300 ticks", "with the view:    500 ticks", "frames sent"):
        assert words in text
    assert text.count("99.9th percentile") == 2
    assert text.count("deadlines missed") == 2


def test_live_names_a_controller_that_is_not_there(config):
    with pytest.raises(ConfigError, match="--controller: expected one of .*, got 'two'"):
        live(config, controller="two")

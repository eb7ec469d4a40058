"""Files appear whole or not at all, as readable as any other."""

import os

import pytest

from fpid_pin.cli.output import OutputFolder
from fpid_pin.exceptions import FileFormatError
from fpid_pin.files import replacing


def write(path, text):
    with replacing(path) as temporary:
        temporary.write_text(text)


def test_a_file_is_replaced_at_the_end_of_the_block(tmp_path):
    path = tmp_path / "deep" / "file.txt"
    write(path, "old")
    with replacing(path) as temporary:
        temporary.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert [p.name for p in path.parent.iterdir()] == ["file.txt"]


def test_an_error_in_the_block_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "file.txt"
    write(path, "old")
    with pytest.raises(TypeError), replacing(path) as temporary:
        # Fails once the temporary file is there.
        temporary.write_text(None)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["file.txt"]


@pytest.mark.parametrize("name", ["folder", "."])
def test_a_folder_is_not_replaced_and_nothing_is_left_beside_it(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    with pytest.raises(FileFormatError, match="cannot be written"):
        write(name, "text")
    assert [p.name for p in tmp_path.iterdir()] == ["folder"]


def test_results_are_as_readable_as_other_files_and_nobody_sets_the_umask(tmp_path, monkeypatch):
    # For all threads of the process, even if only for a moment.
    monkeypatch.setattr(os, "umask", lambda mask: pytest.fail("the umask was set"))
    plain, plain_folder = tmp_path / "plain.txt", tmp_path / "plain"
    plain.write_text("")
    plain_folder.mkdir()
    write(tmp_path / "file.txt", "")
    with OutputFolder(tmp_path / "folder"):
        pass
    assert (tmp_path / "file.txt").stat().st_mode == plain.stat().st_mode
    assert (tmp_path / "folder").stat().st_mode == plain_folder.stat().st_mode


def test_a_private_umask_keeps_results_private(tmp_path):
    before = os.umask(0o077)
    try:
        write(tmp_path / "file.txt", "")
        with OutputFolder(tmp_path / "folder"):
            pass
    finally:
        os.umask(before)
    assert (tmp_path / "file.txt").stat().st_mode & 0o777 == 0o600
    assert (tmp_path / "folder").stat().st_mode & 0o777 == 0o700

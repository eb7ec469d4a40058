"""Files of arrays and a table: read as they were written, or refused in one line."""

import json
import os
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of

from fpid_pin import npz
from fpid_pin.exceptions import ArgumentError, FileFormatError, FpidError

ARRAYS = {
    "numbers": np.sin(np.arange(12.0).reshape(3, 4)),
    "counts": np.arange(5),
    "texts": np.array(["a", "λ and μ", ""]),
    "θ one": np.zeros((0, 3)),
    "single": np.array(-0.0),
}
TABLE = {"step": 1e-3, "limits": [float("inf"), 1], "inf": "inf", "deep": {"none": None}}


def written(path, arrays=ARRAYS, kind="thing", **options):
    npz.write(path, kind, TABLE, arrays, **options)
    return path


def same(found, arrays):
    assert found.keys() == arrays.keys()
    for name, array in arrays.items():
        assert found[name].dtype == array.dtype
        assert found[name].shape == array.shape
        assert found[name].tobytes() == array.tobytes()


def test_what_is_written_is_read_by_us_and_by_numpy_and_is_twice_the_same_bytes(tmp_path):
    path = written(tmp_path / "file")
    arrays, table = npz.read(path, "thing")
    assert table == TABLE
    same(arrays, ARRAYS)
    assert written(tmp_path / "again").read_bytes() == path.read_bytes()
    with np.load(path, allow_pickle=False) as file:
        assert json.loads(str(file["meta"]))["step"] == 1e-3
        same({name: file[name] for name in ARRAYS}, ARRAYS)


@given(
    arrays_of.arrays(
        np.uint64, arrays_of.array_shapes(max_dims=2, min_side=0, max_side=30),
        elements=st.integers(0, 2**64 - 1),
    )
)  # fmt: skip
def test_any_bits_come_back_packed_nan_s_and_zeros_signs_among_them(bits):
    array = bits.view(np.float64)
    same({"x": npz._unpacked(npz._packed(array), array.shape)}, {"x": array})


def test_without_pcodec_one_line_says_what_to_install(tmp_path, monkeypatch):
    small = written(tmp_path / "small", {"x": np.zeros(9)}, compressed=True)
    monkeypatch.setitem(sys.modules, "pcodec", None)
    line = (
        rf"^{small}: pcodec: expected it to be installed \(pip install 'fpid_pin\[compressed\]'\)"
    )
    with pytest.raises(FpidError, match=line):
        npz.read(small, "thing")


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"x": np.zeros(2, complex)}, "x: expected numbers or texts, got complex128"),
        ({"x": np.array([object()])}, "x: expected numbers or texts, got object"),
        ({"../x": np.zeros(2)}, "arrays: expected names that a file can have"),
        ({"a\0b": np.zeros(2)}, "arrays: expected names that a file can have"),
        ({"meta": np.zeros(2)}, "arrays: expected names that a file can have"),
    ],
)
def test_what_could_not_be_read_is_not_written(tmp_path, arrays, message):
    with pytest.raises(ArgumentError, match=message):
        written(tmp_path / "file", arrays)
    assert list(tmp_path.iterdir()) == []


class Evil:
    """Would make a folder where it was unpickled."""

    def __reduce__(self):
        return os.mkdir, ("owned",)


def other_files():
    """Make files that are none of ours, in the working folder, and return what is said of each."""
    os.mkfifo("fifo")
    written("other", kind="stone")
    np.savez("plain.npz", x=np.zeros(2))
    np.savez("pickle.npz", x=np.array([Evil()], dtype=object))
    for name, data in {"empty": b"", "text": b"not a zip", "zip": b"PK\x03\x04 cut"}.items():
        with open(name, "wb") as file:
            file.write(data)
    return {
        "none": "none: no such file",
        "a\0b": "no such file",
        ".": "expected a thing, got no file",
        "/dev/zero": "expected a thing, got no file",
        "fifo": "expected a thing, got no file",
        "other": "other: expected a thing, got a stone",
        "plain.npz": "expected a thing, got a zip without a table and its checksum",
        "pickle.npz": "expected a thing, got another file or a damaged one",
        "empty": "expected a thing, got another file or a damaged one",
        "text": "expected a thing, got another file or a damaged one",
        "zip": "expected a thing, got another file or a damaged one",
    }


def test_other_files_are_told_in_one_line_and_nothing_is_unpickled(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, message in other_files().items():
        with pytest.raises(FileFormatError, match=message) as caught:
            npz.read(name, "thing")
        assert "\n" not in str(caught.value)
    assert not (tmp_path / "owned").exists()


def test_another_format_is_told_by_its_number(tmp_path, monkeypatch):
    monkeypatch.setattr(npz, "FORMAT", 7)
    path = written(tmp_path / "file")
    monkeypatch.undo()
    with pytest.raises(FileFormatError, match="file: expected a thing of format 4, got format 7"):
        npz.read(path, "thing")

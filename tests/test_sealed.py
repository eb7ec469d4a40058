"""A sealed file is a zip that others can read, and one that knows what it holds."""

import io
import zipfile

import numpy as np
import pytest
from bounded import finished
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of

from fpid_pin import archive, sealed
from fpid_pin.exceptions import ArgumentError, FileFormatError, TuningError

ARRAYS = {
    "numbers": np.arange(12.0).reshape(3, 4),
    "counts": np.arange(5),
    "texts": np.array(["a", "λ and μ", ""]),
    "θ one": np.zeros((0, 3)),
    "single": np.array(-0.0),
}


def written(path, arrays=ARRAYS, text="a text", kind="thing", number=7):
    with open(path, "wb") as file:
        sealed.write(file, kind, number, text, arrays)
    return path


def read(path, kind="thing", number=7, expect=lambda text, members: text):
    return sealed.read(path, kind, (number,), expect)


def test_what_is_written_is_read_and_twice_the_same_bytes(tmp_path):
    path = written(tmp_path / "file")
    arrays, text = read(path)
    assert text == "a text"
    assert list(arrays) == list(ARRAYS)
    for name, array in ARRAYS.items():
        assert arrays[name].dtype == array.dtype
        assert arrays[name].shape == array.shape
        assert arrays[name].tobytes() == array.tobytes()
    assert written(tmp_path / "again").read_bytes() == path.read_bytes()


@given(
    st.dictionaries(
        st.text(st.sampled_from("aλ _."), min_size=1, max_size=5).filter(lambda s: s != "meta"),
        arrays_of.arrays(np.float64, arrays_of.array_shapes(min_dims=0, max_dims=4, min_side=0))
        | arrays_of.arrays(np.uint8, arrays_of.array_shapes(max_dims=2))
        | arrays_of.arrays(np.int64, arrays_of.array_shapes(max_dims=3))
        | arrays_of.arrays("U5", arrays_of.array_shapes(max_dims=2)),
        max_size=4,
    ),
    st.text(min_size=1, max_size=30).filter(lambda text: not text.endswith("\0")),
)
def test_numpy_reads_the_same(tmp_path_factory, arrays, text):
    path = written(tmp_path_factory.mktemp("sealed") / "file", arrays, text)
    back, said = read(path)
    assert said == text
    with np.load(path, allow_pickle=False) as file:
        assert str(file["meta"]) == text
        assert set(file.files) == {"members", "meta", *arrays}
        for name, array in arrays.items():
            assert file[name].tobytes() == back[name].tobytes() == array.tobytes()
            assert file[name].shape == back[name].shape == array.shape


@pytest.mark.parametrize("wide", [False, True])
def test_zip_tools_find_it_sound(tmp_path, monkeypatch, wide):
    """Files beyond 4 GiB have 64-bit sizes, which zip tools must read as well."""
    if wide:
        monkeypatch.setattr(archive, "NARROW", 100)
    path = written(tmp_path / "file")
    assert (b"PK\x06\x06" in path.read_bytes()) == wide
    with zipfile.ZipFile(path) as zipped:
        assert zipped.testzip() is None
        assert [entry.filename for entry in zipped.infolist()] == [
            "members.npy", "meta.npy", *(f"{name}.npy" for name in ARRAYS)
        ]  # fmt: skip
        for entry in zipped.infolist():
            assert np.lib.format.read_magic(io.BytesIO(zipped.read(entry))) == (1, 0)
    arrays, _ = read(path)
    assert (arrays["numbers"] == ARRAYS["numbers"]).all()


def test_what_expects_sees_the_list_before_an_array_is_read(tmp_path, monkeypatch):
    path = written(tmp_path / "file")
    seen, content = [], sealed._content

    def watched(file, member):
        seen.append(member.name)
        return content(file, member)

    monkeypatch.setattr(sealed, "_content", watched)

    def expect(text, members):
        seen.append({name: (m.dtype, m.shape) for name, m in members.items()})
        raise ArgumentError("numbers", "more", "less")

    with pytest.raises(FileFormatError) as caught:
        read(path, expect=expect)
    assert str(caught.value) == f"{path}: numbers: expected more, got less"
    assert seen[0] == "meta"
    assert seen[1]["numbers"] == ("<f8", (3, 4))
    assert len(seen) == 2


def test_another_kind_of_error_goes_as_it_comes(tmp_path):
    def expect(text, members):
        raise TuningError("of another search")

    with pytest.raises(TuningError, match="^of another search$"):
        read(written(tmp_path / "file"), expect=expect)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"x": np.zeros(2, complex)}, "x: expected float64, int64, bytes or texts"),
        ({"x": np.zeros(2, np.uint16)}, "x: expected float64, int64, bytes or texts"),
        ({"x": np.array([object()])}, "x: expected float64, int64, bytes or texts"),
        ({"x": np.zeros((1,) * 5)}, "in 4 dimensions at most, got float64 in 5"),
        ({"../x": np.zeros(2)}, "a name for a file in a zip"),
        ({"a\nb": np.zeros(2)}, "a name for a file in a zip"),
        ({"members": np.zeros(2)}, "a name for a file in a zip"),
        ({"": np.zeros(2)}, "a name for a file in a zip"),
        ({"x" * 101: np.zeros(2)}, "a name for a file in a zip"),
        ({f"x{k}": np.zeros(1) for k in range(12_000)}, "a list of up to 1048576 bytes"),
    ],
)
def test_what_could_not_be_read_is_not_written(arrays, message):
    file = io.BytesIO()
    with pytest.raises(ArgumentError, match=message):
        sealed.write(file, "thing", 7, "text", arrays)
    assert file.getvalue() == b""


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("none", "none: no such file"),
        ("a\0b", "no such file"),
        (".", "expected a thing, got a folder"),
        ("/dev/zero", "expected a thing, got a FIFO or a device"),
        ("fifo", "expected a thing, got a FIFO or a device"),
        ("other", "expected a thing, got a stone"),
        ("newer", "expected a thing, got one of format 8; format 7 is known"),
        ("empty", "something else or one that is cut short"),
        ("repacked", "a zip without a list of its members: one of format 1, or repacked"),
        ("longer", "one that is cut short, or of another size than its list says"),
    ],
)
def test_what_is_none_is_told_in_one_line_and_soon(tmp_path, monkeypatch, path, message):
    monkeypatch.chdir(tmp_path)
    if path == "fifo":
        finished(["mkfifo", path], check=True)
    written("other", kind="stone")
    written("newer", number=8)
    open("empty", "wb").close()
    np.savez("repacked.npz", meta=np.array("x"))
    (tmp_path / "repacked.npz").rename("repacked")
    written("longer")
    with open("longer", "ab") as file:
        file.write(b"x")
    with pytest.raises(FileFormatError, match=message):
        read(path)

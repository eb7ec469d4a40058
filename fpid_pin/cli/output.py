"""Folders of results that appear whole or not at all, power loss included, and names in them."""

import errno
import os
import re
import shutil
import unicodedata
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from fpid_pin import files
from fpid_pin.exceptions import FileFormatError

#: The file that says that a folder is ours to replace, and lists what in it is ours.
MARK = ".fpid_pin"
_HEAD = "made by fpid-pin; what is listed here is replaced, all else is kept\n"
#: Bytes of a name; file systems give it 255, and some are for numbers and endings.
_MOST_BYTES = 220
#: What a write is refused with; such an error names no file.
_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS)


def results_path(config: str | Path, ending: str = "") -> Path:
    """Return where results go that were not told where: ``runs`` and the configuration's name.

    What lies in a folder of results has the name of any other's; the folder's name is before it.
    """
    path = Path(config)
    folder = f"{path.resolve().parent.name}-" * (path.parent / MARK).is_file()
    return Path("runs") / f"{folder}{path.stem}{ending}"


@contextmanager
def output_folder(path: str | Path) -> Iterator[Path]:
    """Give a temporary folder that takes the place of `path` when the block ends without an error.

    An older folder of results there is replaced, what is a user's own within it is carried over;
    anything else is refused, before the block. Until it ends nobody else may write there.
    """
    path = Path(path)
    temporary: Path | None = None
    try:
        _require_ours(path)
        with files.locked(path):
            _restore(path)
            with files.hidden_folder(path) as hidden:
                temporary = hidden / "new"
                temporary.mkdir()
                yield temporary
                _sign(temporary)
                _carry_over(path, temporary)
                files.sync_tree(temporary)
                _require_ours(path)
                _put(temporary, path)
    except OSError as error:
        raise _refused(path, error, temporary) from None


def _refused(path: Path, error: OSError, temporary: Path | None) -> Exception:
    """Say what the system refused: `path`, a file that the error names, or neither."""
    name = None if error.filename is None else os.fsdecode(error.filename)
    if name is None:
        return files.unwritable(path, error) if temporary is None or error.errno in _DISK else error
    within = temporary is None or Path(name).is_relative_to(temporary)
    return files.unwritable(path, error) if within else FileFormatError(f"{name}: {error.strerror}")


def _require_ours(path: Path) -> None:
    """Refuse a place that is not free, and not a folder of ours that can be moved."""
    kind = files.kind_of(path)
    if kind is None:
        return
    if kind == "a folder":
        place = path.resolve()
        if Path.cwd().resolve().is_relative_to(place):
            kind = "the working folder or one above it"
        elif os.path.ismount(path):
            kind = "a mount point"
        elif (path / MARK).is_file() or not any(path.iterdir()):
            return
        else:
            kind = "another folder"
    raise FileFormatError(f"{path}: expected a new folder or one that fpid-pin made, got {kind}")


def _sign(folder: Path) -> None:
    """Write the mark: the names of all that was made."""
    names = sorted(entry.name for entry in folder.iterdir())
    (folder / MARK).write_text(_HEAD + "".join(f"{name}\n" for name in names), encoding="utf-8")


def _carry_over(path: Path, temporary: Path) -> None:
    """Copy what in the older folder is none of ours; under another name where one is taken."""
    if not (path / MARK).is_file():
        return  # nothing, or an empty folder
    listed = (path / MARK).read_text(encoding="utf-8").splitlines()[1:]
    for entry in path.iterdir():
        if entry.name in (*listed, MARK):
            continue
        place = temporary / entry.name
        while place.exists():
            place = place.with_name(f"{place.name}.kept")
        if entry.is_dir() and not entry.is_symlink():
            shutil.copytree(entry, place, symlinks=True)
        else:
            shutil.copy2(entry, place, follow_symlinks=False)


def _put(temporary: Path, path: Path) -> None:
    """Let a folder take the place of another, or of nothing.

    Killed between the two renames, a process leaves no results at `path`; the next one that works
    there brings the old ones back.
    """
    try:
        if files.kind_of(path) is not None:
            os.rename(path, _old(path))
        os.rename(temporary, path)
        files.sync(path.parent)
    finally:
        _restore(path)


def _old(path: Path) -> Path:
    """Return where older results are while new ones take their place."""
    return path.parent / f"{files.hidden_name(path)}.old"


def _restore(path: Path) -> None:
    """Bring older results back where there are no new ones, else remove them."""
    if files.kind_of(_old(path)) is None:
        return
    if files.kind_of(path) is None:
        os.rename(_old(path), path)
    else:
        files.discard(_old(path))


def slug(name: str) -> str:
    """Return the letters and digits of a name, small, with single hyphens for all else."""
    # One form of each letter: some file systems take two forms of it for one name.
    return "-".join(re.findall(r"[^\W_]+", unicodedata.normalize("NFC", name.lower())))


def file_names(
    labels: Sequence[Sequence[str]], *, prefix: str = "", taken: Collection[str] = ()
) -> list[str]:
    """Return a file name of its own, without ending, for each label, of several parts perhaps.

    >>> file_names([["PID +"], ["PID -"], ["tuned"]], taken=["tuned"])
    ['pid', 'pid-2', 'tuned-2']
    """
    given = set(taken)
    names = []
    for label in labels:
        stem = prefix + ("-".join(filter(None, map(slug, label))) or "run")
        stem = stem.encode()[:_MOST_BYTES].decode(errors="ignore")
        name, number = stem, 1
        while name in given:
            number += 1
            name = f"{stem}-{number}"
        given.add(name)
        names.append(name)
    return names

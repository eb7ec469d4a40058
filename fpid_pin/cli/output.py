"""Folders of results that appear whole or not at all."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from fpid_pin.exceptions import FileFormatError
from fpid_pin.files import hidden_beside


class OutputFolder:
    """Give a temporary folder that takes the place of `path` when the block ends without an error.

    An older folder of results there is replaced; anything else is left alone and refused.

    Raises
    ------
    FileFormatError
        On entering, before any work is done: `path` cannot be written, or is something that these
        commands did not make.
    """

    MARK = ".fpid_pin"

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)

    def __enter__(self) -> Path:
        path = self.path
        if path.exists():
            made = path.is_dir() and ((path / self.MARK).exists() or not any(path.iterdir()))
            if not made:
                raise FileFormatError(
                    f"{path}: expected a new folder or one that fpid-pin made, "
                    f"got {'another folder' if path.is_dir() else 'a file'}"
                )
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._temporary = hidden_beside(path, ".part")
            self._temporary.mkdir()
            (self._temporary / self.MARK).write_text("made by fpid-pin; safe to replace\n")
        except OSError as error:
            raise FileFormatError(f"{path}: cannot be written ({error.strerror})") from None
        return self._temporary

    def __exit__(self, kind: type | None, *rest: object) -> None:
        if kind is not None:
            shutil.rmtree(self._temporary, ignore_errors=True)
            return
        if self.path.exists():
            old = hidden_beside(self.path, ".old")
            os.replace(self.path, old)
            os.replace(self._temporary, self.path)
            shutil.rmtree(old, ignore_errors=True)
        else:
            os.replace(self._temporary, self.path)

"""Packages that only some programs need, each behind an extra of ours."""

from __future__ import annotations

import importlib
import importlib.util
from typing import Any

from fpid_pin.exceptions import FpidError


def installed(module: str) -> bool:
    """Return whether a module of an extra can be imported."""
    return importlib.util.find_spec(module) is not None


def needed(module: str, extra: str) -> Any:
    """Import a module of an extra.

    Raises
    ------
    FpidError
        It is not installed; the line says what to install.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        if error.name is not None and error.name.split(".")[0] != module.split(".")[0]:
            raise  # it is there, and lacks something itself
        raise FpidError(
            f"{module}: expected it to be installed (pip install 'fpid_pin[{extra}]'), got none"
        ) from None

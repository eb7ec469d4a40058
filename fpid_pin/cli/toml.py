"""TOML as a table, or one line that says which key is at fault: also for files made to do harm."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from fpid_pin.exceptions import ArgumentError, ConfigError

#: No configuration is longer; an endless device is [bytes].
MOST_BYTES = 1 << 24
#: Tables and lists within each other; a configuration of ours has five.
MOST_LEVELS = 32
_INTEGERS = range(-(1 << 63), 1 << 63)  # as TOML has them
_TABLE = re.compile(r"""\s*\[{1,2}([\w."' -]+)\]{1,2}\s*(?:#|$)""")
_KEY = re.compile(r"""\s*([\w."' -]+?)\s*=""")
_SHOWN = 60


def read_text(path: Path) -> str:
    """Return a configuration's text.

    Raises
    ------
    ConfigError
        A file that is not there, is no text, cannot be read or has no end.
    """
    try:
        with open(path, "rb") as file:
            data = file.read(MOST_BYTES + 1)
        if len(data) > MOST_BYTES:
            raise ConfigError.of(path, [f"expected at most {MOST_BYTES} bytes, got more"])
        # Line ends as TOML and the results' copy have them.
        return data.decode("utf-8").replace("\r\n", "\n")
    except FileNotFoundError:
        raise ConfigError.of(path, ["no such file"]) from None
    except OSError as error:
        raise ConfigError.of(path, [f"cannot be read ({error.strerror})"]) from None
    except ValueError:
        raise ConfigError.of(path, ["cannot be read (not a text file)"]) from None


def parse_table(text: str) -> dict[str, Any]:
    """Return the table that a text holds.

    Raises
    ------
    ConfigError
        Not TOML.
    ArgumentError
        Naming the key: nested too deeply, or a whole number beyond 64 bits.
    """
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"not valid TOML: {error}") from None
    except RecursionError:
        raise _too_deep(_key_at(text, _deepest(text))) from None
    except ValueError:
        # Python reads no whole number of more than some thousand digits.
        digits = [_longest_digits(line) for line in text.splitlines()]
        key = _key_at(text, digits.index(max(digits)))
        raise ArgumentError(
            key, "a whole number of 64 bits", f"one of {max(digits)} digits"
        ) from None
    _check(table)
    return table


def _check(table: dict[str, Any]) -> None:
    # A stack of its own: a table may be nested more deeply than Python calls may be.
    waiting: list[tuple[tuple[str, ...], Any]] = [((), table)]
    while waiting:
        path, value = waiting.pop()
        if isinstance(value, (dict, list)):
            if len(path) > MOST_LEVELS:
                raise _too_deep(".".join(path[:3]))
            pairs = value.items() if isinstance(value, dict) else enumerate(value)
            waiting += [((*path, str(key)), item) for key, item in pairs]
        elif type(value) is int and value not in _INTEGERS:
            digits = f"one of {value.bit_length()} bits"
            raise ArgumentError(".".join(path), "a whole number of 64 bits", digits)


def _too_deep(key: str) -> ArgumentError:
    return ArgumentError(key, f"at most {MOST_LEVELS} tables and lists within each other", "more")


def _longest_digits(line: str) -> int:
    return max((len(run) for run in re.findall(r"\d+", line.replace("_", ""))), default=0)


def _deepest(text: str) -> int:
    """Return the line that opened the value in which brackets are nested most deeply."""
    level, deepest, found, opened = 0, 0, 0, 0
    for k, line in enumerate(text.splitlines()):
        if level <= 0:
            level, opened = 0, k
        opening = line.count("[") + line.count("{")
        peak = level + opening
        level = peak - line.count("]") - line.count("}")
        if peak > deepest:
            deepest, found = peak, opened
    return found


def _key_at(text: str, line: int) -> str:
    """Return the key that a line gives a value, with the table that it stands in."""
    lines = text.splitlines()[: line + 1]
    tables = [named[1] for row in lines[:-1] if (named := _TABLE.match(row))]
    key = _KEY.match(lines[-1])
    parts = [*tables[-1:], *([key[1]] if key else [])]
    return ".".join(part.replace(" ", "")[:_SHOWN] for part in parts) or "file"

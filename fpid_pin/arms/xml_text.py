"""What the readers of robot files share: their text, its size and depth, and which kind it is."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

from fpid_pin import checks
from fpid_pin.exceptions import ArmError
from fpid_pin.text import cut

#: Elements within one another, at most; a URDF needs six. XML is written, and read by the parsers
#: of Pinocchio, by functions that call themselves.
NESTED = 100
#: Characters of an element's name in a message.
_TAG = 60
#: Root elements, what such a file is called, and what reads it.
KINDS = {
    "robot": ("URDF", "Arm.from_urdf"),
    "mujoco": ("MJCF", "Arm.from_mjcf"),
    "sdf": ("SDF", "Arm.from_sdf"),
}


def read_text(path: str | Path, kind: str = "URDF") -> str:
    """Read a robot's file; whatever the file system says becomes one `ArmError`."""
    checks.instance("path", path, (str, Path), f"the path of a {kind} file")
    file, label = Path(path), cut(str(path))
    try:
        if not file.is_file():
            got = "a folder" if file.is_dir() else "none"
            raise ArmError(f"{label}: expected a {kind} file, got {got}")
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        # What the system says of a name that is too long repeats the name.
        reason = getattr(error, "strerror", None) or error
        raise ArmError(f"{label}: cannot be read: {reason}") from None


def parse_xml(text: str, label: str) -> ET.Element:
    """Parse a robot's file and return its root; it may be nested `NESTED` deep.

    Raises
    ------
    ArmError
        Broken XML, elements too deep, or a file that `xacro` has to read first.
    """
    try:
        root = ET.fromstring(text)
    except (ET.ParseError, ValueError) as error:
        raise ArmError(f"{label}: expected well-formed XML, got {error}") from None
    level = [root]
    for _ in range(NESTED):
        level = [element for above in level for element in above]
        if any("/xacro}" in element.tag for element in level):
            raise ArmError(
                f"{label}: expected a robot that is written out, got macros of xacro (run: xacro "
                f"{_shell(label)} > robot.urdf, and read that)"
            )
        if not level:
            return root
    raise ArmError(
        f"{label}: expected at most {NESTED} elements within one another, got more around "
        f"<{cut(level[0].tag, _TAG)}>"
    )


def require_root(root: ET.Element, tag: str, label: str) -> None:
    """Refuse a file of another kind, and say what reads it."""
    if root.tag != tag:
        hint = f" ({KINDS[root.tag][1]} reads it)" if root.tag in KINDS else ""
        raise ArmError(f"{label}: expected a <{tag}> element, got <{cut(root.tag, _TAG)}>{hint}")


def kind_of(path: str | Path) -> str:
    """Return the root element of a robot's file: one of `KINDS`.

    Raises
    ------
    ArmError
        A file that cannot be read, or of another kind.
    """
    label = cut(str(path))
    root = parse_xml(read_text(path, "URDF, MJCF or SDF"), label)
    if root.tag not in KINDS:
        known = ", ".join(f"<{tag}>" for tag in KINDS)
        raise ArmError(f"{label}: expected one of {known}, got <{cut(root.tag, _TAG)}>")
    return str(root.tag)


def _shell(label: str) -> str:
    return label if " " not in label else f"'{label}'"

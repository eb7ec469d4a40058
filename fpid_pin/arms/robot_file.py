"""What the readers of robot files share: their text, which kind it is, errors on one line."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from xml.parsers import expat

from fpid_pin import checks
from fpid_pin.exceptions import ArmError
from fpid_pin.text import cut, visible

#: Elements within one another, at most; a URDF needs six. XML is written, and read by the parsers
#: of Pinocchio, by functions that call themselves.
NESTED = 100
#: Characters of an element's name in a message.
_TAG = 60
#: Root elements, what such a file is called, and what reads it.
KINDS = {"robot": ("URDF", "Arm.from_urdf"), "mujoco": ("MJCF", "Arm.from_mjcf")}


def read_robot(path: str | Path, kind: str = "URDF") -> bytes:
    """Read a robot's file; whatever the file system says becomes one `ArmError`."""
    checks.instance("path", path, (str, Path), f"the path of a {kind} file")
    file, label = Path(path), cut(str(path))
    try:
        if not file.is_file():
            got = "a folder" if file.is_dir() else "none"
            raise ArmError(f"{label}: expected a {kind} file, got {got}")
        return file.read_bytes()
    except OSError as error:
        # What the system says of a name that is too long repeats the name.
        raise ArmError(f"{label}: cannot be read: {error.strerror or error}") from None


def parse_xml(text: bytes | str, label: str, *roots: str) -> ET.Element:
    """Parse a robot's file as urdfdom and MuJoCo do, and return its root, called one of `roots`.

    That is without namespaces: a prefix is part of a name, and need not be declared. White space
    may come before the declaration, and ``--`` may stand in a comment. Broken XML, elements too
    deep, another root and a file that `xacro` has to read first are an `ArmError`.
    """
    # Of a text the encoding is known, whatever it declares.
    parser = expat.ParserCreate("utf-8" if isinstance(text, str) else None)
    data = text.encode("utf-8", "replace") if isinstance(text, str) else text
    data = re.sub(rb"<!--.*?-->", b"", data.removeprefix(b"\xef\xbb\xbf").lstrip(), flags=re.DOTALL)
    builder = ET.TreeBuilder()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    try:
        parser.Parse(data, True)
        root = builder.close()
    except (expat.ExpatError, AssertionError, ValueError, LookupError) as error:
        raise ArmError(f"{label}: expected well-formed XML, got {error}") from None
    level = [root]
    for _ in range(NESTED):
        level = [element for above in level for element in above]
    if level:
        raise ArmError(
            f"{label}: expected at most {NESTED} elements within one another, got more around "
            f"<{cut(level[0].tag, _TAG)}>"
        )
    if any(e.tag.startswith("xacro:") or "${" in "".join(e.attrib.values()) for e in root.iter()):
        shell = label if " " not in label else f"'{label}'"
        raise ArmError(
            f"{label}: expected a robot that is written out, got macros of xacro (run: xacro "
            f"{shell} > robot.urdf, and read that)"
        )
    if root.tag not in roots:
        known = " or ".join(f"<{tag}>" for tag in roots)
        hint = f" ({KINDS[root.tag][1]} reads it)" if root.tag in KINDS else ""
        raise ArmError(f"{label}: expected {known}, got <{cut(root.tag, _TAG)}>{hint}")
    return root


def kind_of(path: str | Path) -> str:
    """Return the root element of a robot's file, one of `KINDS`; of another, an `ArmError`."""
    return parse_xml(read_robot(path, "URDF or MJCF"), cut(str(path)), *KINDS).tag


@contextmanager
def one_line(what: str) -> Iterator[None]:
    """Turn whatever a library, git, the network or the disk raises into one `ArmError`."""
    try:
        yield
    except ArmError:
        raise
    except Exception as error:
        # Some of Pinocchio's messages begin with where in its source they come from.
        said = str(error).rpartition("\nmessage:")[2]
        reason = visible(" ".join(said.split())) or type(error).__name__
        raise ArmError(f"{what}: {cut(reason, 400)}") from None

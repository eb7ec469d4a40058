"""The paper's robot, from the one file ``urdf/two_link.urdf``."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from typing import Any, ClassVar

from fpid_pin.arms.source import Parts, Source
from fpid_pin.arms.urdf import UrdfSource

#: Section 5.1; Pinocchio's own default is 9.81.
GRAVITY = 9.8


def two_link_urdf() -> str:
    """Return the text of ``urdf/two_link.urdf``, wherever the package is installed."""
    # `data` is a link to the repository's urdf folder; the wheel and the sdist hold the file.
    file = resources.files("fpid_pin.arms") / "data" / "two_link.urdf"
    return file.read_text(encoding="utf-8")


@dataclass(frozen=True, eq=False)
class TwoLinkSource(Source):
    """The two-link arm of section 5.1: eq. (35) with m3 = 0 and g = 9.8 m/s^2."""

    kind: ClassVar[str] = "two_link"

    def build(self) -> Parts:
        """Build the arm's parts."""
        return self._urdf().build()

    def table(self) -> dict[str, Any]:
        """Return the source as a plain table."""
        return {}

    def visual(self, model: Any) -> tuple[Any, Any]:
        """Load the visuals."""
        return self._urdf().visual(model)

    def _urdf(self) -> UrdfSource:
        return UrdfSource(two_link_urdf(), "two_link.urdf", gravity=GRAVITY)

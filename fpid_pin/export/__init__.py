"""Controllers for elsewhere: the kernels that simulate, printed as C99 and as JavaScript."""

from __future__ import annotations

__all__: list[str] = []

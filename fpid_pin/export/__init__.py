"""Controllers for elsewhere: the kernels that simulate, printed as C99 and as JavaScript."""

from fpid_pin.export.folder import export_c

__all__ = ["export_c"]

"""SciPy's gamma and zeta functions, loaded at the first call.

Loading them takes as long as loading NumPy, and a program that imports the package need not call
any.
"""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike


def gamma(x: ArrayLike) -> Any:
    """Gamma(x)."""
    from scipy import special

    return special.gamma(x)


def gammaln(x: ArrayLike) -> Any:
    """Log |Gamma(x)|."""
    from scipy import special

    return special.gammaln(x)


def rgamma(x: ArrayLike) -> Any:
    """1/Gamma(x), 0 at the poles of Gamma."""
    from scipy import special

    return special.rgamma(x)


def zeta(x: ArrayLike) -> Any:
    """Riemann's zeta function."""
    from scipy import special

    return special.zeta(x)

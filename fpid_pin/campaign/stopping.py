"""When a campaign has run long enough: intervals that hold however often one looks.

A usual interval of 95 % misses the truth in one campaign of twenty, if one looks once. Who looks
after every chunk and stops when it pleases will be misled far more often. Here the intervals of all
n = 1, 2, 3, ... runs together miss it in at most one of twenty.

After S successes in n runs let the capital of a gambler who holds the rate for p be

    M_n(p) = B(w p + S, w (1 - p) + n - S) / (B(w p, w (1 - p)) p^S (1 - p)^(n - S)),

the likelihood of the runs, averaged over a prior that amounts to w runs at the rate p, over that at
p itself. If the runs are independent and succeed at the rate p, M is a martingale from M_0 = 1, and
ever comes to 20 with a chance of at most 1/20 (Ville). The interval is {p: M_n(p) < 20}. It holds
S/n, where no rate is more likely, and has no gaps: M's logarithm is convex in p, as its derivative

    - sum_(i<S) i/(p (w p + i)) + sum_(i<n-S) i/((1 - p) (w (1 - p) + i))

grows with p. Any w is valid; the interval is narrowest at about n = 10 w, and hardly wider from 2 w
to 100 w.

Sources: J. Ville, Étude critique de la notion de collectif (1939); H. Robbins, Ann. Math. Stat. 41
(1970) 1397; S. R. Howard, A. Ramdas, J. McAuliffe, J. Sekhon, Ann. Stat. 49 (2021) 1055, with this
prior. As a way to bet on a mean: I. Waudby-Smith and A. Ramdas, J. R. Stat. Soc. B 86 (2024) 1. For
medians: S. R. Howard and A. Ramdas, Bernoulli 28 (2022) 1704.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fpid_pin import checks
from fpid_pin.campaign.data import METRICS, CampaignData
from fpid_pin.campaign.statistics import CONFIDENCE, Interval, scored
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import listed, shown

_SUCCESS = re.compile(r"success\s*(?:\+-|\+/-|±)(.*)", re.DOTALL)
#: The prior's runs, w, where nothing says how many runs there will be; and, times the square of the
#: half-width that is asked for, where that does.
WEIGHT, _WEIGHT_OF_WIDTH = 10.0, 0.03
# log M from which on a rate is refuted.
_LIMIT = -np.log1p(-CONFIDENCE)
# Halvings of an interval of length one down to a float's last digit.
_HALVINGS = 53


def log_capital(
    successes: FloatArray,
    runs: FloatArray | float,
    rate: FloatArray | float,
    weight: float = WEIGHT,
) -> FloatArray:
    """Return log M_n(p) of the module's text, 0 < p < 1, elementwise."""
    from scipy.special import betaln, xlog1py, xlogy

    failures, heads, tails = runs - successes, weight * rate, weight * (1.0 - rate)
    mixed = betaln(heads + successes, tails + failures) - betaln(heads, tails)
    return np.asarray(mixed - xlogy(successes, rate) - xlog1py(failures, -rate))


def rate_intervals(
    successes: FloatArray, runs: FloatArray, weight: float = WEIGHT
) -> tuple[FloatArray, FloatArray]:
    """Return the ends of the rate's interval, valid for all numbers of runs at once.

    Parameters
    ----------
    successes, runs
        Counts, of one shape, 0 <= successes <= runs.
    weight
        The prior's w.
    """
    s, n = np.broadcast_arrays(np.asarray(successes, float), np.asarray(runs, float))
    # Near one a rate has no digits left; its failures' rate has.
    return _lower_ends(s, n, weight), 1.0 - _lower_ends(n - s, n, weight)


def _lower_ends(s: FloatArray, n: FloatArray, weight: float) -> FloatArray:
    # From the share, which is within, to beyond the end.
    inside = np.where(s > 0, s / np.maximum(n, 1.0), 0.5)
    outside = np.zeros(s.shape)
    for _ in range(_HALVINGS):
        middle = (inside + outside) / 2.0
        held = log_capital(s, n, middle, weight) < _LIMIT
        inside, outside = np.where(held, middle, inside), np.where(held, outside, middle)
    return np.asarray(np.where(s > 0, outside, 0.0))


def rate_interval(successes: int, runs: int) -> Interval:
    """Return the share of successes, and its interval that is valid at any number of looks.

    Raises
    ------
    ArgumentError
        Not 0 <= successes <= runs.
    """
    runs = checks.integer("runs", runs, low=0)
    successes = checks.integer("successes", successes, low=0, high=runs)
    low, high = rate_intervals(np.array(successes), np.array(runs))
    return Interval(successes / runs if runs else float("nan"), float(low), float(high))


def median_interval(values: FloatArray) -> Interval:
    """Return the median, and its interval that is valid at any number of looks.

    Below the median x lie as many of n values as heads of a fair coin. With c the least count whose
    M_n(1/2) is below the limit, the interval reaches from the c-th value to the c-th from above.

    Parameters
    ----------
    values
        (n,), in any order; infinite ones count as what they are.
    """
    n = len(values)
    if n == 0:
        return Interval(float("nan"), -np.inf, np.inf)
    counts = np.arange(n // 2 + 1, dtype=np.float64)
    held = log_capital(counts, n, 0.5) < _LIMIT
    c, ordered = int(np.argmax(held)), np.sort(values)
    # Between two infinities there is no middle: the lower one is as good.
    median = float(np.quantile(ordered, 0.5, method="inverted_cdf"))
    if c == 0:
        return Interval(median, -np.inf, np.inf)
    return Interval(median, float(ordered[c - 1]), float(ordered[n - c]))


class Rule(ABC):
    """Says after the first runs of a campaign whether they are enough; see `parse`."""

    def __call__(self, data: CampaignData) -> bool:
        """Return whether it is known."""
        return self.judge(data)[0]

    @abstractmethod
    def judge(self, data: CampaignData) -> tuple[bool, str]:
        """Return whether it is known, and a line with what is."""


@dataclass(frozen=True)
class SuccessWithin(Rule):
    """Every controller's success rate is known to within so much.

    Each one's interval is at most twice as long as `half_width`; each has its 95 % by itself.
    """

    half_width: float

    def __post_init__(self) -> None:
        value = checks.number("half_width", self.half_width, above=0.0, high=0.5)
        object.__setattr__(self, "half_width", value)

    @property
    def weight(self) -> float:
        """The prior's w that suits the width; beyond a million, rounding would be seen."""
        return float(np.clip(_WEIGHT_OF_WIDTH / self.half_width**2, 1.0, 1e6))

    def judge(self, data: CampaignData) -> tuple[bool, str]:
        """Return whether it is known, and the rate that is known least."""
        successes = data.success.sum(axis=0)
        low, high = rate_intervals(successes, np.full(successes.shape, data.runs), self.weight)
        k = int(np.argmax(high - low))
        share = successes[k] / data.runs if data.runs else float("nan")
        line = (
            f"success of {data.controllers[k]}: {100.0 * share:.4g} % of {data.runs} runs "
            f"(95 % at any number of looks: {100.0 * low[k]:.4g} to {100.0 * high[k]:.4g} %)"
        )
        return bool(high[k] - low[k] <= 2.0 * self.half_width), line


@dataclass(frozen=True)
class Decided(Rule):
    """It is known which of two controllers has the smaller error on most plants.

    Looked at is the paired difference of the RMS errors, first less second, over the plants on
    which there is one: a lost run counts as infinitely bad, plants that both have lost, or that are
    equal to the last bit, are left out. It is known when the interval of its median excludes zero.
    That is the same as to say: of such plants more than half, or less, are better with the first.
    It says nothing of mean errors.
    """

    first: str
    second: str

    def judge(self, data: CampaignData) -> tuple[bool, str]:
        """Return whether it is known, and the median difference."""
        scores = scored(data)
        columns = [
            data.controllers.index(checks.choice("controller", name, data.controllers))
            for name in (self.first, self.second)
        ]
        a, b = scores[:, columns[0]], scores[:, columns[1]]
        differ = a != b
        found = median_interval(a[differ] - b[differ])
        known = found.low > 0.0 or found.high < 0.0
        line = (
            f"{self.first} - {self.second}: RMS error differs by {found.estimate:.4g} "
            f"{METRICS['rms']} in the median of {int(differ.sum())} plants (95 % at any number of "
            f"looks: {found.low:.4g} to {found.high:.4g})"
        )
        return known, line


def parse(text: str, controllers: Sequence[str]) -> Rule:
    """Return the rule that ``--until`` asks for.

    Parameters
    ----------
    text
        ``"success +- 0.01"`` (also ``+/-`` and ``±``), or ``"A - B"`` with two controllers' names.
    controllers
        All names; one may have a hyphen.

    Raises
    ------
    ArgumentError
        Neither; or a width out of range, or a text that can be read in two ways.
    """
    checks.instance("until", text, str, 'a text such as "success +- 0.01"')
    names = list(controllers)
    cuts = [k for k, letter in enumerate(text) if letter == "-"]
    pairs = [(text[:k].strip(), text[k + 1 :].strip()) for k in cuts]
    pairs = [(a, b) for a, b in pairs if a in names and b in names and a != b]
    if len(pairs) == 1:
        return Decided(*pairs[0])
    if pairs:
        ways = " or ".join(f"{shown(a)} less {shown(b)}" for a, b in pairs)
        raise ArgumentError("until", "a difference that can be read in one way", ways)
    found = _SUCCESS.fullmatch(text.strip())
    if found is None:
        expected = f'"success +- 0.01", or "A - B" of two of the controllers {listed(names)}'
        raise ArgumentError("until", expected, shown(text))
    try:
        return SuccessWithin(float(found[1]))
    except ValueError:  # ours is one, too
        expected = "success +- a number in (0, 0.5]"
        raise ArgumentError("until", expected, shown(text)) from None

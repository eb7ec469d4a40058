"""Where a search stands, and who works it out."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from fpid_pin.progress import Progress


@dataclass(frozen=True)
class SearchProgress(Progress):
    """Where a search stands.

    Attributes
    ----------
    part
        Of the whole search, 0 to 1.
    generation, generations
        The one at work, from 1; and how many there will be.
    complete
        Whether that generation is done, and its checkpoint written.
    best
        Lowest cost so far (the first of several), inf before the first generation is done.
    evaluations
        Candidates evaluated so far, all seeds together.
    rate
        Evaluations a second in this process [1/s], 0 before any is done.
    seconds_left
        At that rate [s]; NaN before any is done.
    """

    generation: int
    generations: int
    complete: bool
    best: float
    evaluations: int
    rate: float
    seconds_left: float


#: What ``progress=`` of a search takes; a `fpid_pin.progress.ProgressCallback` will do as well.
SearchCallback = Callable[[SearchProgress], None]


class Narrator:
    """Tells a callback where a search stands; the clock runs from here on.

    Parameters
    ----------
    callback
        None: nobody is told.
    generations, size
        How many there will be, and the candidates in each.
    done
        Generations done before, by the search that is resumed.
    """

    def __init__(
        self, callback: SearchCallback | None, generations: int, size: int, done: int = 0
    ) -> None:
        self._callback, self._generations, self._size = callback, generations, size
        self._before, self._began = done, time.monotonic()

    def tell(
        self, generation: int, part: float, *, best: float = math.inf, complete: bool = False
    ) -> None:
        """Tell that a part, 0 to 1, of a generation, from 1, is done."""
        if self._callback is None:
            return
        done = generation - 1 + part
        seconds = time.monotonic() - self._began
        rate = (done - self._before) * self._size / seconds if seconds > 0.0 else 0.0
        left = (self._generations - done) * self._size
        self._callback(
            SearchProgress(
                part=done / self._generations,
                generation=generation,
                generations=self._generations,
                complete=complete,
                best=best,
                evaluations=round(done * self._size),
                rate=rate,
                seconds_left=left / rate if rate > 0.0 else math.nan,
            )
        )

"""A needle and the one that it turns below, with what reading them together takes: worked out once for all who do."""

from __future__ import annotations

from functools import cached_property

from decoder.covered_pair import hidden_reach_rows, pair_reach_rows
from decoder.matching import Matcher
from decoder.pair_fit import PairFitter


class NeedlePair:
    """Two needles of one gauge, one over the other."""

    def __init__(self, upper: Matcher, lower: Matcher) -> None:
        self.upper, self.lower = upper, lower
        self.reach_rows = pair_reach_rows(upper, lower)
        self._fitters: dict[int, PairFitter] = {}

    @cached_property
    def hidden_reach_rows(self) -> float:
        """How far apart their axes can be with too little of the lower one showing to tell."""
        return hidden_reach_rows(self.upper, self.lower)

    def fitter(self, reach_rows: int) -> PairFitter:
        """Fits both together, their axes at most so far apart."""
        if reach_rows not in self._fitters:
            upper, lower = self.upper, self.lower
            self._fitters[reach_rows] = PairFitter(upper.template, lower.template, reach_rows, upper.pixels_per_sample)
        return self._fitters[reach_rows]

"""Types that many modules share: of arrays, and of numbers that people write."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BeforeValidator, Field

MOST = 1e12  # limit of any hand-written number, so that results stay far from overflow

Floats = NDArray[np.floating[Any]]
"""Numbers in single or double precision; each docstring says which, and the shape."""
Mask = NDArray[np.bool_]
"""True where something holds."""
Indices = NDArray[np.intp]
"""Places in arrays."""


def limited(values: NDArray[Any], low: float | NDArray[Any], high: float | NDArray[Any]) -> NDArray[Any]:
    """Do `np.clip`, which takes several times as long on a small array."""
    inside: NDArray[Any] = np.minimum(np.maximum(values, low), high)
    return inside


def _no_truth(value: object) -> object:
    if isinstance(value, bool):
        raise ValueError("is true or false, where a number is wanted")  # noqa: TRY004 - pydantic's way
    return value


def at_most(limit: float) -> AfterValidator:
    """Refuse numbers that are further from zero, as results computed from them would overflow."""

    def check(number: float) -> float:
        if abs(number) > limit:
            raise ValueError(f"is further from zero than {limit:g}; check its digits")
        return number

    return AfterValidator(check)


NO_TRUTH = BeforeValidator(_no_truth)
# A bound has to come first, or the reference of the keys does not show it.
Number = Annotated[float, Field(allow_inf_nan=False), NO_TRUTH, at_most(MOST)]
Degrees = Annotated[Number, at_most(36_000)]

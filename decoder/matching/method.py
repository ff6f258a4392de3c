"""The two ways to find a needle (thesis 3.2)."""

from __future__ import annotations

from enum import StrEnum


class Method(StrEnum):
    """How the best row is found: by normalized or by plain cross-correlation."""

    NORMXCORR = "normxcorr"
    XCORR = "xcorr"

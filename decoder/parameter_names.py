"""What our names say: `STEM_UNIT`, with an engine's number at the end of the stem (`oil_temp_2_c`), or none."""

from __future__ import annotations

import re

# What a name may end with; a stem that is left over is what is meant.
UNIT_SUFFIXES = {
    *("a", "amps", "bar", "c", "deg", "f", "fpm", "ft", "g", "gal", "gph", "hpa", "inhg", "k", "kph", "kt", "kts"),
    *("lb", "lph", "mph", "pct", "pph", "psi", "v", "volts"),
}


def stem_of(name: str) -> str:
    """A name in small letters without its unit."""
    stem, _, suffix = name.lower().rpartition("_")
    return stem if stem and suffix in UNIT_SUFFIXES else name.lower()


def engine_stem_of(name: str) -> tuple[str, int]:
    """A name without unit and engine's number, and that number; 1 if there is none."""
    stem, number = re.fullmatch(r"(.+?)(?:_([1-9]))?", stem_of(name)).groups()  # type: ignore[union-attr]  # takes all
    return stem, int(number or 1)

"""Legends: what a dial shows according to its words, in which unit, and the multiplier of its numerals.

Words are half hidden by needles and misread, so each is compared as a whole and a few letters may be wrong.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from difflib import SequenceMatcher

from decoder.setup.finding.thresholds import ALIKE, LEAST_LETTERS

# ruff: noqa: RUF001 - the sign of multiplication is what dials print

UNITS = {
    "KNOTS": "kt", "KTS": "kt", "KT": "kt", "MPH": "mph", "KM/H": "km/h", "KPH": "km/h", "RPM": "rpm", "PSI": "psi",
    "BAR": "bar", "MPA": "MPa", "KPA": "kPa", "INHG": "inHg", "IN.HG": "inHg", "IN.HG.": "inHg", "°F": "degF",
    "℉": "degF", "°C": "degC", "℃": "degC", "GAL": "gal", "GAL.": "gal", "USGAL": "gal", "U.S.GAL": "gal",
    "U.S.GAL.": "gal", "GALLONS": "gal", "LBS": "lb", "AMPS": "A", "AMP": "A", "AMPERES": "A", "VOLT": "V",
    "VOLTS": "V", "FEET": "ft", "FT": "ft", "FT/MIN": "fpm", "FPM": "fpm", "FEETPERMIN": "fpm", "FEETPERMINUTE": "fpm",
}  # fmt: skip
NAMES = {
    "AIRSPEED": "airspeed", "ALT": "altimeter", "ALTIMETER": "altimeter", "ALTITUDE": "altimeter",
    "VERTICALSPEED": "vertical speed", "MANIFOLD": "manifold pressure", "SUCTION": "suction", "FUEL": "fuel",
    "EGT": "exhaust gas temperature", "CHT": "cylinder head temperature", "ADF": "automatic direction finder",
    "TURNCOORDINATOR": "turn coordinator", "PRESSURE": "pressure", "TACHOMETER": "engine speed",
}  # fmt: skip
BY_UNIT = {
    "kt": "airspeed", "mph": "airspeed", "fpm": "vertical speed", "rpm": "engine speed", "A": "ammeter",
    "V": "voltmeter", "ft": "altimeter",
}  # fmt: skip
# Scales in these units end no lower; with smaller numbers, the multiplier was not read.
LEAST_ENDS = {"rpm": 500.0, "fpm": 500.0, "ft": 500.0}
# Units that are counted in thousands or hundreds by a number before them; with other units, it is a numeral.
COUNTED = ("rpm", "fpm")
LETTERS = {"C": "degC", "F": "degF"}
OIL = {"psi": "oil pressure", "bar": "oil pressure", "degF": "oil temperature", "degC": "oil temperature"}

_TIMES = re.compile(r"^[X×*](10{1,4})$")
_MISREAD = str.maketrans("OI|", "011")
_COUNTED = re.compile(r"^[X×]?(1[0O]{1,3})(.+)$")


@dataclass(frozen=True, slots=True)
class Legend:
    """The meaning of a dial's words.

    Attributes
    ----------
    name
        Of what is shown; empty if no word says so.
    unit
        Its unit; empty if no word says so.
    factor
        The value of one on the numerals.
    said
        The words that say so.
    """

    name: str = ""
    unit: str = ""
    factor: float = 1.0
    said: tuple[str, ...] = ()

    def lacks_factor(self, largest: float) -> bool:
        """Whether numerals up to `largest` are too small for the unit, so that there must be a multiplier."""
        return largest * self.factor < LEAST_ENDS.get(self.unit, 0.0)

    def about_zero(self) -> Legend:
        """Return what the words tell beside a scale about 0: no airspeed falls below it, so "SPEED" is half a name."""
        return replace(self, name="vertical speed") if self.name == "airspeed" and not self.unit else self


def legend_of(said: Sequence[str]) -> Legend:
    """Interpret words together; the nearest to the scale first.

    Parameters
    ----------
    said : each as it was read, ordered by distance only
    """
    words = [(each, re.sub(r"\s", "", each.upper())) for each in said]
    unit, factor, name = "", 1.0, ""
    used: list[str] = []
    for whole, word in words:
        counted = _COUNTED.match(word)
        times = _TIMES.match(word.translate(_MISREAD))
        if times:
            factor = float(times[1])
            used.append(whole)
            continue
        bare = counted[2] if counted else word
        own = _known(bare, UNITS)
        if own and (not unit or (unit == "ft" and own == "fpm")):
            unit = own
            used.append(whole)
            if counted and (own in COUNTED or word[0] in "X×"):
                factor = float(counted[1].translate(_MISREAD))
        glued = re.match(r"^(.{3,})[X×*](1[O0]{1,3})$", word)
        if glued and _known(glued[1], UNITS):
            unit, factor = _known(glued[1], UNITS), float(glued[2].translate(_MISREAD))
            used.append(whole)
        named = _known(bare, NAMES)
        if named and not name:
            name = named
            used.append(whole)
    if any(word == "OIL" for _, word in words):
        # Elsewhere a single letter is not a unit, since half a screw may be read as one.
        unit = unit or next((LETTERS[word] for _, word in words if word in LETTERS), "")
        name = OIL.get(unit, name)
    by_unit = BY_UNIT.get(unit, "")
    if by_unit and name in BY_UNIT.values():
        name = by_unit  # a name may be half of another: "SPEED" in feet per minute is vertical speed
    return Legend(name or by_unit, unit, factor, tuple(dict.fromkeys(used)))


def _known(word: str, table: dict[str, str]) -> str:
    if word in table:
        return table[word]
    if len(word) < LEAST_LETTERS:
        return ""
    return table.get(_likest(word, (each for each in table if len(each) >= LEAST_LETTERS)), "")


def _likest(word: str, known: Iterable[str]) -> str:
    alike = {each: SequenceMatcher(None, word, each).ratio() for each in known}
    best = max(alike, key=lambda each: alike[each], default="")
    return best if best and alike[best] >= ALIKE else ""

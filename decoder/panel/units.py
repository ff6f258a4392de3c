"""Units of what cockpits show, their names as suffixes, and conversions between units of the same kind.

Definitions are exact if they are legal ones (foot, knot, pound, US gallon); the inch of mercury is that at 0 degrees C.
Mass and volume of fuel are different kinds, because the density between them is unknown.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from decoder.panel.arrays import Floats
from decoder.panel.errors import UnitError

FOOT_M, POUND_KG, GALLON_L, HOUR_S = 0.3048, 0.45359237, 3.785411784, 3600.0

# Suffixes of names; the remaining stem says what is meant.
UNIT_SUFFIXES = {
    *("a", "amps", "bar", "c", "deg", "dps", "f", "fpm", "ft", "g", "gal", "gph", "hpa", "inhg", "k", "kph", "kt"),
    *("kts", "lb", "lph", "mph", "norm", "pct", "pph", "psi", "v", "volts"),
}


@dataclass(frozen=True, slots=True)
class Unit:
    """`base = factor * (value + offset)`, in a base unit of its kind."""

    kind: str
    factor: float = 1.0
    offset: float = 0.0


_KNOWN: dict[tuple[str, ...], Unit] = {
    ("kt", "kts", "knot", "knots"): Unit("speed", 1852 / HOUR_S),
    ("mph",): Unit("speed", 0.44704),
    ("km/h", "kmh", "kph"): Unit("speed", 1 / 3.6),
    ("m/s",): Unit("speed"),
    ("fpm", "ft/min", "feet/min"): Unit("speed", FOOT_M / 60),
    ("ft", "feet", "ft baro", "ft msl"): Unit("length", FOOT_M),
    ("m",): Unit("length"),
    ("deg c", "degc", "c", "°c"): Unit("temperature", 1.0, 273.15),
    ("deg f", "degf", "f", "°f"): Unit("temperature", 5 / 9, 459.67),
    ("k",): Unit("temperature"),
    ("psi",): Unit("pressure", 6894.757293168),
    ("bar",): Unit("pressure", 1e5),
    ("hpa", "mbar", "mb"): Unit("pressure", 100.0),
    ("kpa",): Unit("pressure", 1000.0),
    ("inhg", "in hg", "hg", "inch hg"): Unit("pressure", 3386.389),
    ("gph", "gal/h"): Unit("volume flow", GALLON_L / HOUR_S),
    ("l/h", "lph"): Unit("volume flow", 1 / HOUR_S),
    ("pph", "lb/h", "lb/hr", "lbs/hr"): Unit("mass flow", POUND_KG / HOUR_S),
    ("kg/h",): Unit("mass flow", 1 / HOUR_S),
    ("gal", "gals", "gallons"): Unit("volume", GALLON_L),
    ("l", "litres", "liters"): Unit("volume"),
    ("lb", "lbs", "pounds"): Unit("mass", POUND_KG),
    ("kg",): Unit("mass"),
    ("rpm",): Unit("rotation"),
    ("%", "pct", "percent"): Unit("part", 0.01),
    ("deg", "degrees", "°"): Unit("angle"),
    ("deg/s", "dps"): Unit("turn rate"),
    ("standard rate", "standard rates"): Unit("turn rate", 3.0),
    ("v", "volt", "volts"): Unit("voltage"),
    ("a", "amp", "amps"): Unit("current"),
    ("g",): Unit("load"),
}
UNITS: dict[str, Unit] = {name: unit for names, unit in _KNOWN.items() for name in names}


def converted(values: Floats, source: str, target: str) -> Floats:
    """Convert values to another unit of the same kind.

    Raises
    ------
    UnitError
        If a unit is unknown or they are of different kinds.
    """
    if _plain(source) == _plain(target):
        return values
    one, other = _unit(source), _unit(target)
    if one.kind != other.kind:
        raise UnitError(f"there is no way from {source!r} ({one.kind}) to {target!r} ({other.kind})")
    in_target: Floats = (values + one.offset) * (one.factor / other.factor) - other.offset
    return in_target


def _unit(name: str) -> Unit:
    unit = UNITS.get(_plain(name))
    if unit is None:
        raise UnitError(f"the unit {name!r} is not known; known are {', '.join(names[0] for names in _KNOWN)}")
    return unit


def _plain(name: str) -> str:
    return " ".join(name.lower().split())


def stem_of(name: str) -> str:
    """Return a name without its unit, in lower case."""
    stem, _, suffix = name.lower().rpartition("_")
    return stem if stem and suffix in UNIT_SUFFIXES else name.lower()


def engine_stem_of(name: str) -> tuple[str, int]:
    """Split a name without its unit into its stem and the engine's number, 1 if there is none."""
    stem, number = re.fullmatch(r"(.+?)(?:_([1-9]))?", stem_of(name)).groups()  # type: ignore[union-attr]  # takes all
    return stem, int(number or 1)


def contrary_units(columns: Iterable[tuple[str, str]]) -> Iterator[str]:
    """Say which columns' names end in another unit than the one their values are in.

    Parameters
    ----------
    columns
        The name and the unit of each.
    """
    for name, unit in columns:
        suffix = name.lower().rpartition("_")[2]
        said, given = UNITS.get(suffix), UNITS.get(_plain(unit))
        if said is None or given is None or said == given:
            continue
        is_alike = said.kind == given.kind
        # `bus_a` is a bus, and `oil_deg` may well be a temperature.
        if is_alike or not (len(suffix) == 1 or {said.kind, given.kind} == {"angle", "temperature"}):
            yield (
                f"gives {name} in {unit}, though that name says {suffix}: correct the name or the unit with"
                " `decode setup`, or give the column to the gauge that shows it"
            )

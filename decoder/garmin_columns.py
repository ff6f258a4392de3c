"""The columns of a Garmin G1000 log, and which of our names belong into which.

Only what a G1000 has a column for can be told by name; anything else needs a name mapping.
"""

from __future__ import annotations

from dataclasses import dataclass

from decoder.parameter_names import engine_stem_of, stem_of

ENGINES = 2


@dataclass(frozen=True, slots=True)
class GarminColumn:
    """One column: its name in the log, its unit as the log writes it and as `decoder.units` knows it, its decimals."""

    name: str
    unit_text: str
    unit: str
    decimals: int = 1


_AIRCRAFT: dict[tuple[str, ...], GarminColumn] = {
    ("altitude", "alt", "altitude_baro", "altimeter"): GarminColumn("AltB", "ft Baro", "ft"),
    ("altimeter_setting", "baro", "qnh"): GarminColumn("BaroA", "inch", "inHg", 2),
    ("oat", "outside_air_temp"): GarminColumn("OAT", "deg C", "deg C"),
    ("airspeed", "ias", "indicated_airspeed"): GarminColumn("IAS", "kt", "kt"),
    ("ground_speed",): GarminColumn("GndSpd", "kt", "kt"),
    ("vertical_speed", "vsi", "vs"): GarminColumn("VSpd", "fpm", "fpm"),
    ("pitch",): GarminColumn("Pitch", "deg", "deg"),
    ("roll", "bank"): GarminColumn("Roll", "deg", "deg"),
    ("heading", "hdg"): GarminColumn("HDG", "deg", "deg"),
    ("volts", "bus_volts"): GarminColumn("volt1", "volts", "V"),
    ("amps", "bus_amps"): GarminColumn("amp1", "amps", "A"),
    ("fuel_left", "fuel_quantity_left"): GarminColumn("FQtyL", "gals", "gal", 2),
    ("fuel_right", "fuel_quantity_right"): GarminColumn("FQtyR", "gals", "gal", 2),
    ("tas", "true_airspeed"): GarminColumn("TAS", "kt", "kt"),
}
_ENGINE: dict[tuple[str, ...], GarminColumn] = {
    ("fuel_flow",): GarminColumn("FFlow", "gph", "gph", 2),
    ("oil_temp", "oil_temperature"): GarminColumn("OilT", "deg F", "deg F"),
    ("oil_press", "oil_pressure"): GarminColumn("OilP", "psi", "psi"),
    ("map", "manifold_pressure"): GarminColumn("MAP", "Hg", "inHg", 2),
    ("rpm", "engine_rpm"): GarminColumn("RPM", "rpm", "rpm"),
    ("torque", "trq"): GarminColumn("Torq", "%", "%"),
    ("ng",): GarminColumn("NG", "%", "%"),
    ("itt",): GarminColumn("ITT", "deg C", "deg C"),
    ("cht",): GarminColumn("CHT1", "deg F", "deg F"),
    ("egt",): GarminColumn("EGT1", "deg F", "deg F"),
    ("tit",): GarminColumn("TIT1", "deg F", "deg F"),
}

BLANK = (
    GarminColumn("AtvWpt", "ident", ""),
    GarminColumn("Latitude", "degrees", ""),
    GarminColumn("Longitude", "degrees", ""),
)
"""Columns that every log has and that no gauge shows; they stay empty."""


def _of_engine(column: GarminColumn, engine: int) -> GarminColumn:
    return GarminColumn(f"E{engine} {column.name}", column.unit_text, column.unit, column.decimals)


COLUMNS: tuple[GarminColumn, ...] = (
    *BLANK,
    *_AIRCRAFT.values(),
    *(_of_engine(column, engine) for engine in range(1, ENGINES + 1) for column in _ENGINE.values()),
)
"""All columns in their order in the log."""

BY_NAME = {column.name: column for column in COLUMNS}
_BY_STEM = {stem: column for stems, column in _AIRCRAFT.items() for stem in stems}
_BY_ENGINE_STEM = {stem: column for stems, column in _ENGINE.items() for stem in stems}


def column_of(name: str) -> GarminColumn | None:
    """The column that a name of ours belongs into; None if the name alone does not tell."""
    stem = stem_of(name)
    if stem in _BY_STEM:
        return _BY_STEM[stem]
    stem, engine = engine_stem_of(name)
    column = _BY_ENGINE_STEM.get(stem)
    return _of_engine(column, engine) if column is not None and engine <= ENGINES else None

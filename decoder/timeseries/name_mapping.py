"""Name mappings: a YAML file that says what our needles are called in somebody else's table, and in which unit.

airspeed_kt: IAS
altitude_ft: {name: PALT, unit: m}
rpm: {name: ENG RPM, unit: rpm, factor: 100}
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field, TypeAdapter, ValidationError

from decoder.panel.arrays import Number
from decoder.panel.description import Strict
from decoder.panel.errors import MappingError
from flight_file.documents import parse_yaml
from flight_file.errors import NotYamlError
from flight_file.untrusted import read_yaml_file


class MappedName(Strict):
    """What a needle is called elsewhere.

    `unit` is the unit there (of an export: the needle's own, where the flight data do not say it), `factor` what
    numbers are multiplied with before anything else.
    """

    name: str
    unit: str | None = None
    factor: Annotated[Number, Field(gt=0)] = 1.0


_MAPPING = TypeAdapter(dict[str, MappedName | str])


def read_mapping(path: Path) -> dict[str, MappedName]:
    """Read a mapping, by needle.

    Raises
    ------
    MappingError
        If it cannot be read or is no mapping.
    """
    try:
        found = _MAPPING.validate_python(parse_yaml(read_yaml_file(path)))
    except OSError as error:
        raise MappingError("", f"cannot be read: {error.strerror}", source=str(path)) from error
    except NotYamlError as error:
        raise MappingError(error.where, error.problem, source=str(path)) from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"] if part not in ("MappedName", "str"))
        problem = "must be a name, or {name: ..., unit: ..., factor: ...}"
        raise MappingError(where, problem, source=str(path)) from error
    return {needle: MappedName(name=what) if isinstance(what, str) else what for needle, what in found.items()}

"""Which field a problem belongs to, where the format judges a gauge or the panel as a whole."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

_GAUGE = re.compile(r"gauges\[(\d+)\]")
_NEEDLE = re.compile(r"needle (\w+): (?:(covered_by)|with `tail` a (template))")
_FIELD = re.compile(r"`(stops|wraps|combined|card|needles)`")
_COLUMN = re.compile(r"would be called (\w+);")
_SUFFIX = re.compile(r"_(status|score|sigma)$")


def field_of(path: str, problem: str, document: Mapping[str, Any]) -> str:
    """The path of the field that a problem is about: the one named in it, as far as there is such a field."""
    gauge = _GAUGE.fullmatch(path)
    if gauge is not None:
        return _in_gauge(path, problem, _gauges(document)[int(gauge[1])])
    column = _COLUMN.search(problem)
    if not path and column is not None:
        return _column(column[1], document)
    return path


def _in_gauge(path: str, problem: str, gauge: Mapping[str, Any]) -> str:
    needle = _NEEDLE.match(problem)
    if needle is not None:
        names = [each.get("name") for each in gauge.get("needles") or []]
        return f"{path}.needles[{names.index(needle[1])}].{needle[2] or needle[3]}"
    field = _FIELD.search(problem)
    return f"{path}.{field[1]}" if field is not None else path


def _column(column: str, document: Mapping[str, Any]) -> str:
    """The last needle, card or combined value whose name makes this column."""
    found = ""
    for number, gauge in enumerate(_gauges(document)):
        named = [(f"needles[{place}]", each) for place, each in enumerate(gauge.get("needles") or [])]
        named += [(part, gauge[part]) for part in ("card", "combined") if gauge.get(part)]
        for part, each in named:
            if each.get("name") in (column, _SUFFIX.sub("", column)):
                found = f"gauges[{number}].{part}.name"
    return found


def _gauges(document: Mapping[str, Any]) -> list[Any]:
    return list(document.get("gauges") or [])

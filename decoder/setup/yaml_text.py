"""`panel.yaml` as a person would write it: a gauge is a block, whatever belongs on one line stands on one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import yaml

PLACES = 4
HEAD = (
    "# Drawn with `decode setup`; docs/panel.md says what each key means.\n"
    "# Pixels are (x, y) in the panel picture, angles degrees clockwise from the right.\n"
)
BLOCKS = ("reference_points", "anchors", "gauges")
ORDER = ("name", "picture", "focal_length_mm", "reference_points", "level", "anchors", "gauges")
GAUGE_ORDER = ("name", "centre", "radius", "sweep", "stops", "unit", "scale", "wraps", "tail", "combined", "needles")


def panel_text(document: Mapping[str, Any]) -> str:
    """The text of a `panel.yaml` with this content."""
    lines = [HEAD.rstrip("\n")]
    for key in _ordered(document, ORDER):
        value = document[key]
        if key in BLOCKS and isinstance(value, list) and value:
            lines.append(f"{key}:")
            for item in value:
                lines += _gauge(item) if key == "gauges" else [f"  - {_flow(item)}"]
        else:
            lines.append(f"{_flow(key)}: {_flow(value)}")
    return "\n".join(lines) + "\n"


def _gauge(gauge: Mapping[str, Any]) -> list[str]:
    lines = []
    for key in _ordered(gauge, GAUGE_ORDER):
        if key == "needles":
            lines += ["    needles:", *(f"      - {_flow(needle)}" for needle in gauge[key])]
        else:
            lines.append(f"    {_flow(key)}: {_flow(gauge[key])}")
    return ["  - " + lines[0].lstrip(), *lines[1:]]


def _ordered(content: Mapping[str, Any], order: tuple[str, ...]) -> list[str]:
    return [key for key in order if key in content] + [key for key in content if key not in order]


def _flow(value: object) -> str:
    """A value on one line."""
    text: str = yaml.safe_dump(_plain(value), default_flow_style=True, width=10**9, allow_unicode=True, sort_keys=False)
    return text.strip().removesuffix("...").strip()


def _plain(value: object) -> object:
    if isinstance(value, float):
        return int(value) if value == int(value) else round(value, PLACES)
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return value

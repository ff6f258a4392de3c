"""`NAME.layout.json`: a layout for Foxglove that shows all of `NAME.mcap` at once, to be imported there.

The pictures with the readings drawn in stand to the left; to the right one plot for each unit, and a band with the
status of every value below. Values are drawn as points: a line would run through the gaps.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import IO, Any

from decoder.mcap_topics import ANNOTATIONS_TOPIC, topic_of
from flight_file.topics import IMAGE_TOPIC

IMAGE_PART = 58
PLOTS_PART = 76

Tree = str | dict[str, Any]


def write_layout(units: Iterable[tuple[str, str]], stream: IO[str]) -> None:
    """Writes the layout for values by their names and units."""
    json.dump(layout(units), stream, indent=2, ensure_ascii=False)
    stream.write("\n")


def layout(units: Iterable[tuple[str, str]]) -> dict[str, Any]:
    """The layout as Foxglove exports one."""
    by_unit: dict[str, list[str]] = {}
    names = []
    for name, unit in units:
        by_unit.setdefault(unit, []).append(name)
        names.append(name)
    plots = {f"Plot!values{number}": _plot(unit, of) for number, (unit, of) in enumerate(by_unit.items(), start=1)}
    right = _split("column", _stacked(list(plots)), "StateTransitions!status", PLOTS_PART)
    return {
        "configById": {"Image!camera": _image(), **plots, "StateTransitions!status": _states(names)},
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split("row", "Image!camera", right, IMAGE_PART),
    }


def _image() -> dict[str, Any]:
    return {
        "imageMode": {
            "imageTopic": IMAGE_TOPIC,
            "annotations": {ANNOTATIONS_TOPIC: {"visible": True}},
        },
        "synchronize": False,
        "foxglovePanelTitle": "Camera",
    }


def _plot(unit: str, names: list[str]) -> dict[str, Any]:
    return {
        "paths": [
            {
                "value": f"{topic_of(name)}.value",
                "label": name,
                "enabled": True,
                "timestampMethod": "receiveTime",
                "showLine": False,
                "lineSize": 2.5,
            }
            for name in names
        ],
        "foxglovePanelTitle": unit or "values",
        "yAxisLabel": unit,
        "xAxisVal": "timestamp",
        "isSynced": True,
        "showLegend": True,
        "legendDisplay": "floating",
        "showPlotValuesInLegend": True,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
    }


def _states(names: list[str]) -> dict[str, Any]:
    paths = [{"value": f"{topic_of(name)}.status", "label": name, "timestampMethod": "receiveTime"} for name in names]
    return {"paths": paths, "isSynced": True, "foxglovePanelTitle": "Status"}


def _stacked(panels: list[str]) -> Tree:
    """Panels one below the other, all of one height."""
    first, *others = panels
    return _split("column", first, _stacked(others), 100 / len(panels)) if others else first


def _split(direction: str, first: Tree, second: Tree, percentage: float) -> dict[str, Any]:
    return {"direction": direction, "first": first, "second": second, "splitPercentage": round(percentage, 2)}

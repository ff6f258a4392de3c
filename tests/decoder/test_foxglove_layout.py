"""The layout for Foxglove: it names what is in the file, and the committed one is what the code makes."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

from decoder.foxglove_layout import layout, write_layout
from decoder.panel_pictures import panel_from_file

ROOT = Path(__file__).parents[2]


def panels_of(tree: Any) -> list[str]:  # noqa: ANN401
    """The panels of a layout in their order on the screen."""
    return [tree] if isinstance(tree, str) else panels_of(tree["first"]) + panels_of(tree["second"])


def test_every_value_is_plotted_with_its_unit_and_status() -> None:
    """Values of one unit share a plot; every status has a band; every panel that is laid out is configured."""
    made = layout([("n1_pct", "%"), ("ias_kt", "kt"), ("n2_pct", "%")])
    config = made["configById"]

    assert sorted(panels_of(made["layout"])) == sorted(config)
    plots = [panel for name, panel in config.items() if name.startswith("Plot!")]
    assert [[path["value"] for path in plot["paths"]] for plot in plots] == [
        ["/n1_pct.value", "/n2_pct.value"],
        ["/ias_kt.value"],
    ]
    assert all(path["enabled"] and not path["showLine"] for plot in plots for path in plot["paths"])
    assert [path["value"] for path in config["StateTransitions!status"]["paths"]] == [
        "/n1_pct.status",
        "/ias_kt.status",
        "/n2_pct.status",
    ]
    assert config["Image!camera"]["imageMode"]["imageTopic"] == "/camera/image"
    assert "/camera/annotations" in config["Image!camera"]["imageMode"]["annotations"]


def test_committed_layout_is_that_of_the_demo() -> None:
    """docs/foxglove-layout.json is what `decode --format layout` gives for the demo flight."""
    panel = panel_from_file(ROOT / "fixtures" / "panel.yaml").panel
    stream = io.StringIO()
    write_layout([(quantity.name, quantity.unit) for quantity in panel.quantities], stream)

    assert json.loads((ROOT / "docs" / "foxglove-layout.json").read_text(encoding="utf-8")) == json.loads(
        stream.getvalue()
    )

"""What is saved: a text that says what was drawn, files that are whole or untouched, names that lead nowhere else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from decoder.errors import OutputError, PanelError
from decoder.panel import parse_panel
from decoder.setup.saving import plain_name, save_files
from decoder.setup.yaml_text import panel_text

FIXTURES = Path(__file__).parents[2] / "fixtures"

numbers = st.floats(-5000, 5000).map(lambda value: round(value, 4)) | st.integers(-5000, 5000)
keys = st.from_regex(r"[a-z][a-z_]{0,11}", fullmatch=True)
words = st.text(st.characters(exclude_categories=("C", "Z")), max_size=20)
values = st.recursive(
    st.none() | st.booleans() | numbers | words,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(keys, inner, max_size=4),
    max_leaves=12,
)


@pytest.mark.parametrize("panel", [FIXTURES / "panel.yaml", FIXTURES / "oblique" / "t1a_small" / "panel.yaml"])
def test_text_says_what_was_drawn(panel: Path) -> None:
    """A panel's content written and read again is the same panel."""
    content = yaml.safe_load(panel.read_text(encoding="utf-8"))

    assert yaml.safe_load(panel_text(content)).keys() == content.keys()
    for gauge, own in zip(parse_panel(panel_text(content)).gauges, content["gauges"], strict=True):
        assert gauge.name == own["name"]
        assert [angle for angle, _ in gauge.scale] == pytest.approx(sorted(a for a, _ in own["scale"]), abs=1e-4)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])  # PyYAML is slow
@given(
    content=st.dictionaries(keys, values, max_size=6),
    gauges=st.lists(st.dictionaries(keys, values, min_size=1, max_size=4), max_size=3),
)
def test_any_content_comes_back(content: dict[str, Any], gauges: list[dict[str, Any]]) -> None:
    """Keys that the page does not know are kept, and values of any kind are read back as they were."""
    content = {key: value for key, value in content.items() if key not in ("gauges", "anchors", "reference_points")}
    whole = content | {
        "gauges": [{"name": "g"} | {key: gauge[key] for key in gauge if key != "needles"} for gauge in gauges]
    }

    assert yaml.safe_load(panel_text(whole)) == whole


@pytest.mark.parametrize("name", ["../panel.jpg", "/etc/passwd", "a/b.jpg", "..", ".hidden", "", "a\\b.jpg", "a\0.jpg"])
def test_names_that_lead_elsewhere_are_refused(name: str) -> None:
    """A picture lies beside its panel.yaml and nowhere else."""
    with pytest.raises(PanelError, match="plain name"):
        plain_name(name, "picture")


def test_files_are_whole_or_untouched(tmp_path: Path) -> None:
    """When one file cannot be put in place, panel.yaml is as it was and nothing is left behind."""
    (tmp_path / "panel.yaml").write_bytes(b"old")
    (tmp_path / "panel.jpg").mkdir()
    with pytest.raises(OutputError, match="cannot be saved"):
        save_files(tmp_path, {"panel.jpg": b"picture", "panel.yaml": b"new"})

    assert (tmp_path / "panel.yaml").read_bytes() == b"old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["panel.jpg", "panel.yaml"]

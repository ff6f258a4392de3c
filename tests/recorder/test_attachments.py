"""What travels inside the segments."""

from __future__ import annotations

from pathlib import Path

import pytest

from recorder.attachments import gather_attachments
from recorder.errors import ConfigurationError
from recorder.settings import AttachSettings

PANEL = """
name: x
picture: panel.jpg
gauges:
  - needles:
      - {name: a, template: {at: 214.0, span: 14}}
      - {name: b, template: {picture: needles/fr.png}}
"""


def test_panel_brings_the_pictures_it_names(tmp_path: Path) -> None:
    """Every `picture` at any depth is attached under the name that the panel uses for it."""
    (tmp_path / "panel.yaml").write_text(PANEL)
    (tmp_path / "panel.jpg").write_bytes(b"1")
    (tmp_path / "needles").mkdir()
    (tmp_path / "needles/fr.png").write_bytes(b"2")
    (tmp_path / "lens.yaml").write_bytes(b"3")
    settings = AttachSettings(panel=tmp_path / "panel.yaml", camera=tmp_path / "lens.yaml")

    assert gather_attachments(settings, b"4") == {
        "panel.yaml": PANEL.encode(),
        "panel.jpg": b"1",
        "needles/fr.png": b"2",
        "camera.yaml": b"3",
        "recorder.yaml": b"4",
    }


def test_nothing_to_attach_is_nothing() -> None:
    """No settings and no configuration: no attachments."""
    assert gather_attachments(AttachSettings(), b"") == {}


@pytest.mark.parametrize(
    ("panel", "sentence"),
    [
        ("picture: ../secret.jpg", "must lie in the panel's folder"),
        ("picture: /etc/passwd", "must lie in the panel's folder"),
        ("picture: camera.yaml", "must lie in the panel's folder"),
        ("picture: gone.jpg", r"attach\.panel: .*gone\.jpg cannot be read"),
        ("picture: [", "is not YAML"),
    ],
)
def test_panel_that_cannot_travel_is_one_sentence(tmp_path: Path, panel: str, sentence: str) -> None:
    """Pictures outside of the panel's folder, missing ones, and a panel that is no YAML."""
    path = tmp_path / "panel.yaml"
    path.write_text(panel)

    with pytest.raises(ConfigurationError, match=sentence):
        gather_attachments(AttachSettings(panel=path), b"")

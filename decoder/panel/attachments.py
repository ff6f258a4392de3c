"""The names under which a flight file carries what the desk needs."""

from __future__ import annotations

PANEL_FILE = "panel.yaml"
CAMERA_FILE = "camera.yaml"

"""What stands in windows, one of each kind, as `panel.yaml` has it: drawn on the set-up page, and spoilt elsewhere."""

from __future__ import annotations

from typing import Any

WINDOW = [[80, 60], [160, 60], [160, 84], [80, 84]]
IN_WINDOWS: dict[str, dict[str, Any]] = {
    "lamp": {"name": "lamp_on", "lit": True},
    "digits": {"name": "squawk", "pattern": "#000", "shows": " 720", "text": True},
    "printed": {"name": "setting", "pattern": "00.00", "shows": "29.92", "rolls": "up", "pitch": 20, "gap": 0.4},
    "linear": {"name": "trim_pct", "moves": "across", "marks": [[90, 0], [150, 100]], "at": [120.5, 70], "span": 20},
    "tape": {
        "name": "compass_deg",
        "moves": "across",
        "index": 120,
        "marks": [[[place, 72], value] for place, value in ((85, 310), (108, 320), (130, 330), (155, 340))],
        "turn": 360,
        "drum": True,
    },
}

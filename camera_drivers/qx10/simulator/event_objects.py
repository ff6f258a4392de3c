"""The answer to `getEvent`: a row of 35 places, each for an object of its own type; null where there is nothing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from camera_drivers.qx10.simulator.methods import CHOICES

PLACES = 35  # of version 1.0

# Where the settings stand in the row.
_SETTINGS = {"BeepMode": 11, "ExposureMode": 18, "PostviewImageSize": 19, "SelfTimer": 20, "ShootMode": 21}


def snapshot(
    *,
    names: list[str],
    status: str,
    zoom_percent: int,
    liveview: bool,
    told: str,
    room: int,
    settings: Mapping[str, object],
) -> list[Any]:
    """All that the camera tells.

    Parameters
    ----------
    told
        Address of a picture that it tells of by itself; empty for none.
    room
        Pictures that the memory card has room for.
    """
    row: list[Any] = [None] * PLACES
    row[0] = {"type": "availableApiList", "names": names}
    row[1] = {"type": "cameraStatus", "cameraStatus": status}
    row[2] = {
        "type": "zoomInformation",
        "zoomPosition": zoom_percent,
        "zoomNumberBox": 1,
        "zoomIndexCurrentBox": 0,
        "zoomPositionCurrentBox": zoom_percent,
    }
    row[3] = {"type": "liveviewStatus", "liveviewStatus": liveview}
    row[5] = [{"type": "takePicture", "takePictureUrl": [told]}] if told else []
    row[10] = [
        {
            "type": "storageInformation",
            "storageID": "Memory Card 1",
            "recordTarget": True,
            "numberOfRecordableImages": room,
            "recordableTime": -1,
            "storageDescription": "Storage Media",
        }
    ]
    for name, place in _SETTINGS.items():
        kind = name[0].lower() + name[1:]
        current = {f"current{name}": settings[name], f"{kind}Candidates": list(CHOICES[name].candidates)}
        row[place] = {"type": kind} | current
    return row

"""The simulated camera's calls by mode, the values of its settings, and its answers to `getEvent`.

From recorded lists of a real one: 50 names in the automatic modes, 59 in Program Auto, fewer for movies. The answer to
`getEvent` is a row of 35 places, each for an object of its own type; null where there is nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

_KINDS = ("set", "get", "getSupported", "getAvailable")
_ALWAYS = (
    *("getMethodTypes", "getAvailableApiList", "getApplicationInfo", "getVersions", "getEvent"),
    *("startLiveview", "stopLiveview", "actTakePicture", "awaitTakePicture", "startMovieRec", "stopMovieRec"),
    *("actZoom", "actFormatStorage", "getStorageInformation"),
)
_STILL = (
    *("setTouchAFPosition", "cancelTouchAFPosition", "getTouchAFPosition"),
    *("actHalfPressShutter", "cancelHalfPressShutter"),
    *("getSupportedExposureCompensation", "getSupportedWhiteBalance", "getSupportedIsoSpeedRate"),
)
_FAMILIES = ("ShootMode", "BeepMode", "CameraFunction")
_STILL_FAMILIES = ("SelfTimer", "PostviewImageSize", "ExposureMode", "StillSize")
_PROGRAM_FAMILIES = ("ExposureCompensation", "WhiteBalance", "IsoSpeedRate")
FORBIDDEN = frozenset(f"{kind}CameraFunction" for kind in _KINDS)
"""Listed, and answered with 403 all the same."""
SYSTEM_METHODS = ("getMethodTypes", "getVersions", "setCurrentTime")
PLACES = 35  # of version 1.0
# Where the settings stand in the row.
_SETTINGS = {"BeepMode": 11, "ExposureMode": 18, "PostviewImageSize": 19, "SelfTimer": 20, "ShootMode": 21}


@dataclass(frozen=True, slots=True)
class Choice:
    """A setting: its initial value, and its possible values."""

    first: object
    candidates: tuple[object, ...]


CHOICES: dict[str, Choice] = {
    "ShootMode": Choice("still", ("still", "movie")),
    "ExposureMode": Choice("Intelligent Auto", ("Intelligent Auto", "Superior Auto", "Program Auto")),
    "PostviewImageSize": Choice("2M", ("2M", "Original")),
    "SelfTimer": Choice(0, (0, 2, 10)),
    "BeepMode": Choice("On", ("Shutter Only", "On", "Off")),
    "StillSize": Choice(("4:3", "18M"), (("4:3", "18M"), ("4:3", "5M"), ("16:9", "13M"), ("16:9", "2M"))),
    "ExposureCompensation": Choice(0, tuple(range(-6, 7))),
    "IsoSpeedRate": Choice("AUTO", ("AUTO", "100", "200", "400", "800", "1600", "3200")),
    "WhiteBalance": Choice(
        "Auto WB",
        (
            *("Auto WB", "Daylight", "Cloudy", "Incandescent"),
            *("Fluorescent: Cool White (0)", "Fluorescent: Day White (+1)", "Fluorescent: Daylight (+2)"),
        ),
    ),
}


def offered(shoot_mode: object, exposure_mode: object) -> list[str]:
    """List the names in `getAvailableApiList`."""
    families, names = [*_FAMILIES], [*_ALWAYS]
    if shoot_mode == "still":
        names += _STILL
        families += _STILL_FAMILIES
        if exposure_mode == "Program Auto":
            families += _PROGRAM_FAMILIES
    names += [f"{kind}{family}" for family in families for kind in _KINDS]
    return list(dict.fromkeys(names))


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
    """Build the answer to `getEvent`.

    Parameters
    ----------
    told
        Address of a picture that it announces unasked; empty for none.
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

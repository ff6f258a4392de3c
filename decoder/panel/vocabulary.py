"""Words of files and of the command line that are known before any library is loaded."""

from __future__ import annotations

from enum import StrEnum

# Under these names a flight file carries what the desk needs.
PANEL_FILE = "panel.yaml"
CAMERA_FILE = "camera.yaml"


class Method(StrEnum):
    """How the best row is found: by normalized or by plain cross-correlation."""

    NORMXCORR = "normxcorr"
    XCORR = "xcorr"

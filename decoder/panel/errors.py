"""What can go wrong at the desk, as one tree.

DecoderError                  the decode cannot give what was asked for; one sentence that says what to do
├── DescriptionError          what somebody wrote in YAML is wrong at some place
│   ├── PanelError            the panel's description is wrong or does not fit its picture
│   │   └── PanelMissing      neither the flight file nor the command line brings a panel
│   ├── MeasurementsError     the list of a ruler's photographs is wrong
│   ├── CameraError           the camera's description is wrong or does not fit a picture
│   └── MappingError          a file of names and units is wrong
├── PictureError              one picture cannot be used; the frame is `missing`, the flight goes on
│   └── AlignmentLost         the panel is not found in it
├── FlightUnreadable          no frame of the flight can be read with this panel
├── CalibrationError          photographs, points or options from which no camera can be calibrated
│   └── PoseError             no camera position follows from reference points
│       └── DegeneratePoints  they lie on one line, or nearly
├── SoundMissing              the engine is to be heard in a flight without sound
├── PartError                 a part of the flight was asked for that has no frames
├── WorkersLost               processes that read frames end one after the other
├── OutputError               the flight data cannot be written where they should go
├── FleetError                many flights cannot be decoded as they were asked for
│   ├── StoreError            a place that holds flights or results does not give or take a file
│   ├── VersionMismatch       workers would not decode as this machine does
│   └── ClusterLost           the scheduler or its workers cannot be reached
├── UnitError                 a unit that is not known, or not of the kind of another
└── TableError                a CSV file is not what it should be
    └── AccuracyError         flight data and truth cannot be compared
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence


class DecoderError(Exception):
    """The base of every expected failure of the decoder."""


class DescriptionError(DecoderError):
    """What somebody wrote in YAML is wrong at `path` (such as `gauges[2].sweep`; "" for all of it)."""

    def __init__(self, path: str, problem: str, *, source: str) -> None:
        self.path = path
        self.problem = problem
        self.source = source
        super().__init__(f"{source}: {path}: {problem}" if path else f"{source}: {problem}")


class PanelError(DescriptionError):
    """The panel's description is wrong."""

    def __init__(self, path: str, problem: str, *, source: str = "panel.yaml") -> None:
        super().__init__(path, problem, source=source)


class CameraError(DescriptionError):
    """The camera's description is wrong, or it does not cover a picture's focal length or shape."""

    def __init__(self, path: str, problem: str, *, source: str = "camera.yaml") -> None:
        super().__init__(path, problem, source=source)


class MeasurementsError(DescriptionError):
    """The list of a ruler's photographs is wrong."""


class MappingError(DescriptionError):
    """A file that maps names and units is wrong."""


class PanelMissing(PanelError):
    """Neither the flight file nor the command line brings a panel; `why_lost` if the flight file did."""

    def __init__(self, flight: str, why_lost: str = "") -> None:
        draw = f"it carries no panel; draw one with decode setup {shlex.quote(flight)}, and name it with --panel"
        super().__init__("", f"its panel cannot be read: {why_lost}" if why_lost else draw, source=flight)


class PictureError(DecoderError):
    """One picture cannot be used."""


class AlignmentLost(PictureError):
    """The panel was not found in a frame; `failed` are the features that did not match."""

    def __init__(self, message: str, failed: Sequence[str] = ()) -> None:
        self.failed = tuple(failed)
        super().__init__(message)


class FlightUnreadable(DecoderError):
    """No frame of the flight can be read with this panel."""


class CalibrationError(DecoderError):
    """Photographs, points or options from which no camera can be calibrated."""


class PoseError(CalibrationError):
    """No camera position follows from the reference points."""


class DegeneratePoints(PoseError):
    """The reference points lie on one line, or nearly, so that any turn about it fits."""


class SoundMissing(DecoderError):
    """The engine is to be heard in a flight without sound."""


class PartError(DecoderError):
    """A part of the flight was asked for that has no frames."""


class WorkersLost(DecoderError):
    """Processes that read frames end one after the other; `how` says how the last one did."""

    def __init__(self, how: str) -> None:
        super().__init__(f"the processes that read frames keep ending, the last one {how}; try --jobs 1")


class OutputError(DecoderError):
    """The flight data cannot be written where they should go."""


class FleetError(DecoderError):
    """Many flights cannot be decoded as they were asked for."""


class StoreError(FleetError):
    """A place that holds flights or results does not give or take a file."""


class VersionMismatch(FleetError):
    """Workers would not decode as this machine does."""


class ClusterLost(FleetError):
    """The scheduler or its workers cannot be reached."""


class UnitError(DecoderError):
    """A unit that is not known, or not of the kind of another."""


class TableError(DecoderError):
    """A CSV file is not what it should be."""


class AccuracyError(TableError):
    """Flight data and truth cannot be compared."""

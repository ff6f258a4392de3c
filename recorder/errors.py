"""What can be expected to go wrong with the recorder itself.

    RecorderError
    └── ConfigurationError       recorder.yaml, or a file it names, is not as it should be

Beside these there are flight_file.errors.FlightFileError (the disk) and camera_drivers.errors.CameraError (the
camera). Each message is one sentence that says what to do.
"""

from __future__ import annotations


class RecorderError(Exception):
    """Base of everything this package raises on purpose."""


class ConfigurationError(RecorderError):
    """The configuration is wrong; starting again does not help."""

"""What a camera, or what stands in for one, can do wrong.

    CameraError
    └── CameraUnusableError      trying again does not help; a person has to do something
        └── ReplayError          the pictures or flight files cannot be replayed

Each message is one sentence that says what to do.
"""

from __future__ import annotations


class CameraError(Exception):
    """Base of everything a camera driver raises on purpose."""


class CameraUnusableError(CameraError):
    """Trying again does not help."""


class ReplayError(CameraUnusableError):
    """The pictures or flight files cannot be replayed as they are."""

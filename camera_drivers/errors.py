"""The expected errors of a camera or its substitute.

    CameraError                  connecting again may help
    ├── CameraNotFoundError      nothing there answers as a camera
    ├── CameraUnreachableError   a call did not reach the camera
    ├── CameraSilentError        a call got no usable answer; it may have been carried out all the same
    ├── CameraRefusedError       a call was answered with an error code
    └── CameraUnusableError      trying again does not help; a person must act
        └── ReplayError          the pictures or flight files cannot be replayed

Each message is one sentence that says what to do.
"""

from __future__ import annotations


class CameraError(Exception):
    """Base of everything a camera driver raises on purpose."""


class CameraNotFoundError(CameraError):
    """There is no camera where it was looked for, or the device there is not one."""


class _UnansweredError(CameraError):
    """A call got no usable answer.

    Attributes
    ----------
    problem
        What was wrong with it, in a few words without numbers.
    """

    def __init__(self, call: str, problem: str) -> None:
        super().__init__(f"{call}: {problem}; check that the camera is on and in reach.")
        self.problem = problem


class CameraUnreachableError(_UnansweredError):
    """The camera certainly did not get a call."""


class CameraSilentError(_UnansweredError):
    """The camera may have got a call, and so may have carried it out."""


class CameraRefusedError(CameraError):
    """A call was answered with an error; only the code is meaningful."""

    def __init__(self, call: str, code: int) -> None:
        super().__init__(f"{call}: the camera refuses it (error {code}); look the code up in docs/qx10.md.")
        self.call = call
        self.code = code


class CameraUnusableError(CameraError):
    """The camera or its configuration needs a person; retrying does not help."""


class ReplayError(CameraUnusableError):
    """The pictures or flight files cannot be replayed as they are."""

"""What a process that reads frames answers: outcomes as plain numbers, which cost little to send and to take apart."""

from __future__ import annotations

from typing import Any

from decoder.alignment import Alignment
from decoder.frame_batch import Outcome, Unread
from decoder.panel_reader import FrameReadings
from decoder.reading import Reading, Status

STATUSES = tuple(Status)
CODE = {status: code for code, status in enumerate(STATUSES)}

Told = Unread | tuple[Any, ...]


def told(outcome: Outcome) -> Told:
    """An outcome to be sent; without the alignment's covariance, which has done its work when the frame is read."""
    if isinstance(outcome, Unread):
        return outcome
    seen = outcome.alignment
    readings = [
        (name, CODE[own.status], own.angle_deg, own.sigma_deg, own.score) for name, own in outcome.readings.items()
    ]
    alignment = (seen.elements, seen.score, seen.failed, seen.lens)
    return (alignment, readings, outcome.alignment_sigma_px, outcome.dial_shifts_px)


def understood(answer: Told) -> Outcome:
    """The outcome that was sent."""
    if isinstance(answer, Unread):
        return answer
    alignment, readings, sigma_px, shifts_px = answer
    own = {name: Reading(STATUSES[code], *numbers) for name, code, *numbers in readings}
    return FrameReadings(Alignment(*alignment), own, sigma_px, shifts_px)

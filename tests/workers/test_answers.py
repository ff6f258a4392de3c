"""What workers answer: understood as it was read, but for what is not told."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Protocol

import pytest

from decoder.answers import told, understood
from decoder.frame_batch import Batch, LeftOut, Outcome, Unread, read_batch
from decoder.panel_reader import FrameReadings, PanelReader


class Fitted(Protocol):
    """As the fixture gives it."""

    reader: PanelReader
    batches: tuple[Batch, ...]


@pytest.mark.parametrize("outcome", [Unread("anchor a not found", ("a", "level")), LeftOut("was killed")])
def test_reason_is_told(outcome: Outcome) -> None:
    """Why a frame was not read, and of what kind that was."""
    assert understood(pickle.loads(pickle.dumps(told(outcome)))) == outcome  # noqa: S301 - our own


def test_readings_are_told_to_the_bit(fitted: Fitted) -> None:
    """All of them, with the alignment; its covariance has done its work."""
    for read in read_batch(fitted.reader, fitted.batches[0]):
        assert isinstance(read, FrameReadings)
        answer = understood(pickle.loads(pickle.dumps(told(read))))  # noqa: S301 - our own
        moved = replace(read, dial_shifts_px=((0.5, -0.25),))

        assert isinstance(answer, FrameReadings)
        assert answer == read
        assert answer.alignment.covariance is None
        assert understood(told(moved)) == moved

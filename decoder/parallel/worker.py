"""The work of a process that reads frames, and the plain form in which readings are sent and stored in a journal."""

from __future__ import annotations

import pickle
from contextvars import ContextVar
from dataclasses import replace
from typing import Any

import cv2
from threadpoolctl import threadpool_limits

from decoder.imaging.alignment import Alignment
from decoder.instruments.frame_batch import Batch, Outcome, Unread, read_batch
from decoder.instruments.panel_reader import PanelReader
from decoder.instruments.reading import FrameReadings, Reading, Status
from decoder.panel.lens import DistortionModel, Lens, distortion_of

Packed = dict[str, Any]
"""An outcome as JSON can hold it."""

_READER: ContextVar[PanelReader] = ContextVar("reader")


def pack(outcome: Outcome) -> Packed:
    """Reduce an outcome to plain values, without the alignment's covariance, which is not needed any more."""
    if isinstance(outcome, Unread):
        return {"reason": outcome.reason, "failed": outcome.failed}
    alignment = outcome.alignment
    return {
        "elements": alignment.elements,
        "score": alignment.score,
        "failed": alignment.failed,
        "lens": None if alignment.lens is None else _packed_lens(alignment.lens),
        "shifts_px": outcome.dial_shifts_px,
        "readings": {
            name: (reading.status.value, reading.angle_deg, reading.sigma_deg, reading.score)
            for name, reading in outcome.readings.items()
        },
    }


def unpack(packed: Packed) -> Outcome:
    """Undo `pack`, to the last bit."""
    failed = tuple(packed["failed"])
    if "reason" in packed:
        return Unread(packed["reason"], failed)
    lens = None if packed["lens"] is None else _lens(*packed["lens"])
    return FrameReadings(
        Alignment(tuple(packed["elements"]), packed["score"], failed, lens),
        {name: Reading(Status(status), *numbers) for name, (status, *numbers) in packed["readings"].items()},
        tuple((x, y) for x, y in packed["shifts_px"]),
    )


def _packed_lens(lens: Lens) -> tuple[Any, ...]:
    bend, scale = lens.distortion, (lens.pixels_per_radian, lens.pixels_per_radian_sigma)
    return lens.size_px, lens.principal_point_px, *scale, bend.model.value, bend.coefficients


def _lens(size_px: Any, middle_px: Any, scale: float, sigma: float, model: str, coefficients: Any) -> Lens:  # noqa: ANN401, PLR0917 - lists, as JSON has them
    bend = distortion_of(DistortionModel(model), coefficients)
    return Lens(tuple(size_px), tuple(middle_px), scale, sigma, bend)


def recipe(reader: PanelReader) -> bytes:
    """Return everything needed to make the same reader in another process."""
    return pickle.dumps(
        (reader.source, reader.method, reader.appearance, reader.placement), protocol=pickle.HIGHEST_PROTOCOL
    )


def begin_reading(told: bytes) -> None:
    """Make this process's reader from its recipe."""
    cv2.setNumThreads(1)
    threadpool_limits(1)
    _READER.set(PanelReader.of(*pickle.loads(told)))  # noqa: S301 - from the process that started us


def without_pictures(frames: Batch) -> Batch:
    """Return frames as they are sent, since each process decompresses its own."""
    return tuple(replace(frame, picture=None) for frame in frames)


def read_packed(batch: Batch) -> list[Packed]:
    """Read a batch with this process's reader."""
    return [pack(outcome) for outcome in read_batch(_READER.get(), batch)]

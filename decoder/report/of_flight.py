"""A decoded flight as what its report is made of; the recording's integrity is checked here."""

from __future__ import annotations

from typing import TYPE_CHECKING

from decoder.report.integrity import checked
from decoder.report.report import Report
from flight_file.session import Session
from flight_file.verification import verify

if TYPE_CHECKING:
    from decoder.formats import Decoded


def report_of(decoded: Decoded) -> Report:
    """The report of a flight; reads the flight file once to see whether it is as it was recorded.

    Raises
    ------
    FlightNotReadableError
        If the disk fails or a file vanishes meanwhile.
    """
    flight = decoded.flight
    return Report(
        data=decoded.data,
        source=decoded.source,
        camera=decoded.camera,
        provenance=decoded.provenance,
        frames=decoded.frames,
        checked=checked(verify(flight.paths)),
        recorded_by=_recorded_by(flight.session),
        command=decoded.command,
        name=decoded.name,
        truth=decoded.truth,
    )


def _recorded_by(session: Session) -> list[tuple[str, str]]:
    """What the recording says of itself."""
    versions = ", ".join(f"{name} {version}" for name, version in session.versions.items())
    camera = " ".join(filter(None, [session.camera_model, session.camera_serial])) or session.camera_driver
    says = {
        "recorded with": versions,
        "camera": camera,
        "recorder's clock": session.clock,
        "recorder's host": session.host,
    }
    return [(what, text) for what, text in says.items() if text]

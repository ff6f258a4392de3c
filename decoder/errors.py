"""What can go wrong at the desk, as one tree.

DecoderError                  the decode cannot give what was asked for; one sentence that says what to do
├── PanelError                the panel's description is wrong or does not fit its picture
│   └── PanelMissing          neither the flight file nor the command line brings a panel
├── PictureError              one picture cannot be used; the frame is `missing`, the flight goes on
├── FlightUnreadable          no frame of the flight can be read with this panel
├── OutputError               the flight data cannot be written where they should go
└── AccuracyError             flight data and truth cannot be compared
"""

from __future__ import annotations


class DecoderError(Exception):
    """The base of every expected failure of the decoder."""


class PanelError(DecoderError):
    """The panel's description is wrong at `path` (such as `gauges[2].sweep`)."""

    def __init__(self, path: str, problem: str, *, source: str = "panel.yaml") -> None:
        self.path = path
        self.problem = problem
        self.source = source
        super().__init__(f"{source}: {path}: {problem}" if path else f"{source}: {problem}")


class PanelMissing(PanelError):
    """Neither the flight file nor the command line brings a panel."""

    def __init__(self, flight: str) -> None:
        super().__init__("", "it carries no panel; name one with --panel PANEL.yaml", source=flight)


class PictureError(DecoderError):
    """One picture cannot be used."""


class FlightUnreadable(DecoderError):
    """No frame of the flight can be read with this panel."""


class OutputError(DecoderError):
    """The flight data cannot be written where they should go."""


class AccuracyError(DecoderError):
    """Flight data and truth cannot be compared."""

"""What the rest of the program needs of a kind of instrument: one protocol.

How a kind is described and drawn is in `decoder.panel.kind`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from decoder.imaging.planes import Squeeze
from decoder.imaging.unwrapping import Grid, UnwrappedGauge
from decoder.instruments.appearance import Appearance, DrawnInstrument, Instrument, LearnedPicture, Look
from decoder.instruments.sampling import GaugeSampler, Part, Reader, SeenGauge
from decoder.panel.gauge import Gauge
from decoder.panel.vocabulary import Method
from decoder.registration.pivot import Pivot


class Kind(Protocol):
    """One kind of instrument: all that the rest of the program needs of it."""

    is_searched: bool
    """Whether its gauges are searched on every third row and column of each frame."""

    def owns(self, gauge: Gauge) -> bool:
        """Whether a gauge is of this kind."""
        ...

    def sampled_part(self, grid: Grid) -> Part:
        """Return the rows and columns of a gauge that its reader takes from the sampler as a strip."""
        ...

    def reader(
        self, instruments: Sequence[Instrument], appearance: Appearance, sampler: GaugeSampler, method: Method
    ) -> Reader:
        """Return a reader of all gauges of this kind on a panel."""
        ...

    def first_look(self, drawn: DrawnInstrument) -> Look:
        """Return its look from the panel's pictures alone.

        Raises
        ------
        PanelError
            If they do not show it.
        """
        ...

    def learned_pictures(
        self, instrument: Instrument, strips: Sequence[UnwrappedGauge], known: Mapping[str, LearnedPicture]
    ) -> Mapping[str, LearnedPicture]:
        """Learn, by quantity and from a sample's frames in one light, its look beyond face and templates."""
        ...

    def hidden_look(
        self, instrument: Instrument, appearance: Appearance, strips: Sequence[UnwrappedGauge]
    ) -> Look | None:
        """Learn what the panel picture hides from a sample's frames in its light; None if there is nothing to learn."""
        ...

    def pivot(self, instrument: Instrument, appearance: Appearance, frames: Sequence[SeenGauge]) -> Pivot:
        """Estimate where it turns, relative to where it is unwrapped, from a sample's frames and their readings."""
        ...

    def far_pivot(self, instrument: Instrument, strips: Sequence[UnwrappedGauge]) -> tuple[float, float] | None:
        """Return how far from its centre it turns, (x, y) px in its own plane; None if it is near, or unknown.

        `strips` are a sample's frames in the panel picture's light.
        """
        ...

    def squeeze(self, instrument: Instrument, strips: Sequence[UnwrappedGauge], *, is_lost: bool) -> Squeeze | None:
        """Return how it appears squeezed, since it is seen from aside, in a sample's frames.

        None if it is unknown, or does not matter: what `is_lost` is squared up, and what is read has to allow for it.
        """
        ...

    def seen_deg(
        self, instrument: Instrument, own: UnwrappedGauge, strips: Sequence[UnwrappedGauge]
    ) -> Sequence[tuple[float, float]]:
        """Return, for what turns, where it is drawn and where the panel picture shows it around its pivot.

        What a picture cannot tell (a card), or what never moves, is left out.
        """
        ...

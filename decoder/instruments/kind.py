"""The protocol by which a kind of instrument is learned and read.

The one by which it is described and drawn is in `decoder.panel.kind`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from decoder.imaging.planes import Squeeze
from decoder.imaging.unwrapping import Grid, UnwrappedGauge
from decoder.instruments.appearance import Appearance, DrawnInstrument, Grower, Instrument, LearnedPicture, Look, Placed
from decoder.instruments.sampling import GaugeSampler, Part, Reader, SeenGauge
from decoder.panel.gauge import Gauge
from decoder.panel.vocabulary import Method
from decoder.registration.pivot import Pivot


class Kind(Protocol):
    """One kind of instrument, as the rest of the program learns and reads it."""

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
        """Learn its look beyond face and templates from a sample's frames in one light; the result is by quantity."""
        ...

    def settled_pictures(
        self, instrument: Instrument, strips: Sequence[UnwrappedGauge], known: Mapping[str, LearnedPicture]
    ) -> Mapping[str, LearnedPicture]:
        """Learn what takes too long to be learned at each place that its pivot is moved through, once it has settled.

        What is given and returned is as in `learned_pictures`; nothing if all of it is known.
        """
        ...

    def unexplained(self, placed: Placed, drawn: UnwrappedGauge, strips: Sequence[UnwrappedGauge]) -> float | None:
        """Return the part of a sample's frames that is left unexplained once it has learned from them.

        The panel picture, `drawn`, and the frames are in one grey: luma, or an extreme of all colours. None if the kind
        does not compare greys in this way, since learning takes too long to be repeated for each, or if what moves has
        one colour only.
        """
        ...

    def grower(self, instrument: Instrument, appearance: Appearance) -> Grower | None:
        """Return what learns the rest of a look that no one frame shows whole; None if one does, or all is known."""
        ...

    def hidden_look(
        self, instrument: Instrument, appearance: Appearance, strips: Sequence[UnwrappedGauge]
    ) -> Look | None:
        """Learn, from a sample's frames in the panel picture's light, what that picture hides; None if nothing."""
        ...

    def pivot(self, instrument: Instrument, appearance: Appearance, frames: Sequence[SeenGauge]) -> Pivot:
        """Estimate where it turns, relative to where it is unwrapped, from a sample's frames and their readings."""
        ...

    def far_pivot(self, instrument: Instrument, strips: Sequence[UnwrappedGauge]) -> tuple[float, float] | None:
        """Return its pivot relative to its centre, (x, y) px in its own plane; None if that is near, or unknown.

        `strips` are a sample's frames in the panel picture's light.
        """
        ...

    def squeeze(self, instrument: Instrument, strips: Sequence[UnwrappedGauge], *, is_lost: bool) -> Squeeze | None:
        """Return how an oblique view squeezes it in a sample's frames; None if that is unknown or does not matter.

        An instrument that `is_lost` is then squared up; the uncertainty of one that is read allows for the squeeze.
        """
        ...

    def seen_deg(
        self, instrument: Instrument, own: UnwrappedGauge, strips: Sequence[UnwrappedGauge]
    ) -> Sequence[tuple[float, float]]:
        """Return for each turning part its drawn angle, and that at which the panel picture shows it around its pivot.

        Parts that never move are left out, and those for which one picture cannot tell, such as a card.
        """
        ...

    def findings(self, gauge: Gauge, appearance: Appearance) -> Sequence[str]:
        """Return what the flight showed to be otherwise than drawn, for the person who drew it."""
        ...

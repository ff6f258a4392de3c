"""The panel picture's own gauges, unwrapped: what tuning and reading both start from, worked out once."""

from __future__ import annotations

from functools import cached_property

from decoder.aligner import Aligner
from decoder.arrays import Floats
from decoder.panel_pictures import PanelPictures
from decoder.unwrapping import UnwrappedGauge, Unwrapper


class UnwrappedPanel:
    """The grids of a panel's gauges, and the panel picture on them, by gauge.

    Raises
    ------
    PanelError
        If reference points or a rim tell no plane, or a needle's height nothing.
    """

    def __init__(self, source: PanelPictures) -> None:
        self.source = source.with_planes()
        self.grids = [self.source.grid(index) for index in range(len(self.source.panel.gauges))]
        self.unwrapper = Unwrapper(self.grids)

    @cached_property
    def aligner(self) -> Aligner:
        """Finds the panel in frames, whose camera may be anywhere.

        Raises
        ------
        PanelError
            If an anchor or the level edge does not fit the panel picture.
        """
        return self.source.aligner()

    @cached_property
    def rims(self) -> list[Floats]:
        """By gauge, as `PolarGrid.rim`."""
        return [grid.rim() for grid in self.grids]

    @cached_property
    def gauges(self) -> list[UnwrappedGauge]:
        """As the panel picture shows them."""
        return self.unwrapper.unwrap(self.source.picture, self.source.optics.own)

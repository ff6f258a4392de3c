"""Which rim a few clicks on a dial mean, and what its gauge keeps of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from decoder.errors import PictureError
from decoder.pictures import GreyPicture
from decoder.setup.drawn_plane import XY, DrawnPlane, Planes, mean_radius_px, rim_of
from decoder.setup.rims import Freedom, Ring, bent, circle_through, fitted_ring

# A dial flatter than this is seen from more than eleven degrees beside its axis; and its marks must lie so much nearer
# to the ellipse than to the best circle that it is no accident of a few marks.
LEAST_FLATNESS, MOST_FLATNESS = 0.02, 0.4
CLEARLY_NEARER = 0.75


@dataclass(frozen=True, slots=True)
class Rim:
    """The rim of a gauge.

    Attributes
    ----------
    centre
        The pivot in the picture, pixels.
    radius_px
        In the dial's plane.
    points
        For the gauge's `rim`, where its plane does not follow from elsewhere.
    drawn
        The plane as the gauge then has it.
    """

    centre: XY
    radius_px: float
    points: list[list[float]] | None
    drawn: DrawnPlane


def begun(picture: GreyPicture, planes: Planes, clicks: Sequence[XY]) -> Rim:
    """The rim that three clicks mean: a circle on the plane that is known, else a circle or a clear ellipse.

    Raises
    ------
    PictureError
        If they lie on a line.
    """
    circle = fitted_ring(picture, circle_through(planes.drawn(clicks[0]), clicks), Freedom.CIRCLE)
    if planes.inches is None:
        ellipse = fitted_ring(picture, circle, Freedom.ELLIPSE)
        if LEAST_FLATNESS < ellipse.flatness < MOST_FLATNESS and ellipse.miss_px < CLEARLY_NEARER * circle.miss_px:
            return _kept(planes, ellipse, oblique=True)
    return _kept(planes, circle, oblique=False)


def refined(picture: GreyPicture, planes: Planes, ring: Ring, clicks: Sequence[XY]) -> Rim:
    """The ellipse next to a ring that goes by clicks, at the marks that are there.

    Raises
    ------
    PictureError
        If there is none.
    """
    ellipse = fitted_ring(picture, bent(ring, clicks), Freedom.ELLIPSE)
    if ellipse.radius_px <= 1.0:
        raise PictureError("no ellipse goes through these points; click them all round the rim")
    return _kept(planes, ellipse, oblique=True)


def _kept(planes: Planes, ring: Ring, *, oblique: bool) -> Rim:
    """What a gauge keeps of a ring: its plane is the one that follows from what is written down."""
    points = rim_of(ring.drawn, ring.radius_px) if oblique else None
    centre = ring.centre
    drawn = planes.drawn(centre, points)
    return Rim(centre, mean_radius_px(drawn, ring.drawn.ring(ring.radius_px)), points, drawn)

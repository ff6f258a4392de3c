"""How obliquely each dial is seen, from the marks and the circles in the panel picture.

Seen obliquely a dial appears as an ellipse. On one that is read all the way round marks are even, and crowd together
and draw apart along the ellipse. Bezels, the ends of marks and coloured arcs are circles, but one dial's may mislead,
as where a square frame or a pattern is all that shows around it. The dials of a flat panel are all seen by one camera,
so its view is fitted to what most of them show, and tells how the others are seen.

Whoever draws a dial gives marks where they appear. In between, a needle would be read as if it were seen square on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Self

import cv2
import numpy as np

from decoder.imaging.motion import jacobian
from decoder.imaging.optics import Optics
from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.pictures import GreyPicture
from decoder.imaging.planes import Squeeze
from decoder.imaging.resampling import levels_at
from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import Unwrapper, polar
from decoder.learning.drawn_points import squeeze_of
from decoder.learning.thresholds import MOST_MARK_PART
from decoder.matching.pivot_search import ALL_AXES, SQUEEZE_AXES, climbed, even_marks_squeeze
from decoder.matching.thresholds import FAR_GAIN, MIN_VIEWS
from decoder.panel.arrays import Floats, limited
from decoder.panel.gauge import Gauge
from decoder.registration.thresholds import NOISE_LEVELS

# A dial is sampled with this many pixels for its radius, on circles between these parts of it: needles end within a
# bezel, which may be as wide as half of it.
RADIUS_PX, CIRCLES = 40, np.linspace(0.35, 1.8, 48)
# Each of these pixels is the mean of at most so many by so many points of the picture, however large the dial is.
FINEST = 8
AROUND = np.arange(0.0, math.tau, math.tau / 120)
RINGS = np.stack([CIRCLES * wave(AROUND)[:, None] for wave in (np.cos, np.sin)], axis=-1).astype(np.float32)
# The middle of a bezel is at most this far from the drawn centre, and the squeeze in sum with it, in radii.
REACH = 0.35
# Circles are found from further away in a picture that is blurred by so many of these pixels.
COARSE_PX = 1.5
# From where squeezes are searched for, beside none.
FIRST_PART, DIRECTIONS = 0.07, np.arange(0.0, math.tau, math.tau / 8)
# Squeezes agree if they differ by hardly more than this; a view is searched for by what agrees more coarsely first.
AGREEING = 0.012
WITHIN = (4 * AGREEING, 2 * AGREEING, AGREEING)
# Where a camera may be that says nothing about itself: the tangents of its slope, to be tried in steps; its focal
# length in widths of its pictures, as a logarithm; and by which part more it enlarges what lies one width off its axis.
# The last two with what they usually are, and by how much they usually differ from that.
SLOPES, FOCALS, STARTS = np.linspace(-0.8, 0.8, 17), (-0.25, 0.1, 0.45), 5
USUAL_LENS, LENS_SPREAD = np.array([0.1, 0.0]), np.array([0.5, 0.3])
# In sum, an unusual lens counts as much against a view as this part of the dials.
LENS_WEIGHT = 0.02
FIRST_STEPS, HALVINGS = np.array([0.025, 0.025, 0.15, 0.1]), 6


Squeezes = tuple[Squeeze | None, ...]


def squeezes_seen(source: PanelPictures) -> tuple[Squeezes, Squeezes]:
    """For each gauge, return how the view squeezes it, if the panel does not say so: as its picture shows, and at all.

    The first are sure. Where too few dials agree, but several show that they are squeezed somehow, the second are what
    they show, for sigma to allow for.
    """
    source = source.with_planes()
    gauges, planes = source.panel.gauges, source.planes or ()
    wanted = [plane is None and _is_dial(gauge) for gauge, plane in zip(gauges, planes, strict=True)]
    if not any(wanted):
        return (None,) * len(gauges), (None,) * len(gauges)
    seen = {index: _Seen.of(source, index) for index, gauge in enumerate(gauges) if _is_dial(gauge)}
    told = _told(list(seen.values()))
    likely: dict[int, Squeeze] = {}
    if told is not None:
        squeezes = dict(zip(seen, told, strict=True))
    else:
        alone = {index: _squeeze_of_marks(source, index) or each.sure for index, each in seen.items()}
        squeezes = {index: own for index, own in alone.items() if own is not None and own.part > MOST_MARK_PART}
        likely = _likely(seen)
    sure = tuple(squeezes.get(index) if is_wanted else None for index, is_wanted in enumerate(wanted))
    return sure, tuple(
        own or (likely.get(index) if is_wanted else None)
        for index, (own, is_wanted) in enumerate(zip(sure, wanted, strict=True))
    )


def _likely(seen: Mapping[int, _Seen]) -> dict[int, Squeeze]:
    """Return what dials show of how they are squeezed, those that show nothing as the one that shows most."""
    shows = {index: each for index, each in seen.items() if each.gains and math.hypot(*each.squeeze) > MOST_MARK_PART}
    if len(shows) < 2:  # noqa: PLR2004 - a single one may be turned towards the pilot, or mislead
        return {}
    clearest = max(shows.values(), key=lambda each: each.share)
    return {index: _squeeze(shows.get(index, clearest).squeeze, AGREEING) for index in seen}


def squeeze_shown(picture: GreyPicture, optics: Optics, centre: Floats, radius_px: float) -> Squeeze:
    """Return the squeeze in which most of what shows around a place are circles, sure or not.

    Parameters
    ----------
    centre : (2,) px of the picture without distortion
    """
    circles = _Circles.of(picture, optics, centre, radius_px)
    _, squeeze = circles.best(circles.around(np.zeros(2))[1])
    return _squeeze(squeeze, AGREEING)


def _is_dial(gauge: Gauge) -> bool:
    """Whether a gauge has a middle of its own that was drawn, and so perhaps circles around it."""
    return gauge.window is None and not gauge.is_in_picture


def _squeeze_of_marks(source: PanelPictures, index: int) -> Squeeze | None:
    """Estimate the squeeze of a dial that is read all the way round, by its marks in the picture or as drawn."""
    gauge = source.panel.gauges[index]
    if any(quantity.wraps is None for quantity in gauge.quantities):
        return None
    own = polar(source.grid(index))
    outer_px = float(own.radii_px[-1])
    inner_px, beyond_px = HALF * outer_px, (1.0 + HALF) * outer_px
    columns = math.ceil((beyond_px - inner_px) / own.column_px)
    wide = replace(own, inner_px=inner_px, columns=columns, tail_columns=0, mixture=None)
    (marks,) = Unwrapper([wide]).unwrap(source.picture, source.optics.own)
    return even_marks_squeeze(wide, marks) or squeeze_of(gauge)


@dataclass(frozen=True, slots=True)
class _Seen:
    """How a dial appears by its own circles.

    Attributes
    ----------
    place
        (2,), from the picture's middle, in widths of the picture.
    squeeze
        (2,): the parts of the squeeze in which most of what it shows are circles.
    share
        How much of it that is, in [0, 1]: if more than half, it is hardly wrong.
    share_square_on
        How much of it are circles in no squeeze.
    share_of
        How much of it are circles in another one (2,).
    """

    place: Floats
    squeeze: Floats
    share: float
    share_square_on: float
    share_of: Callable[[Floats], float]

    @classmethod
    def of(cls, source: PanelPictures, index: int) -> Self:
        """Look at the gauge with this index, unless the panel says how it is seen."""
        (width, height), gauge = source.optics.size_px, source.panel.gauges[index]
        centre = source.optics.straight(np.array(gauge.centre, np.float64)[:, None])[:, 0]
        place = (centre - np.array([width, height]) / 2) / width
        plane = source.planes[index] if source.planes else None
        if plane is not None:
            seen = jacobian(plane.matrix, (0.0, 0.0))
            (known,) = _parts((seen @ seen.T)[None])
            return cls(place, known, 1.0, 0.0, lambda squeeze: float(_agreement(squeeze - known)))
        circles = _Circles.of(source.picture, source.optics, centre, gauge.radius[1])
        share_square_on, middle = circles.around(np.zeros(2))
        share, squeeze = circles.best(middle)
        return cls(place, squeeze, share, share_square_on, lambda squeeze: circles.around(squeeze)[0])

    @property
    def sure(self) -> Squeeze | None:
        """The squeeze, if hardly anything else than circles shows around the dial."""
        return _squeeze(self.squeeze, AGREEING) if self.share > HALF else None

    @property
    def gains(self) -> bool:
        """Whether clearly more of what the dial shows are circles in its squeeze than in none."""
        return 1.0 - self.share < FAR_GAIN * (1.0 - self.share_square_on)

    def told(self, squeeze: Floats) -> Squeeze:
        """Believe others about its squeeze (2,), with a large doubt if clearly more are circles in none."""
        loses = 1.0 - self.share_square_on < FAR_GAIN * (1.0 - self.share_of(squeeze))
        return _squeeze(squeeze, math.hypot(AGREEING, HALF * math.hypot(*squeeze) if loses else 0.0))


def _squeeze(parts: Floats, doubt: float) -> Squeeze:
    across, askew = parts.tolist()
    return Squeeze(across, askew, doubt)


def _told(seen: Sequence[_Seen]) -> list[Squeeze | None] | None:
    """For each dial, estimate its squeeze from the view in which most agree; None if too few do to tell.

    It has to square up some of those that agree, or most agree that none needs it. A dial that disagrees is believed if
    it is sure, as one that is turned towards the pilot.
    """
    own, shares = np.stack([each.squeeze for each in seen]), np.array([each.share for each in seen])
    told = _likely_view(np.stack([each.place for each in seen]), own, shares)
    agrees = _agreement(told - own) > HALF
    if sum(each.gains for each, is_like in zip(seen, agrees, strict=True) if is_like) < MIN_VIEWS:
        is_square_on = np.hypot(*told.T).max() < MOST_MARK_PART and agrees @ shares > HALF * shares.sum()
        return [None] * len(seen) if is_square_on and agrees.sum() >= MIN_VIEWS else None
    doubt = math.sqrt(float(np.square(told - own)[agrees].sum(axis=1).mean()))
    return [
        _squeeze((there + each.squeeze) / 2, doubt) if is_like else each.sure or each.told(there)
        for each, there, is_like in zip(seen, told, agrees, strict=True)
    ]


def _likely_view(places: Floats, own: Floats, shares: Floats) -> Floats:
    """(N, 2): the squeezes at places (N, 2) in the view with which most of what N dials show agrees."""

    def agreement(views: Floats, within: float = AGREEING) -> Floats:
        unusual = np.square((views[:, 2:] - USUAL_LENS) / LENS_SPREAD).sum(axis=1)
        agrees = _agreement(_seen_from(views, places) - own, within)
        height: Floats = agrees @ shares - LENS_WEIGHT * unusual * shares.sum()
        return height

    views = np.array([[x, y, focal, 0.0] for x in SLOPES for y in SLOPES for focal in FOCALS])
    for within in WITHIN:  # the widest first, in which no view is missed between two of them
        about = partial(agreement, within=within)
        starts = views[np.argsort(about(views), kind="stable")[-STARTS:]]
        views = np.stack([_higher(about, start) for start in starts])
    squeezes: Floats = _seen_from(views[about(views).argmax()][None], places)[0]
    return squeezes


def _higher(agreement: Callable[[Floats], Floats], view: Floats) -> Floats:
    """(4,): climb from a view to where agreement is highest."""
    height = agreement(view[None])[0]
    for halved in range(HALVINGS):
        steps = np.diag(FIRST_STEPS) / 2**halved
        rises = True
        while rises:
            around = view + np.concatenate([steps, -steps])
            heights = agreement(around)
            rises = heights.max() > height
            if rises:
                height, view = heights.max(), around[heights.argmax()]
    return view


def _agreement(apart: Floats, within: float = AGREEING) -> Floats:
    """(N,): how well squeezes that differ by so much (N, 2) agree; an outlier hardly counts."""
    agrees: Floats = 1.0 / (1.0 + np.square(apart).sum(axis=-1) / within**2)
    return agrees


def _seen_from(views: Floats, places: Floats) -> Floats:
    """(V, N, 2): the squeezes of dials on a flat panel, at places (N, 2), from V cameras' slopes and lenses (V, 4).

    What is a step along the panel appears as its components beside the direction in which the camera sees that place.
    """
    slopes, focals, barrels = views[:, None, :2], views[:, 2, None, None], views[:, 3, None, None, None]
    beside = places / np.exp(focals)
    ahead = slopes - beside
    even = np.eye(2) + beside[..., :, None] * beside[..., None, :]
    squared = (1.0 + np.square(slopes).sum(axis=-1))[..., None, None] * even - ahead[..., :, None] * ahead[..., None, :]
    off_px2 = np.square(places).sum(axis=1)[:, None, None]
    lens = (1.0 + barrels * off_px2) * np.eye(2) + 2.0 * barrels * places[:, :, None] * places[:, None, :]
    return _parts(lens @ squared @ lens)


def _parts(squared: Floats) -> Floats:
    """(..., 2): the squeezes in which a unit circle appears so far from its middle along any x: the root of x A x."""
    half = squared + np.sqrt(np.linalg.det(squared))[..., None, None] * np.eye(2)
    parts: Floats = np.stack([half[..., 0, 0] - half[..., 1, 1], 2.0 * half[..., 0, 1]], axis=-1)
    parts /= np.trace(half, axis1=-2, axis2=-1)[..., None]
    return parts


@dataclass(frozen=True, slots=True)
class _Circles:
    """A picture of a dial, square, with `RADIUS_PX` for its radius, and its circles' points about its middle."""

    picture: Floats

    @classmethod
    def of(cls, source: GreyPicture, optics: Optics, centre: Floats, radius_px: float) -> Self:
        """Cut it out of a picture, without the lens's distortion."""
        fine = int(limited(np.ceil(radius_px / RADIUS_PX), 1, FINEST))
        reach = math.ceil(RADIUS_PX * (1.0 + REACH) * CIRCLES[-1])
        ticks = np.arange(-reach, reach + 1, 1 / fine) * (radius_px / RADIUS_PX)
        points = np.stack(np.meshgrid(*(at + ticks for at in centre)), axis=-1).astype(np.float32)
        levels = levels_at(source, optics.own.places(points)).reshape(points.shape[:2])
        size = len(ticks) // fine
        picture = cv2.resize(levels.astype(np.float32), (size, size), interpolation=cv2.INTER_AREA)
        return cls(np.asarray(picture, np.float32))

    def best(self, middle: Floats) -> tuple[float, Floats]:
        """Search from around a middle for the squeeze (2,) with the largest share of circles; return both."""
        coarse = _Circles(np.asarray(cv2.GaussianBlur(self.picture, (0, 0), COARSE_PX), np.float32))
        starts, roughly = self._starts(middle), coarse._starts(middle)
        _, near = climbed(coarse.shares, roughly, ALL_AXES, REACH)
        shares, views = climbed(self.shares, np.concatenate([starts, near]), ALL_AXES, REACH)
        return float(shares.max()), views[shares.argmax(), 2:]

    def _starts(self, middle: Floats) -> Floats:
        """(N, 4): for each of some squeezes, the likeliest of some middles.

        A hub that was clicked appears beside the middle of its dial's ellipses.
        """
        beside = FIRST_PART * np.stack([np.cos(DIRECTIONS), np.sin(DIRECTIONS)], axis=1)
        middles = middle + np.array([np.zeros(2), *beside])
        starts = np.array([[[*each, *squeeze] for each in middles] for squeeze in (np.zeros(2), *beside)])
        likeliest = self.shares(starts.reshape(-1, starts.shape[-1])).reshape(starts.shape[:2]).argmax(axis=1)
        likely: Floats = starts[np.arange(len(starts)), likeliest]
        return likely

    def around(self, squeeze: Floats) -> tuple[float, Floats]:
        """Search for the middle (2,), in radii, with the largest share of circles in a squeeze (2,); return both."""
        shares, views = climbed(self.shares, np.array([[0.0, 0.0, *squeeze]]), ALL_AXES - SQUEEZE_AXES, REACH)
        return float(shares[0]), views[0, :2]

    def shares(self, views: Floats) -> Floats:
        """(N,): which share of what changes along the radii does so on whole circles, in each of N views (4,)."""
        right, down, across, askew = RADIUS_PX * views.T
        middle = np.full(len(views), float(len(self.picture) // 2))
        moved = np.array([[RADIUS_PX + across, askew, middle + right], [askew, RADIUS_PX - across, middle + down]])
        places = np.concatenate([cv2.transform(RINGS, each) for each in np.moveaxis(moved, -1, 0)])
        levels = levels_at(self.picture, places).reshape(len(views), *RINGS.shape[:2])
        changes = np.diff(levels, axis=2)
        on_circles = np.square(changes.mean(axis=1)).sum(axis=1)
        every = np.square(changes).reshape(len(views), -1).sum(axis=1)
        shares: Floats = on_circles / (every / len(AROUND) + NOISE_LEVELS**2 * changes.shape[2])
        return shares

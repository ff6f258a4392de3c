"""Dials together: all dials of a frame found by their own marks, each with what the others tell of it."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from decoder.alignment import Alignment, Point
from decoder.gauge_places import GaugePlace, GaugePlacer
from decoder.pictures import GreyPicture
from decoder.sorting import median_of

MIN_OTHERS = 4
# No dial's place is surer than this.
SURE_PX = 0.01
# A dial that is bent otherwise than the others by more than this is looked for again.
ODD_BEND_PART = 0.015


def place_all(
    placers: Sequence[GaugePlacer | None], frame: GreyPicture, alignment: Alignment
) -> list[GaugePlace | None]:
    """All dials; those that are not found near where the anchors have them are looked for where the others are.

    Where there is no placer the dial cannot be told from what moves on it, and lies where the anchors have it.
    """
    places = [
        GaugePlace(alignment, np.eye(3), (0.0, 0.0), 0.0, 1.0) if placer is None else placer.place(frame, alignment)
        for placer in placers
    ]
    found = [
        (placer.middle, place)
        for placer, place in zip(placers, places, strict=True)
        if placer is not None and place is not None
    ]
    if len(found) < MIN_OTHERS:
        return places
    return held_by_others(placers, _looked_for_again(placers, places, found, frame, alignment))


def _looked_for_again(
    placers: Sequence[GaugePlacer | None],
    places: Sequence[GaugePlace | None],
    found: Sequence[tuple[Point, GaugePlace]],
    frame: GreyPicture,
    alignment: Alignment,
) -> list[GaugePlace | None]:
    """Those that are bent otherwise than the others, or not found, where the others are."""
    here = np.array([middle for middle, _ in found])
    there = np.array([place.motion_of(middle) for middle, place in found])
    common, _ = cv2.estimateAffine2D(here, there, method=cv2.LMEDS)
    if common is None:
        return list(places)
    where_others_are = alignment.after(np.vstack([common, [0.0, 0.0, 1.0]]))
    bend = median_of(np.array([place.motion[:2, :2] for _, place in found]))
    return [
        place
        if placer is None or (place is not None and np.abs(place.motion[:2, :2] - bend).max() < ODD_BEND_PART)
        else placer.place(frame, where_others_are, alignment) or place
        for placer, place in zip(placers, places, strict=True)
    ]


def held_by_others(
    placers: Sequence[GaugePlacer | None], places: Sequence[GaugePlace | None]
) -> list[GaugePlace | None]:
    """Each place between what its own marks say and where the other dials lie, by how far these lie apart.

    Short scales tell little of where their pivot lies. Where the other dials lie as the anchors have them, or all
    beside that alike, so does that of such a scale; where they move against each other its own marks are all there is.
    """
    known = [
        (index, np.array(place.shift_px), 1.0 / (place.sigma_px**2 + SURE_PX**2))
        for index, (placer, place) in enumerate(zip(placers, places, strict=True))
        if placer is not None and place is not None
    ]
    held = list(places)
    for index, _, weight in known:
        placer, place = placers[index], places[index]
        others = [(shift, own) for at, shift, own in known if at != index]
        if placer is None or place is None or len(others) < MIN_OTHERS - 1:
            continue
        shifts, weights = np.array([shift for shift, _ in others]), np.array([own for _, own in others])
        usual = weights @ shifts / weights.sum()
        apart_px2 = float(weights @ np.square(shifts - usual).sum(axis=1)) / 2 / float(weights.sum())
        part = apart_px2 / (apart_px2 + 1.0 / weight)
        held[index] = place.held(placer.centre, (float(usual[0]), float(usual[1])), part)
    return held

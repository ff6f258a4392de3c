"""The search for dials, step by step: each step is announced, and each proposal comes as soon as possible.

It takes most of a minute of processor time for a cockpit, so people watch it, continue drawing, and may stop it.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from decoder.imaging.pictures import GreyPicture
from decoder.matching.thresholds import MIN_VIEWS
from decoder.setup.drafts import Stale, Superseded
from decoder.setup.drawn_plane import Planes
from decoder.setup.finding.anchors import anchors_on
from decoder.setup.finding.bank import banks_on
from decoder.setup.finding.dials import FoundDial, Page, Place, dials_seen, holds_others, page_of
from decoder.setup.finding.motion import hands_turn
from decoder.setup.finding.numerals import EXTRA, Text, is_there, parts_of, texts_in, texts_once
from decoder.setup.finding.proposal import Document, ProposedGauge, banked, gauge_of, settled
from decoder.setup.finding.ticks import Comb, flat_shape
from decoder.setup.proposals import Pictures
from decoder.setup.session import SetupSession

Box = tuple[float, float, float, float]

# Parts of a picture that are read at once, each by a thread: more take half a gigabyte each.
READERS = 2


@dataclass(frozen=True, slots=True)
class Looking:
    """What is examined next, in words, and where in the picture: left, top, width, height, px."""

    said: str
    box: Box | None = None


@dataclass(frozen=True, slots=True)
class Note:
    """A remark on the search as a whole, a sentence without its full stop."""

    said: str


@dataclass(frozen=True, slots=True)
class Anchors:
    """Proposed anchors, as for `panel.yaml`, and in how many other frames they were seen to stay."""

    anchors: tuple[Document, ...]
    frames: int

    @property
    def said(self) -> str:
        """The remark on them."""
        if not self.anchors:
            return "no distinctive anchor was found that stays in all frames; draw one"
        stay = f", found in {self.frames} other frames too" if self.frames else ""
        return f"{len(self.anchors)} distinctive anchors{stay}"


@dataclass(frozen=True, slots=True)
class Withdrawn:
    """A gauge that was proposed, by its place in their order, and turns out to be none."""

    place: int


Step = Looking | Note | Anchors | ProposedGauge | Withdrawn


def search(session: SetupSession, document: Mapping[str, Any], key: str, stale: Stale) -> Iterator[Step]:
    """Find what there is to propose on a picture of a session, the surest dials first.

    Parameters
    ----------
    document : the draft so far; its anchors stay, and a dial that is drawn in it is not proposed
    key : of the panel picture
    stale : whether nobody waits for the answer any more

    Raises
    ------
    Superseded
        If nobody does.
    """
    picture = session.store.grey(key)
    anchors = list(_parts(document, "anchors"))
    if not anchors:
        yield Looking("looking for anchors: distinctive features that stay in all frames")
        proposed = _anchors(session, picture, key)
        anchors = list(proposed.anchors)
        yield proposed
    draft = {**document, "anchors": anchors}
    yield Looking("locating the panel in other frames")
    seen, planes = session.seen(draft, key, stale), session.planes(draft, key)
    texts = yield from _printed(picture, stale)
    yield Looking("looking for dials: rings of ticks around one centre")
    laid = _laid(seen, planes)
    still = np.asarray(np.median(np.stack(laid), axis=0), np.uint8) if len(laid) >= MIN_VIEWS else picture
    page = page_of(picture, still, planes, texts)
    dials: list[FoundDial] = []
    names: set[str] = set()
    for step in _settled(_dials(page, document, stale), seen, planes):
        if isinstance(step, Looking):
            yield step
            continue
        yield Looking("looking for its needles", _around(step.centre, step.comb.rim.radius_px))
        _go_on(stale)
        turns = hands_turn(laid, still, step.comb.rim, step.comb.ring_px[0])
        gauge = gauge_of(step, seen, names, words=texts, hands=turns)
        if gauge.gauge is not None:
            yield Looking(f"reading {gauge.name} on the flight", _around(step.centre, step.comb.rim.radius_px))
        yield gauge
        dials.append(step)
        names.add(gauge.name)
    yield Looking("looking for the bank scales of horizons")
    for dial, zero_deg in _banks(page, dials, document, stale):
        gauge = banked(dial, zero_deg, seen, names, texts)
        names.add(gauge.name)
        yield gauge
    for place, dial in enumerate(dials):
        if holds_others(dial, dials):
            yield Withdrawn(place)


def _printed(picture: GreyPicture, stale: Stale) -> Generator[Step, None, Sequence[Text]]:
    """Read what is printed on a picture, part by part, two at a time; return every text once."""
    if not is_there():
        yield Note(f"numerals are not read: that takes {EXTRA}")
        return ()
    texts: list[Text] = []
    parts = parts_of(picture)
    readers = ThreadPoolExecutor(READERS)
    try:
        read = [readers.submit(texts_in, picture, part) for part in parts]
        for number, (part, found) in enumerate(zip(parts, read, strict=True), 1):
            box = part.left, part.top, part.right - part.left, part.bottom - part.top
            yield Looking(f"reading numerals, part {number} of {len(parts)}", box)
            _go_on(stale)
            texts += found.result()
    finally:
        readers.shutdown(cancel_futures=True)
    return texts_once(texts)


def _go_on(stale: Stale) -> None:
    if stale():
        raise Superseded


def _parts(document: Mapping[str, Any], key: str) -> list[Any]:
    """Return a list in a draft, in which anything may stand in its place."""
    parts = document.get(key)
    return parts if isinstance(parts, list) else []


def _anchors(session: SetupSession, picture: GreyPicture, key: str) -> Anchors:
    others = [
        frame.pixels
        for index, frame in session.frames()
        if f"frame-{index}" != key and frame.pixels.shape == picture.shape
    ]
    found = [
        {"name": f"anchor_{number}", "box": list(each.box)}
        for number, each in enumerate(anchors_on(picture, others), 1)
    ]
    return Anchors(tuple(found), len(others))


def _dials(page: Page, document: Mapping[str, Any], stale: Stale) -> Iterator[Looking | FoundDial]:
    """Search for dials that are not drawn yet."""
    for step in dials_seen(page):
        _go_on(stale)
        if isinstance(step, Place):
            x, y = step.centre
            yield Looking(f"looking at a dial around {x:.0f}, {y:.0f}", _around(step.centre, step.radius_px))
        elif not any(_draws(gauge, step) for gauge in _parts(document, "gauges")):
            yield step


def _settled(steps: Iterator[Looking | FoundDial], seen: Pictures, planes: Planes) -> Iterator[Looking | FoundDial]:
    """Settle dials as soon as possible; those with ticks only part of the way around wait until the rest are found."""
    combs: list[Comb] = []
    later: list[FoundDial] = []
    for step in steps:
        if isinstance(step, FoundDial):
            combs.append(step.comb)
            if not step.comb.is_all_round:
                later.append(step)
                continue
        yield step
    shape = flat_shape(combs)
    for dial in later:
        yield Looking(
            "measuring a dial again, allowing for the oblique view", _around(dial.centre, dial.comb.rim.radius_px)
        )
        yield settled(dial, seen, planes, shape)


def _banks(
    page: Page, dials: Sequence[FoundDial], document: Mapping[str, Any], stale: Stale
) -> Iterator[tuple[FoundDial, float]]:
    """Search for bank scales that are not drawn yet, and their zeros."""
    for dial, zero_deg in banks_on(page, dials, flat_shape([each.comb for each in dials])):
        _go_on(stale)
        if not any(_draws(gauge, dial) for gauge in _parts(document, "gauges")):
            yield dial, zero_deg


def _around(centre: tuple[float, float], radius_px: float) -> Box:
    (x, y), side_px = centre, 2 * radius_px
    return x - radius_px, y - radius_px, side_px, side_px


def _draws(gauge: object, dial: FoundDial) -> bool:
    """Whether a drawn gauge is that dial: their centres are nearer than half of the smaller radius."""
    if not isinstance(gauge, Mapping):
        return False
    try:
        (x, y), (_, outer_px) = gauge["centre"], gauge["radius"]
        return bool(2 * math.dist((x, y), dial.centre) < min(outer_px, dial.comb.rim.radius_px))
    except (KeyError, TypeError, ValueError):
        return False


def _laid(pictures: Pictures, planes: Planes) -> list[GreyPicture]:
    """Align each frame with the panel picture."""
    height, width = pictures.picture.shape
    columns, rows = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    straight = np.asarray(planes.optics.straight(np.stack([columns.ravel(), rows.ravel()])), np.float32)
    points = np.ascontiguousarray(straight.T.reshape(height, width, 2))
    laid = []
    for frame, alignment in pictures.frames:
        there = np.asarray(alignment.places(points), np.float32)
        seen = cv2.remap(frame, there[..., 0], there[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        laid.append(np.asarray(seen, np.uint8))
    return laid

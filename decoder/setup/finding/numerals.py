"""What is printed on a panel, read by a text recognizer whose weights come with its package; nothing is downloaded.

The package is an extra. Its detector finds lines of text, and misses single digits and most small print; numbers are
therefore also looked for by their glyphs. What is read is only as good as its agreement with the marks, which `scales`
checks.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from importlib.util import find_spec
from queue import Empty, SimpleQueue
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.imaging.sorting import MAD_TO_SIGMA
from decoder.imaging.thresholds import HALF
from decoder.matching.thresholds import OUTLIER_SPREADS
from decoder.panel.arrays import Floats
from decoder.registration.thresholds import NOISE_LEVELS
from decoder.setup.finding.robust import Trust, robust
from decoder.setup.finding.thresholds import (
    EDGE_PX,
    LEAST_TICKS,
    MOST_BEND,
    MOST_ROLL_DEG,
    SAME_PLACE,
    SURE,
    WORD_SHAPE,
)

PACKAGES = ("rapidocr", "onnxruntime")
EXTRA = "pip install 'image-flight-recorder[ocr]'"

# The picture is read at its own size and enlarged: large letters are lost in the latter, small ones in the former.
ENLARGED = (1.0, 2.0)
LIKED_PX = 740
# Print is no wider than half of this; what is wider is the ground that it is printed on.
PLAIN_PX = 31
# Glyphs of these heights are told from their ground; it is the median around them, of which they cover less than half.
GLYPH_PX = (8, 40)
GROUND_PX = 61
# Octaves of glyph heights that are looked for.
OCTAVES = 2
# The height that the recognizer was made for, and the width to which it pads what is shorter, here a digit or two.
READ_PX = (48, 64)
# Of a glyph's height, the margin around a number.
MARGIN = 0.35
# The recognizer takes 190 bytes per pixel, so it gets parts of this size, which overlap by a word.
PART_PX, OVERLAP_PX = 1280, 192

# A word of this length gives its own rotation to this precision.
LONG_PX, LEVEL_DEG = 40.0, 0.5

_NUMBER = re.compile(r"^[^0-9A-Za-z+.]*([+-]?)(\d{1,3}(?:,\d{3})+|\d*\.\d+|\d+)[^0-9A-Za-z]*$")
_MISREAD = str.maketrans("OoQDIl|", "0000111")
_MOSTLY_DIGITS = re.compile(r"^[-+]?[\dOoQDIl|.]*\d[\dOoQDIl|.]*$")


@dataclass(frozen=True, slots=True)
class Text:
    """A piece of print.

    Attributes
    ----------
    said
        As it was read.
    at
        Its middle, pixels of the picture.
    size_px
        Along and across its line.
    turned_deg
        The rotation of its line, clockwise.
    sure
        The recognizer's confidence, 0 to 1.
    by_glyphs
        Whether it was found by its glyphs and not as a line of text. Print that is turned makes false ones.
    """

    said: str
    at: tuple[float, float]
    size_px: tuple[float, float]
    turned_deg: float
    sure: float
    by_glyphs: bool = False

    @property
    def value(self) -> float | None:
        """Its number without sign, since a tick beside it looks like one; None for words."""
        said = self.said.replace(" ", "")
        if _MOSTLY_DIGITS.match(said):
            said = said.translate(_MISREAD)
        match = _NUMBER.match(said)
        return None if match is None else float(match[2].replace(",", ""))

    def shifted(self, right_px: float, down_px: float) -> Text:
        """Move a text that was read in a part of the picture."""
        return replace(self, at=(self.at[0] + right_px, self.at[1] + down_px))

    def put(self, at: tuple[float, float], size_px: tuple[float, float], turned_deg: float) -> Text:
        """Move a text that was read in an unrolled dial back onto the dial."""
        return replace(self, at=at, size_px=size_px, turned_deg=turned_deg)


def is_there() -> bool:
    """Whether the recognizer is installed."""
    return all(find_spec(package) is not None for package in PACKAGES)


@contextmanager
def _engine() -> Iterator[Any]:
    """Lend a recognizer that nobody else uses: one keeps what it is reading. It takes one thread, as all we call."""
    idle = _idle_engines()
    try:
        engine = idle.get_nowait()
    except Empty:
        engine = _new_engine()
    try:
        yield engine
    finally:
        idle.put(engine)


@cache
def _idle_engines() -> SimpleQueue[Any]:
    return SimpleQueue()


def _new_engine() -> Any:  # noqa: ANN401 - of a package that may be absent
    from rapidocr import RapidOCR  # noqa: PLC0415 - an extra, and half a second

    return RapidOCR(
        params={
            "Global.max_side_len": 1 << 15,
            "Global.log_level": "critical",
            "Global.use_cls": False,
            "EngineConfig.onnxruntime.intra_op_num_threads": 1,
            "Rec.rec_img_shape": [3, *READ_PX],
        }
    )


def seen_at(picture: NDArray[np.uint8], scale: float) -> list[Text]:
    """Read an enlarged picture."""
    shown = picture if scale == 1 else cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    # The recognizer would enlarge smaller pictures itself, until letters are mere blots.
    lacking = np.subtract(LIKED_PX, shown.shape)
    more = [int(each) // 2 for each in lacking.clip(0)]
    level = int(np.median(shown))
    shown = cv2.copyMakeBorder(shown, more[0], more[0], more[1], more[1], cv2.BORDER_CONSTANT, value=level)
    with _engine() as engine:
        found = engine(cv2.cvtColor(shown, cv2.COLOR_GRAY2BGR), use_det=True, use_rec=True)
    if found.boxes is None:
        return []
    return [
        _text(np.asarray(box, np.float64) - (more[1], more[0]), said, sure, scale)
        for box, said, sure in zip(found.boxes, found.txts, found.scores, strict=True)
    ]


def seen_enlarged(picture: NDArray[np.uint8], scale: float) -> list[Text]:
    """Read an enlarged picture of small print, dark or light.

    The recognizer has learned from dark print on paper, and misses half of the small light print on dark dials. So all
    print is made dark on a light ground.
    """
    ground = cv2.medianBlur(picture, PLAIN_PX)
    return seen_at(np.asarray(255 - cv2.absdiff(picture, ground), np.uint8), scale)


def numbers_at(picture: NDArray[np.uint8], scale: float) -> list[Text]:
    """Read the numbers, and single letters, of an enlarged picture: each row of glyphs by itself.

    Dark and light glyphs are looked for, in the enlarged picture and in half of that.
    """
    found = []
    for octave in range(OCTAVES):
        by = scale / 2**octave
        shown = cv2.resize(picture, None, fx=by, fy=by, interpolation=cv2.INTER_CUBIC if by > 1 else cv2.INTER_AREA)
        for dark in (shown, 255 - shown):
            for row in _rows(_glyphs(np.asarray(dark, np.uint8))):
                text = _read_row(np.asarray(dark, np.uint8), row, by)
                if text is not None and _is_number(text):
                    found.append(text)
    return found


def _is_number(text: Text) -> bool:
    """Whether a row of glyphs is a number or a compass's letter for certain; a lone 1 may as well be a tick."""
    is_said = text.value is not None or len(text.said) == 1
    return text.sure > SURE and is_said and text.value != 1


def _glyphs(dark: NDArray[np.uint8]) -> Floats:
    """(N, 4): left, top, width and height of what may be dark glyphs, px."""
    ground = cv2.medianBlur(dark, GROUND_PX)
    below = cv2.subtract(ground, dark)
    spread = np.sqrt(cv2.boxFilter(np.square(below, dtype=np.float32), -1, (GROUND_PX, GROUND_PX)))
    noise = MAD_TO_SIGMA * float(np.median(cv2.absdiff(ground, dark)))
    inked = below > np.maximum(max(2 * NOISE_LEVELS, OUTLIER_SPREADS * noise), spread)
    _, _, stats, _ = cv2.connectedComponentsWithStats(inked.astype(np.uint8))
    boxes: Floats = stats[1:, :4].astype(np.float64)
    low, high = GLYPH_PX
    fit = (boxes[:, 3] >= low) & (boxes[:, 3] <= high) & (boxes[:, 2] <= WORD_SHAPE * boxes[:, 3])
    return boxes[fit]


def _rows(glyphs: Floats) -> Iterator[Floats]:
    """Yield glyphs of about one height that stand side by side, from left to right."""
    left, top, wide, high = glyphs.T
    middle, right = top + high / 2, left + wide
    # The glyph that each is the next of, and how far it is from it; a grille has too many holes for a table of pairs.
    before: dict[int, tuple[float, int]] = {}
    for one in range(len(glyphs)):
        bigger, smaller = np.maximum(high, high[one]), np.minimum(high, high[one])
        # The next one may begin a little before the last has ended, as in slanted print.
        gap = np.abs(left - right[one])
        follows = (left > left[one]) & (gap <= HALF * bigger) & (bigger <= MOST_BEND * smaller)
        follows &= np.abs(middle - middle[one]) <= HALF * smaller
        if follows.any():
            other = int(np.where(follows, gap, np.inf).argmin())
            before[other] = min(before.get(other, (math.inf, one)), (float(gap[other]), one))
    after = {one: other for other, (_, one) in before.items()}
    for first in sorted(set(range(len(glyphs))) - set(after.values())):
        row = [first]
        while row[-1] in after:
            row.append(after[row[-1]])
        yield glyphs[row]


def _read_row(dark: NDArray[np.uint8], row: Floats, scale: float) -> Text | None:
    """Read a row of dark glyphs; None where it says nothing."""
    ends = row[:, 0], row[:, 0] + row[:, 2]
    x, y = (ends[0] + ends[1]) / 2, row[:, 1] + row[:, 3] / 2
    slope = float(np.polyfit(x, y, 1)[0]) if len(row) > 1 else 0.0
    turn, high = math.atan(slope), float(np.median(row[:, 3]))
    middle = np.array([(ends[0].min() + ends[1].max()) / 2, float(y.mean())])
    along = float(ends[1].max() - ends[0].min()) + 2 * MARGIN * high
    across = high + 2 * MARGIN * high
    by = READ_PX[0] / across
    turned = by * np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    size = max(round(along * by), 1), READ_PX[0]
    onto = np.array([size[0] / 2, size[1] / 2]) - turned @ middle
    line = cv2.warpAffine(
        dark, np.hstack([turned, onto[:, None]]), size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )
    with _engine() as engine:
        found = engine(cv2.cvtColor(line, cv2.COLOR_GRAY2BGR), use_det=False, use_rec=True)
    if not found.txts or not found.txts[0]:
        return None
    x, y = (middle / scale - 0.5).tolist()
    return Text(
        found.txts[0],
        (x, y),
        (along / scale, across / scale),
        math.degrees(turn),
        float(found.scores[0]),
        by_glyphs=True,
    )


def readings(texts: Sequence[Text]) -> list[Sequence[Text]]:
    """Return what may be read at a place: lines of text alone, and with the numbers that were found by their glyphs."""
    lines = [text for text in texts if not text.by_glyphs]
    return [lines] if len(lines) == len(texts) else [lines, texts]


def _text(box: Floats, said: str, sure: float, scale: float) -> Text:
    box = (box + 0.5) / scale - 0.5
    along, across = box[1] - box[0], box[3] - box[0]
    x, y = box.mean(axis=0)
    size = (float(np.hypot(*along)), float(np.hypot(*across)))
    return Text(said, (float(x), float(y)), size, math.degrees(math.atan2(along[1], along[0])), float(sure))


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a picture that is read at once, px, and its enlargement."""

    scale: float
    left: int
    top: int
    right: int
    bottom: int


def parts_of(picture: NDArray[np.uint8]) -> list[Part]:
    """Divide a picture into the parts that are read one by one, at several sizes."""
    height, width = picture.shape
    return [
        Part(scale, left, top, right, bottom)
        for scale in ENLARGED
        for top, bottom in _parts(height, scale)
        for left, right in _parts(width, scale)
    ]


def texts_in(picture: NDArray[np.uint8], part: Part) -> list[Text]:
    """Read a part of a grey picture, (H, W), dropping texts at its edges, which other parts contain."""
    own = np.ascontiguousarray(picture[part.top : part.bottom, part.left : part.right])
    beyond = part.top, part.left, part.bottom < picture.shape[0], part.right < picture.shape[1]
    if part.scale == 1:
        texts = seen_at(own, part.scale)
    else:
        texts = [*seen_enlarged(own, part.scale), *numbers_at(own, part.scale)]
    return [text.shifted(part.left, part.top) for text in texts if not _is_cut(text, own, beyond)]


def _parts(length: int, scale: float) -> list[tuple[int, int]]:
    """Return the ranges of the parts of a side."""
    side, overlap = math.ceil(PART_PX / scale), OVERLAP_PX / scale
    count = max(math.ceil((length - overlap) / (side - overlap)), 1)
    starts = np.linspace(0, max(length - side, 0), count).astype(int).tolist()
    return [(start, min(start + side, length)) for start in starts]


def _is_cut(text: Text, part: NDArray[np.uint8], beyond: tuple[float, float, bool, bool]) -> bool:
    """Whether a text touches an edge beyond which the picture continues, so that another part contains all of it."""
    top, left, below, right = beyond
    (x, y), turn = text.at, math.radians(text.turned_deg)
    along, across = (size / 2 for size in text.size_px)
    wide = abs(along * math.cos(turn)) + abs(across * math.sin(turn))
    high = abs(along * math.sin(turn)) + abs(across * math.cos(turn))
    return bool(
        (top and y - high < EDGE_PX)
        or (left and x - wide < EDGE_PX)
        or (below and y + high > part.shape[0] - 1 - EDGE_PX)
        or (right and x + wide > part.shape[1] - 1 - EDGE_PX)
    )


def texts_once(found: Sequence[Text]) -> list[Text]:
    """Keep one reading of each place: a line rather than its glyphs, a number rather than words, the most confident."""
    kept: list[Text] = []
    for text in sorted(found, key=lambda each: (each.by_glyphs, each.value is None, -each.sure)):
        if not any(_overlap(text, other) or (text.by_glyphs and _covers(other, text)) for other in kept):
            kept.append(text)
    return kept


def _overlap(one: Text, other: Text) -> bool:
    near = SAME_PLACE * min(one.size_px[1], other.size_px[1])
    dx, dy = abs(one.at[0] - other.at[0]), abs(one.at[1] - other.at[1])
    return dy < near and dx < max(near, (one.size_px[0] + other.size_px[0]) / 2 * SAME_PLACE)


def _covers(text: Text, number: Text) -> bool:
    """Whether a number lies within a text of about its height; the recognizer may take a whole dial for one letter."""
    if text.size_px[1] > MOST_BEND * number.size_px[1]:
        return False
    away = np.abs(np.subtract(text.at, number.at))
    return bool((away < np.array(text.size_px) / 2).all())


def level_deg(texts: Sequence[Text], at: tuple[float, float], size_px: tuple[int, ...]) -> float | None:
    """Estimate the rotation of a panel's words at a place of its picture, clockwise; None if there are too few.

    Seen obliquely the rotation varies across the panel, so a plane is fitted to the rotations of all words.
    """
    words = [text for text in texts if text.value is None and text.size_px[0] > WORD_SHAPE * text.size_px[1]]
    words = [text for text in words if abs(text.turned_deg) < MOST_ROLL_DEG]
    if len(words) <= LEAST_TICKS:
        return None
    away = (np.array([text.at for text in words]) - at) / max(size_px)
    design = np.concatenate([np.ones((len(words), 1)), away], axis=1)
    turns = np.array([text.turned_deg for text in words])
    # A box's edge is known to a pixel, and a panel that is nearly square on rotates none of them.
    lengths = np.array([text.size_px[0] for text in words]) / LONG_PX
    level, _, _ = robust(design, turns, Trust(LEVEL_DEG), base=lengths**2, held=np.diag([0.0, 0.1, 0.1]))
    return float(level[0])

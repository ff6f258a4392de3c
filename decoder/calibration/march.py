"""The block-march test of thesis 3.1.1: whether and how much a lens bends a ruler through the middle of the picture.

Equal blocks are cut along the ruler, one for each centimetre (or inch), and stacked. With a straight lens every
centimetre's tick is in the middle of its block. A ruler that is not square on drifts too, but like a parabola; radial
distortion, which is odd about the middle, drifts like a cubic, so the two can be separated.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from decoder.calibration.profile import Array, Line, sampled
from decoder.calibration.ruler_fit import refuse_off_centre
from decoder.calibration.ticks import GRADUATIONS_INCHES, INCHES_PER_CM, Ticks, find_ticks
from decoder.imaging.pictures import GreyPicture
from decoder.imaging.sorting import MAD_TO_SIGMA
from decoder.imaging.thresholds import HALF
from decoder.panel.errors import CalibrationError

BLOCK_WIDTH_PX = 240
_OFFSETS = np.linspace(-0.6, 0.6, 13)  # of a block, where longer ticks are searched for


@dataclass(frozen=True, slots=True, eq=False)
class March:
    """The result of the test.

    Attributes
    ----------
    block
        What a block is: "1 cm" or "1 inch".
    number
        (N,) the blocks' ticks, counted from the one nearest to the middle.
    place_px
        (N,) their distances from the foot of the optical axis along the ruler.
    drift_px
        (N,) how far each is from the middle of its block.
    bend_px
        (N,) the part of that which is neither the blocks' width nor the ruler's tilt, outwards positive where place is.
    edge_px
        The fitted distortion at the outermost tick, outwards positive (pincushion); its uncertainty is
        `edge_sigma_px`.
    per_px2, per_px2_sigma
        The fitted distortion, as k in r (1 + k r^2) with r in pixels.
    stacked
        (H, W) uint8, the picture of thesis figure 3.2.
    """

    block: str
    number: Array
    place_px: Array
    drift_px: Array
    bend_px: Array
    edge_px: float
    edge_sigma_px: float
    per_px2: float
    per_px2_sigma: float
    stacked: GreyPicture


def march(picture: GreyPicture, line: Line, inches: float) -> March:
    """Run the block-march test along a ruler.

    Parameters
    ----------
    picture : (H, W) uint8
    line : along the ruler's ticks, as far as they go
    inches : about how long it is on the ruler

    Raises
    ------
    CalibrationError
        If the ruler misses the middle, covers too little of the picture, or shows no ticks.
    """
    height, width = picture.shape
    refuse_off_centre(line, (width, height))
    ticks = find_ticks(picture, line, inches)
    span = float(ticks.along_px[-1] - ticks.along_px[0])
    if span < HALF * width:
        raise CalibrationError(
            f"the ruler covers {span / width:.0%} of the picture's width; distortion shows at the edges,"
            " so let it cover all of it"
        )
    foot, beside = line.foot(((width - 1) / 2, (height - 1) / 2))
    place = ticks.along_px - foot
    unknowns, covariance = _fit(ticks.number, place, beside)
    straight = _model(np.array([*unknowns[:3], 0.0]), ticks.number, beside)
    block, every = _block(ticks.graduation)
    chosen = _long_ticks(picture, line, ticks, every)
    pitch = float(unknowns[1] / (1 - unknowns[2] * unknowns[0] / unknowns[1]) * every)
    middle = chosen[np.argmin(np.abs(place[chosen]))]
    number = (ticks.number[chosen] - ticks.number[middle]) / every
    outermost = float(np.abs(straight).max())
    return March(
        block=block,
        number=number,
        place_px=place[chosen],
        drift_px=place[chosen] - place[middle] - number * pitch,
        bend_px=(place - straight)[chosen] * np.sign(place[chosen]),
        edge_px=float(unknowns[3]) * outermost**3,
        edge_sigma_px=float(np.sqrt(covariance[3, 3])) * outermost**3,
        per_px2=float(unknowns[3]),
        per_px2_sigma=float(np.sqrt(covariance[3, 3])),
        stacked=_stacked(picture, line, ticks.along_px[middle] + number * pitch, pitch),
    )


def _model(unknowns: Array, number: Array, beside: float) -> Array:
    """(N,) places along the line: a tilted ruler, bent radially."""
    a, b, c, k = unknowns
    flat = (a + b * number) / (1 + c * number)
    return np.asarray(flat * (1 + k * (flat**2 + beside**2)))


def _fit(number: Array, place: Array, beside: float) -> tuple[Array, Array]:
    """(4,) a, b, c, k and their covariance; outlying ticks have little weight (Huber)."""
    unknowns = np.array([*np.polynomial.polynomial.polyfit(number, place, 1), 0.0, 0.0])
    reach, count = float(np.abs(place).max()), float(np.abs(number).max())
    scale = np.array([1.0, 1 / count, 1 / count / reach, reach**-3])
    for _ in range(20):
        miss = place - _model(unknowns, number, beside)
        steps = 1e-3 * np.diag(scale)
        rows = np.stack([
            (_model(unknowns + step, number, beside) - _model(unknowns - step, number, beside)) / 2e-3 for step in steps
        ], axis=1)  # fmt: skip
        spread = max(MAD_TO_SIGMA * float(np.median(np.abs(miss))), 1e-6)
        weight = np.minimum(1.0, 2 * spread / np.maximum(np.abs(miss), 1e-12))
        root = np.sqrt(weight)
        unknowns = unknowns + scale * np.linalg.lstsq(rows * root[:, None], miss * root, rcond=None)[0]
    variance = float(np.sum(weight * miss**2) / max(np.sum(weight) - unknowns.size, 1.0))
    covariance = np.linalg.inv((rows.T * weight) @ rows) * variance * np.outer(scale, scale)
    return np.asarray(unknowns, np.float64), np.asarray(covariance, np.float64)


def _block(graduation: str) -> tuple[str, int]:
    """Name a block, and count the ticks to one."""
    name, size = ("1 cm", INCHES_PER_CM) if graduation.endswith("m") else ("1 inch", 1.0)
    return name, round(size / GRADUATIONS_INCHES[graduation])


def _long_ticks(picture: GreyPicture, line: Line, ticks: Ticks, every: int) -> np.ndarray:
    """Find the ticks for whole centimetres or inches: those that are longer than the others."""
    apart = float(np.median(np.diff(ticks.along_px) / np.diff(ticks.number))) * every
    phase = (ticks.number % every).astype(int)
    contrast = np.zeros(every)
    for offset in _OFFSETS * apart:
        levels = sampled(picture, ticks.points_px + offset * line.normal)
        means = np.array(
            [np.median(levels[phase == number]) if np.any(phase == number) else 0.0 for number in range(every)]
        )
        contrast += np.abs(means - np.median(means))
    return np.flatnonzero(phase == int(np.argmax(contrast)))


def _stacked(picture: GreyPicture, line: Line, middles_px: Array, pitch_px: float) -> GreyPicture:
    """Stack the blocks, the leftmost on top, each with its middle marked at its lower edge."""
    scale = BLOCK_WIDTH_PX / pitch_px
    across = (np.arange(BLOCK_WIDTH_PX + 1) - BLOCK_WIDTH_PX / 2) / scale
    down = np.arange(-int(0.3 * BLOCK_WIDTH_PX), int(0.3 * BLOCK_WIDTH_PX) + 1) / scale
    blocks = []
    for middle in middles_px:
        points = line.points(middle + across)[None] + down[:, None, None] * line.normal
        maps = points.astype(np.float32)
        block = cv2.remap(picture, maps[..., 0], maps[..., 1], cv2.INTER_LINEAR)
        block[-1] = 0
        block[-9:, BLOCK_WIDTH_PX // 2] = 0
        block[-9:, BLOCK_WIDTH_PX // 2 - 1 : BLOCK_WIDTH_PX // 2 + 2 : 2] = 255
        blocks.append(block)
    return np.asarray(np.vstack(blocks), np.uint8)

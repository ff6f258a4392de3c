"""Focal length and distortion from photographs of a chessboard or a ChArUco board, by OpenCV's calibration.

The optical axis is assumed to meet the picture's middle, as everywhere else. Tangential distortion is assumed to be
zero, and so is k3 except in the rational model: a few hand-held photographs cannot tell them from the board's
unevenness.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from decoder.calibration.photographs import Photograph, same_size
from decoder.calibration.profile import Array
from decoder.calibration.thresholds import LEAST_TILT_DEG, MIN_CORNERS, MIN_PHOTOGRAPHS, SEARCHED_SIDE_PX
from decoder.imaging.pictures import GreyPicture
from decoder.panel.errors import CalibrationError
from decoder.panel.lens import BrownConrady, DistortionModel, Fisheye, Lens

_FLAGS = cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_FIX_PRINCIPAL_POINT | cv2.CALIB_ZERO_TANGENT_DIST
_OWN_FLAGS = {
    DistortionModel.BROWN_CONRADY: cv2.CALIB_FIX_K3,
    DistortionModel.RATIONAL: cv2.CALIB_RATIONAL_MODEL,
}
_ENOUGH = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-10)

_VIEWS = 30
_INSIDE = 5  # unknowns of a fisheye: pixels per radian and four coefficients
_SCALES = (0.25, 0.35, 0.5, 0.7, 1.0)  # initial pixels per radian as parts of the width: 230 to 57 degrees wide
_BEFORE = np.array([0.0, 0, 0, 0, 0, 10])  # a board of unit squares, square on

Corners = tuple[Array, Array]
"""(N, 3) places on the board, (N, 2) pixels."""
FindCorners = Callable[[GreyPicture], Corners | None]


@dataclass(frozen=True, slots=True)
class BoardFit:
    """The lens at one zoom.

    Attributes
    ----------
    size_px
        Width and height of the photographs.
    pixels_per_radian, sigma
        In the centre of the field.
    distortion, k1_sigma
        In normalised coordinates.
    rms_px
        The root mean square residual of the corners.
    photographs
        How many showed the board.
    """

    focal_length_mm: float
    size_px: tuple[int, int]
    pixels_per_radian: float
    sigma: float
    distortion: BrownConrady | Fisheye
    k1_sigma: float
    rms_px: float
    photographs: int


def chessboard(squares: tuple[int, int]) -> FindCorners:
    """Make a function that finds the inner corners of a chessboard of so many squares across and down, all or none."""
    inner = (squares[0] - 1, squares[1] - 1)
    places = np.zeros((inner[0] * inner[1], 3), np.float64)
    places[:, :2] = np.mgrid[: inner[0], : inner[1]].T.reshape(-1, 2)

    def find(picture: GreyPicture) -> Corners | None:
        searched, scale = _reduced(picture)
        found, pixels = cv2.findChessboardCornersSB(searched, inner, flags=cv2.CALIB_CB_ACCURACY)
        return (places, (np.asarray(pixels, np.float64).reshape(-1, 2) + 0.5) * scale - 0.5) if found else None

    return find


def _reduced(picture: GreyPicture) -> tuple[GreyPicture, Array]:
    """Shrink a picture until no side is above `SEARCHED_SIDE_PX`; return it and the size of its pixels, (2,).

    OpenCV turns the picture by many angles, in squares of its longer side. This makes corners that were 0.042 pixels
    off on average 0.056 off; refining them in the full picture made that 0.12.
    """
    height, width = picture.shape
    part = min(1.0, SEARCHED_SIDE_PX / max(height, width))
    size = (max(1, round(width * part)), max(1, round(height * part)))
    reduced = picture if part == 1.0 else cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    return np.asarray(reduced, np.uint8), np.array([width / size[0], height / size[1]])


def charuco(squares: tuple[int, int], marker_part: float, dictionary: str) -> FindCorners:
    """Make a function that finds the visible corners of a ChArUco board; markers are that part of a square wide."""
    number = getattr(cv2.aruco, dictionary, None)
    if not isinstance(number, int) or not dictionary.startswith("DICT_"):
        raise CalibrationError(f"{dictionary} is none of OpenCV's marker dictionaries, such as DICT_5X5_100")
    board = cv2.aruco.CharucoBoard(squares, 1.0, marker_part, cv2.aruco.getPredefinedDictionary(number))
    detector = cv2.aruco.CharucoDetector(board)

    def find(picture: GreyPicture) -> Corners | None:
        pixels, numbers, *_ = detector.detectBoard(picture)
        which = np.atleast_1d(np.asarray(numbers)).ravel()  # None, if there is no board
        if len(which) < MIN_CORNERS:
            return None
        places = np.asarray(board.getChessboardCorners(), np.float64)[which]
        return places, np.asarray(pixels, np.float64).reshape(-1, 2)

    return find


def fit_boards(
    photographs: Iterable[Photograph],
    find: FindCorners,
    model: DistortionModel = DistortionModel.BROWN_CONRADY,
) -> tuple[BoardFit, ...]:
    """Calibrate the lens at each zoom of the photographs, the shortest focal length first.

    If more than `_VIEWS` photographs at a zoom show the board, those are used in which its position differs most.

    Raises
    ------
    CalibrationError
        If the photographs differ in size, or a zoom has fewer than three that show the board, or all of them face it
        alike, or the resulting lens is not valid up to the picture's corners.
    """
    sizes: dict[str, tuple[int, int]] = {}
    zooms: dict[float, list[Corners | None]] = {}
    for photograph in photographs:
        sizes[photograph.name] = photograph.size_px
        zooms.setdefault(round(photograph.focal_length_mm, 3), []).append(find(photograph.grey))
    size_px = same_size(sizes)
    return tuple(_fit(length, zooms[length], size_px, model) for length in sorted(zooms))


def _fit(
    focal_length_mm: float, looked_at: list[Corners | None], size_px: tuple[int, int], model: DistortionModel
) -> BoardFit:
    seen = [corners for corners in looked_at if corners is not None]
    if len(seen) < MIN_PHOTOGRAPHS:
        raise CalibrationError(
            f"the board is found in {len(seen)} of {len(looked_at)} photographs at {focal_length_mm:g} mm, three are"
            " needed; check --squares, and show the whole board"
        )
    chosen = _most_different(seen)
    found = _fisheye(chosen, size_px) if model is DistortionModel.FISHEYE else _pinhole(chosen, size_px, model)
    _refuse_frontal(found.turns, focal_length_mm)
    lens = Lens(size_px, _middle(size_px), found.pixels_per_radian, distortion=found.distortion)
    if not lens.reaches_corners():
        raise CalibrationError(
            f"at {focal_length_mm:g} mm the {model} model folds the picture over before its corners; show the board in"
            " the corners too, or choose another --model"
        )
    return BoardFit(
        focal_length_mm=focal_length_mm,
        size_px=size_px,
        pixels_per_radian=found.pixels_per_radian,
        sigma=found.sigma,
        distortion=found.distortion,
        k1_sigma=found.k1_sigma,
        rms_px=found.rms_px,
        photographs=len(seen),
    )


def _most_different(seen: list[Corners]) -> list[Corners]:
    """Choose up to `_VIEWS`: each time the one whose board is furthest from all chosen ones."""
    middles = np.array([
        np.concatenate([pixels.mean(axis=0), pixels.std(axis=0), pixels[-1] - pixels[0]]) for _, pixels in seen
    ])  # fmt: skip
    chosen, nearest = [0], np.full(len(seen), np.inf)
    for _ in seen[1:_VIEWS]:
        nearest = np.minimum(nearest, np.linalg.norm(middles - middles[chosen[-1]], axis=1))
        nearest[chosen] = -1.0
        chosen.append(int(nearest.argmax()))
    return [seen[index] for index in sorted(chosen)]


@dataclass(frozen=True, slots=True)
class _Found:
    """A lens that explains views of a board, and the board's (3, 3) rotation in each."""

    pixels_per_radian: float
    sigma: float
    distortion: BrownConrady | Fisheye
    k1_sigma: float
    rms_px: float
    turns: list[Array]


def _middle(size_px: tuple[int, int]) -> tuple[float, float]:
    return (size_px[0] - 1) / 2, (size_px[1] - 1) / 2


def _matrix(pixels_per_radian: float, size_px: tuple[int, int]) -> Array:
    return Lens(size_px, _middle(size_px), pixels_per_radian).matrix


def _pinhole(seen: list[Corners], size_px: tuple[int, int], model: DistortionModel) -> _Found:
    """Fit Brown-Conrady's model or the rational one, by OpenCV."""
    rms, matrix, distortion, turns, _, spreads, *_ = cv2.calibrateCameraExtended(
        [corners[0].astype(np.float32) for corners in seen],
        [corners[1].astype(np.float32) for corners in seen],
        size_px,
        _matrix(size_px[0], size_px),
        np.zeros(8),
        flags=_FLAGS | _OWN_FLAGS[model] | cv2.CALIB_USE_INTRINSIC_GUESS,
        criteria=_ENOUGH,
    )
    k1, k2, p1, p2, k3, *divisor = np.asarray(distortion, np.float64).ravel()[:8].tolist()
    k4, k5, k6 = divisor or (0.0, 0.0, 0.0)
    spread = np.asarray(spreads, np.float64).ravel()
    return _Found(
        pixels_per_radian=float(matrix[0, 0]),
        sigma=float(spread[:2].max()),
        distortion=BrownConrady((k1, k2, k3), (p1, p2), (k4, k5, k6)),
        k1_sigma=float(spread[4]),
        rms_px=float(rms),
        turns=[_turn(turn) for turn in turns],
    )


def _fisheye(seen: list[Corners], size_px: tuple[int, int]) -> _Found:
    """Fit the fisheye model by Levenberg-Marquardt.

    OpenCV's own fit has a scale for each axis and refuses views in which a corner is far off the axis.
    """
    starts = [_Bundle.started(seen, size_px, size_px[0] * part) for part in _SCALES]
    bundle, damping = min(starts, key=lambda one: one.cost), 1e-3
    for _ in range(_ENOUGH[1]):
        further = bundle.stepped(damping)
        if further.cost < bundle.cost:
            bundle, before, damping = further, bundle.cost, damping / 10
            if np.isclose(before, bundle.cost, rtol=_ENOUGH[2], atol=0.0):
                break
        elif np.isinf(damping):
            break
        else:
            damping *= 10
    variance = bundle.cost / max(bundle.residuals.size - bundle.unknowns.size, 1)
    spread = np.sqrt(np.diag(np.linalg.inv(bundle.normal)) * variance)
    scale, *radial = bundle.unknowns[:_INSIDE].tolist()
    return _Found(
        pixels_per_radian=scale,
        sigma=float(spread[0]),
        distortion=Fisheye((radial[0], radial[1], radial[2], radial[3])),
        k1_sigma=float(spread[1]),
        rms_px=float(np.sqrt(2 * bundle.cost / bundle.residuals.size)),
        turns=[_turn(pose[:3]) for pose in bundle.unknowns[_INSIDE:].reshape(-1, 6)],
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Bundle:
    """Unknowns of a fisheye and of boards in front of it: pixels per radian, k1 to k4, and six for each board's pose.

    Attributes
    ----------
    unknowns
        (5 + 6 V,).
    residuals
        (R,) pixels, of the corners.
    normal
        (5 + 6 V, 5 + 6 V): the normal matrix of the derivatives.
    gradient
        (5 + 6 V,).
    """

    seen: list[Corners]
    size_px: tuple[int, int]
    unknowns: Array
    residuals: Array
    normal: Array
    gradient: Array

    @property
    def cost(self) -> float:
        """Sum of squared residuals."""
        return float(self.residuals @ self.residuals)

    @classmethod
    def started(cls, seen: list[Corners], size_px: tuple[int, int], pixels_per_radian: float) -> Self:
        """Start with an equidistant lens, and the poses that a pinhole gives for the corners it straightens."""
        lens = Lens(size_px, _middle(size_px), pixels_per_radian, distortion=Fisheye())
        poses = [_pose(places, lens.undistorted(pixels.T).T, lens) for places, pixels in seen]
        return cls.at(seen, size_px, np.concatenate([[pixels_per_radian, 0, 0, 0, 0], *poses]))

    @classmethod
    def at(cls, seen: list[Corners], size_px: tuple[int, int], unknowns: Array) -> Self:
        """Compute residuals and derivatives for these unknowns."""
        matrix, radial = _matrix(float(unknowns[0]), size_px), unknowns[1:_INSIDE]
        normal, gradient = np.zeros((unknowns.size, unknowns.size)), np.zeros(unknowns.size)
        residuals = []
        for view, (places, pixels) in enumerate(seen):
            own = slice(_INSIDE + 6 * view, _INSIDE + 6 * view + 6)
            pose = unknowns[own]
            there, slopes = cv2.fisheye.projectPoints(places[:, None], pose[:3], pose[3:], matrix, radial)
            miss = (pixels - there[:, 0]).ravel()
            inside = np.column_stack([slopes[:, :2].sum(axis=1), slopes[:, 4:8]])
            columns = np.column_stack([inside, slopes[:, 8:14]])
            among = np.r_[0:_INSIDE, own]
            normal[np.ix_(among, among)] += columns.T @ columns
            gradient[among] += columns.T @ miss
            residuals.append(miss)
        return cls(seen, size_px, unknowns, np.concatenate(residuals), normal, gradient)

    def stepped(self, damping: float) -> Self:
        """Take a damped step towards smaller residuals."""
        damped = self.normal + damping * np.diag(np.diag(self.normal))
        return self.at(self.seen, self.size_px, self.unknowns + np.linalg.solve(damped, self.gradient))


def _turn(vector: object) -> Array:
    return np.asarray(cv2.Rodrigues(np.asarray(vector, np.float64))[0], np.float64)


def _pose(places: Array, straight: Array, lens: Lens) -> Array:
    """(6,): the board's rotation and position for a pinhole, from the corners that a pinhole can show."""
    sound = np.isfinite(straight).all(axis=1)
    if sound.sum() < MIN_CORNERS:
        return _BEFORE
    _, turn, shift = cv2.solvePnP(places[sound], straight[sound], lens.matrix, np.zeros(4), flags=cv2.SOLVEPNP_IPPE)
    return np.concatenate([np.ravel(turn), np.ravel(shift)])


def _refuse_frontal(turns: list[Array], focal_length_mm: float) -> None:
    """Refuse boards that are all parallel to the picture, which do not separate focal length from distance."""
    normals = np.array([turn[:, 2] for turn in turns])
    tilts = np.degrees(np.arccos(np.clip(np.abs(normals[:, 2]), 0, 1)))
    if tilts.max() < LEAST_TILT_DEG:
        raise CalibrationError(
            f"at {focal_length_mm:g} mm the board faces the camera squarely in every photograph; tilt it, by 20 degrees"
            " or more, to different sides"
        )

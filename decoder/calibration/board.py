"""Focal length and distortion from photographs of a chessboard or a ChArUco board, by OpenCV's calibration.

The optical axis is taken to meet the picture's middle, as everywhere else, and tangential distortion and k3 to be
nought: a few hand-held photographs do not tell them from the board's unevenness.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from decoder.calibration.photographs import Photograph
from decoder.calibration.profile import Array
from decoder.calibration.thresholds import LEAST_TILT_DEG, MIN_CORNERS, MIN_PHOTOGRAPHS, SEARCHED_SIDE_PX
from decoder.imaging.pictures import GreyPicture
from decoder.panel.errors import CalibrationError

_FLAGS = cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_FIX_PRINCIPAL_POINT | cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K3
_ENOUGH = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-10)

Corners = tuple[Array, Array]
"""(N, 3) places on the board, (N, 2) pixels."""
FindCorners = Callable[[GreyPicture], Corners | None]


@dataclass(frozen=True, slots=True)
class BoardFit:
    """The lens at one zoom.

    Attributes
    ----------
    pixels_per_radian, sigma
        In the centre of the field.
    k1, k1_sigma, k2
        Distortion, in normalised coordinates.
    rms_px
        What the corners miss the fit by.
    photographs
        How many showed the board.
    """

    focal_length_mm: float
    pixels_per_radian: float
    sigma: float
    k1: float
    k1_sigma: float
    k2: float
    rms_px: float
    photographs: int


def chessboard(squares: tuple[int, int]) -> FindCorners:
    """Find the inner corners of a chessboard of so many squares across and down, all or none."""
    inner = (squares[0] - 1, squares[1] - 1)
    places = np.zeros((inner[0] * inner[1], 3), np.float64)
    places[:, :2] = np.mgrid[: inner[0], : inner[1]].T.reshape(-1, 2)

    def find(picture: GreyPicture) -> Corners | None:
        searched, scale = _reduced(picture)
        found, pixels = cv2.findChessboardCornersSB(searched, inner, flags=cv2.CALIB_CB_ACCURACY)
        return (places, (np.asarray(pixels, np.float64).reshape(-1, 2) + 0.5) * scale - 0.5) if found else None

    return find


def _reduced(picture: GreyPicture) -> tuple[GreyPicture, Array]:
    """Shrink a picture until no side is above `SEARCHED_SIDE_PX`; how many of its pixels one of these is, (2,).

    OpenCV turns the picture by many angles, in squares of its longer side. Corners that were 0.042 pixels off on
    average are 0.056 off then; refining them in the full picture made that 0.12.
    """
    height, width = picture.shape
    part = min(1.0, SEARCHED_SIDE_PX / max(height, width))
    size = (max(1, round(width * part)), max(1, round(height * part)))
    reduced = picture if part == 1.0 else cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    return np.asarray(reduced, np.uint8), np.array([width / size[0], height / size[1]])


def charuco(squares: tuple[int, int], marker_part: float, dictionary: str) -> FindCorners:
    """Find the corners of a ChArUco board, as many as are seen; markers are that part of a square wide."""
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


def fit_boards(photographs: Sequence[Photograph], find: FindCorners) -> tuple[BoardFit, ...]:
    """Calibrate the lens at each zoom of the photographs, the shortest focal length first.

    Raises
    ------
    CalibrationError
        If a zoom has fewer than three photographs that show the board, or all of them face it alike.
    """
    zooms: dict[float, list[Photograph]] = {}
    for photograph in photographs:
        zooms.setdefault(round(photograph.focal_length_mm, 3), []).append(photograph)
    return tuple(_fit(length, zooms[length], find) for length in sorted(zooms))


def _fit(focal_length_mm: float, photographs: list[Photograph], find: FindCorners) -> BoardFit:
    seen = [corners for corners in (find(photograph.grey) for photograph in photographs) if corners is not None]
    if len(seen) < MIN_PHOTOGRAPHS:
        raise CalibrationError(
            f"the board is found in {len(seen)} of {len(photographs)} photographs at {focal_length_mm:g} mm, three are"
            " needed; check --squares, and show the whole board"
        )
    places = [corners[0].astype(np.float32) for corners in seen]
    pixels = [corners[1].astype(np.float32) for corners in seen]
    size = photographs[0].size_px
    start = np.array([[size[0], 0, (size[0] - 1) / 2], [0, size[0], (size[1] - 1) / 2], [0, 0, 1]], np.float64)
    rms, matrix, distortion, turns, _, spreads, *_ = cv2.calibrateCameraExtended(
        places, pixels, size, start, np.zeros(5), flags=_FLAGS | cv2.CALIB_USE_INTRINSIC_GUESS, criteria=_ENOUGH
    )
    _refuse_frontal([np.asarray(turn, np.float64) for turn in turns], focal_length_mm)
    k1, k2 = (float(value) for value in np.asarray(distortion).ravel()[:2])
    spread = np.asarray(spreads, np.float64).ravel()
    return BoardFit(
        focal_length_mm=focal_length_mm,
        pixels_per_radian=float(matrix[0, 0]),
        sigma=float(spread[:2].max()),
        k1=k1,
        k1_sigma=float(spread[4]),
        k2=k2,
        rms_px=float(rms),
        photographs=len(seen),
    )


def _refuse_frontal(turns: list[Array], focal_length_mm: float) -> None:
    """Boards that all lie parallel to the picture do not tell the focal length from the distance."""
    normals = np.array([cv2.Rodrigues(turn)[0][:, 2] for turn in turns])
    tilts = np.degrees(np.arccos(np.clip(np.abs(normals[:, 2]), 0, 1)))
    if tilts.max() < LEAST_TILT_DEG:
        raise CalibrationError(
            f"at {focal_length_mm:g} mm the board faces the camera squarely in every photograph; tilt it, by 20 degrees"
            " or more, to different sides"
        )

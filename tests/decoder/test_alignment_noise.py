"""Alignment noise: a flight's alignments scatter by what its own residuals tell, whatever the noise."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from decoder.aligner import AlignedFrame, Aligner
from decoder.panel import parse_panel
from decoder.pictures import FramePicture, GreyPicture

FRAMES = 48
KNOBS = ((30, 30), (170, 34), (36, 140), (164, 132))
PANEL = """
name: knobs
picture: panel.png
anchors:
  - {name: a, box: [10, 10, 40, 40]}
  - {name: b, box: [150, 14, 40, 40]}
  - {name: c, box: [16, 120, 40, 40]}
  - {name: d, box: [144, 112, 40, 40]}
gauges:
  - name: dial
    centre: [100, 85]
    radius: [10, 30]
    sweep: [0, 180]
    scale: [[0, 0], [180, 1]]
    needles: [{name: value, template: {at: 90, span: 20}}]
"""
Grain = Callable[[NDArray[np.float64], np.random.Generator], NDArray[np.float64]]


def knobs() -> NDArray[np.float64]:
    """Grey levels of a plane with four knobs on it, soft enough to be sampled without a trace."""
    y, x = np.mgrid[0:170, 0:200].astype(np.float64)
    light = np.full(x.shape, 60.0)
    for kind, (cx, cy) in enumerate(KNOBS):
        inside = 0.5 * (1.0 - np.tanh((np.hypot(x - cx, y - cy) - 14.0) / 2.4))
        pattern = 110.0 + 30.0 * np.sin((0.25 + 0.02 * kind) * (x - cx) + kind) + 30.0 * np.sin(0.3 * (y - cy) - kind)
        light += (pattern - light) * inside
    return light


def white(light: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """Each pixel has noise of its own."""
    return light + rng.normal(0.0, 4.0, light.shape)


def blurred(light: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """Noise that neighbours share, over some pixels."""
    return light + 8.0 * cv2.GaussianBlur(rng.normal(0.0, 3.0, light.shape), (0, 0), 1.5)


def compressed(light: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """JPEG, whose blocks share what it leaves."""
    noisy = np.clip(white(light, rng), 0, 255).astype(np.uint8)
    jpeg = cv2.imencode(".jpg", noisy, [cv2.IMWRITE_JPEG_QUALITY, 60])[1]
    return cv2.imdecode(jpeg, cv2.IMREAD_GRAYSCALE).astype(np.float64)


def seen(grain: Grain, seed: int) -> GreyPicture:
    """A frame of a camera that keeps its place."""
    return np.clip(grain(knobs(), np.random.default_rng(seed)), 0, 255).round().astype(np.uint8)


def aligned(own: Aligner, frames: Iterable[FramePicture]) -> list[AlignedFrame]:
    """The frames, and where they are found."""
    height, width = knobs().shape
    return [AlignedFrame(frame.pixels, (width, height), None, own.align(frame.pixels)) for frame in frames]


def aligner() -> Aligner:
    """Its panel picture has no noise: all errors are the frames'."""
    return Aligner(parse_panel(PANEL.encode(), source="panel.yaml"), knobs().round().astype(np.uint8))


@pytest.mark.parametrize("grain", [white, blurred, compressed])
def test_alignments_scatter_by_what_they_then_claim(grain: Grain) -> None:
    """Whether neighbouring pixels share their noise or not."""
    own = aligner()
    frames = [FramePicture(seen(grain, seed)) for seed in range(FRAMES)]
    noise = own.noise_beside_claim(aligned(own, frames[:8]))
    place = np.array([[100.0], [85.0]])
    ratios = []
    for frame in frames:
        found = own.align(frame.pixels)
        assert found.covariance is not None
        x, y = found.to_frame((100.0, 85.0))
        ratios.append(((x - 100.0) ** 2 + (y - 85.0) ** 2) / 2 / (noise * found.covariance.sigma_px(place)[0]) ** 2)

    assert 0.6 < float(np.sqrt(np.mean(ratios))) < 1.4


def test_noise_that_neighbours_share_says_more_of_the_motion() -> None:
    """Blurred grain pulls at whole edges."""
    own = aligner()
    shares = {
        grain.__name__: own.noise_beside_claim(aligned(own, (FramePicture(seen(grain, seed)) for seed in range(8))))
        for grain in (white, blurred)
    }

    assert 0.4 < shares["white"] < 0.65  # a half of the claims is for noise that neighbours share
    assert shares["blurred"] > 1.5


def test_frames_in_which_nothing_matches_tell_nothing() -> None:
    """Then alignments are believed as they are."""
    assert aligner().noise_beside_claim([]) == 1.0

"""`python -m benchmarks.pose [COUNT]`: the camera's place from three points, in many random views within 50 degrees."""

from __future__ import annotations

import sys
from collections import Counter

import numpy as np

from decoder.imaging.camera_pose import Pose, PoseSolution, difference_of
from decoder.imaging.pose import pose_from_points
from decoder.panel.errors import PoseError
from decoder.panel.lens import Lens
from fixtures.calibration.views import PIXELS_PER_RADIAN, PRINCIPAL_POINT_PX, SIZE_PX, View, random_view

VIEWS = 10_000
NOISE_PX = 0.3
CHI2_95 = 12.592  # six degrees of freedom
LENS = Lens(SIZE_PX, PRINCIPAL_POINT_PX, PIXELS_PER_RADIAN)


def main(words: list[str]) -> None:
    """Prints what came of the views."""
    views = int(words[0]) if words else VIEWS
    rng = np.random.default_rng(1)
    said: Counter[str] = Counter()
    residuals, lost, squared = [], 0, []
    for _ in range(views):
        view = random_view(rng, 3)
        try:
            exact = _nearest(pose_from_points(view.points_inches[:, :2], view.points_px, LENS), view)
            marked = view.points_px + rng.normal(0, NOISE_PX, view.points_px.shape)
            noisy = _nearest(pose_from_points(view.points_inches[:, :2], marked, LENS, sigma_px=NOISE_PX), view)
        except PoseError as error:
            said[f"{type(error).__name__}: {str(error)[:60]}"] += 1
            continue
        residuals.append(exact.residual_inches)
        lost += int(np.abs(exact.pose.rotation - view.rotation).max() > 1e-4)  # noqa: PLR2004
        if noisy.trusted:
            off = difference_of(noisy.pose, Pose(view.rotation, view.translation_inches))
            squared.append(float(off @ np.linalg.solve(noisy.covariance, off)))
        else:
            said["two solutions fall together within the noise: said"] += 1
    print(f"{views} views: {len(residuals)} converged, largest residual {max(residuals):.1e} inch, truth missed {lost}")
    print(f"with {NOISE_PX} px: {len(squared)} trusted, mean chi-square {np.mean(squared):.2f} (6 expected), median"
          f" {np.median(squared):.2f} (5.35), within 95 %: {np.mean(np.array(squared) < CHI2_95):.1%}")  # fmt: skip
    for reason, count in said.most_common():
        print(f"{count:6d}  {reason}")


def _nearest(solutions: tuple[PoseSolution, ...], view: View) -> PoseSolution:
    return min(solutions, key=lambda solution: float(np.abs(solution.pose.rotation - view.rotation).max()))


if __name__ == "__main__":
    main(sys.argv[1:])

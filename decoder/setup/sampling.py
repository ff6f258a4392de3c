"""A picture between its pixels."""

from __future__ import annotations

import cv2
import numpy as np

from decoder.arrays import Floats
from decoder.pictures import GreyPicture


def sampled_at(picture: GreyPicture, x: Floats, y: Floats) -> Floats:
    """Grey levels at points, bilinear, of the shape of `x` and `y`; outside, the picture's border.

    Only the part around the points is looked at, so that a picture of 18 megapixels costs no more than its dial.
    """
    height, width = picture.shape
    left, top = (max(int(np.floor(values.min())) - 2, 0) for values in (x, y))
    left, top = min(left, width - 1), min(top, height - 1)
    right, bottom = (int(np.ceil(values.max())) + 3 for values in (x, y))
    patch = picture[top : max(bottom, top + 1), left : max(right, left + 1)].astype(np.float32)
    found = cv2.remap(
        patch,
        (x - left).astype(np.float32),
        (y - top).astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(found, np.float32)

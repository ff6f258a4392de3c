"""Which pixels a needle leaves of what lies below it, in blocks of rows around it, of many frames at once."""

from __future__ import annotations

import numpy as np

from decoder.arrays import Floats, Indices, Mask, limited


class UncoveredPixels:
    """The pixels beside a needle, in blocks of so many rows: every so many rows and columns.

    Parameters
    ----------
    touched
        (H, C): the pixels that the needle touches.
    rows, step
        How many rows a block has, and how many rows and columns they are apart.
    """

    def __init__(self, touched: Mask, rows: int, step: int = 1) -> None:
        reach = (rows - 1) * step + 1
        self._margin = reach + 1
        whole = np.pad(touched[:, ::step], ((self._margin, self._margin), (0, 0)))
        between = whole.copy()
        between[1:] |= whole[:-1]
        left = np.logical_not([whole, between]).astype(np.float32)
        (_, length, columns), (layer, row, column) = left.shape, left.strides
        shape, strides = (2, length - reach + 1, rows, columns), (layer, row, step * row, column)
        self._blocks = np.ndarray(shape, left.dtype, left, strides=strides)

    def at(self, first_rows: Indices, needle_rows: Floats) -> Floats:
        """(M, rows, C') float32: 1 where a pixel is left, in blocks from rows (M,) on.

        The needle's own first rows, (M,), may lie between two others: then it touches the pixels of either.
        """
        before = np.floor(needle_rows)
        start = first_rows - before.astype(np.intp) + self._margin
        left: Floats = self._blocks[
            (needle_rows > before).astype(np.intp), limited(start, 0, self._blocks.shape[1] - 1)
        ]
        return left

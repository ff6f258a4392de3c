"""Memory for the pictures of a batch, used again for the next: fresh memory costs a third of a decompression."""

from __future__ import annotations

import numpy as np
import simplejpeg

from decoder.jpeg_header import jpeg_header
from decoder.pictures import GreyPicture, grey_picture


class PictureBlock:
    """Decompresses pictures into memory of its own; each stays until the next is put into the same slot."""

    def __init__(self) -> None:
        self._slots: dict[int, GreyPicture] = {}

    def grey_picture(self, encoded: bytes, slot: int) -> GreyPicture:
        """As `pictures.grey_picture`, bit for bit.

        Raises
        ------
        PictureError
            If the bytes are no picture, or one that breaks off.
        """
        header = jpeg_header(encoded)
        if header is None:
            return grey_picture(encoded)
        size = header.height_px * header.width_px
        if slot not in self._slots or self._slots[slot].size < size:
            self._slots[slot] = np.empty(size, np.uint8)
        buffer = self._slots[slot][:size]
        try:
            picture = simplejpeg.decode_jpeg(encoded, "GRAY", buffer=buffer)
        except ValueError:  # whatever is odd about it, there is one judge
            return grey_picture(encoded)
        return np.asarray(picture[..., 0], np.uint8)

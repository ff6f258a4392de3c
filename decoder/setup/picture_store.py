"""The pictures of one set-up by key, decompressed when they are needed and kept while there is room.

`panel` is the picture that an opened panel was drawn on, `frame-N` a picture of the flight.
"""

from __future__ import annotations

import re
import threading
from collections import OrderedDict
from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.errors import PictureError
from decoder.pictures import GreyPicture, grey_picture
from decoder.setup.sources import PictureSource

ColourPicture = NDArray[np.uint8]
PANEL_KEY = "panel"
# Of 18 megapixels: twenty frames and the panel picture in grey, and one picture in colour.
KEPT_BYTES = 450 * 2**20
_KEY = re.compile(r"frame-(\d{1,9})")

Decompress = Callable[[bytes], NDArray[np.uint8]]


class PictureStore:
    """Encoded, grey and coloured pictures by key; safe to use from several threads."""

    def __init__(self, source: PictureSource, panel_picture: bytes | None) -> None:
        self.source = source
        self._panel_picture = panel_picture
        self._kept: OrderedDict[tuple[str, int], NDArray[np.uint8]] = OrderedDict()
        self._lock = threading.Lock()

    def encoded(self, key: str) -> bytes:
        """The picture as it was recorded.

        Raises
        ------
        PictureError
            If there is none under that key.
        """
        if key == PANEL_KEY and self._panel_picture is not None:
            return self._panel_picture
        match = _KEY.fullmatch(key)
        if match is None or int(match[1]) >= self.source.count:
            raise PictureError("there is no such picture")
        with self._lock:
            return self.source.encoded(int(match[1]))

    def grey(self, key: str) -> GreyPicture:
        """(H, W) uint8: the luma, as the decoder sees it."""
        return self._keep((key, cv2.IMREAD_GRAYSCALE), grey_picture)

    def colour(self, key: str, shrink: int = 1) -> ColourPicture:
        """(H, W, 3) uint8 BGR: for people to look at; shrunk by 2, 4 or 8 while it is decompressed."""
        flags = {
            1: cv2.IMREAD_COLOR,
            2: cv2.IMREAD_REDUCED_COLOR_2,
            4: cv2.IMREAD_REDUCED_COLOR_4,
            8: cv2.IMREAD_REDUCED_COLOR_8,
        }[shrink]
        return self._keep((key, flags), lambda encoded: _coloured(encoded, flags))

    def forget_colours(self, but: str) -> None:
        """Lets go of the coloured pictures of all keys but one."""
        with self._lock:
            for key in [each for each in self._kept if each[0] != but and each[1] != cv2.IMREAD_GRAYSCALE]:
                del self._kept[key]

    def _keep(self, key: tuple[str, int], make: Decompress) -> NDArray[np.uint8]:
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        made = make(self.encoded(key[0]))
        with self._lock:
            self._kept[key] = made
            while len(self._kept) > 1 and sum(each.nbytes for each in self._kept.values()) > KEPT_BYTES:
                self._kept.popitem(last=False)
        return made


def _coloured(encoded: bytes, flags: int) -> ColourPicture:
    try:
        picture = cv2.imdecode(np.frombuffer(encoded, np.uint8), flags | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error as error:
        raise PictureError("the picture cannot be decompressed") from error
    if picture is None:
        raise PictureError("the picture is damaged or cut short")
    return np.asarray(picture, np.uint8)

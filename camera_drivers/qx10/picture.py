"""A downloaded picture: whether it is whole, and the frame made of it.

It was taken at an unknown moment between request and answer: the camera focuses before and processes after. So
mid-exposure is estimated in the middle of the interval, with a uniform distribution. The interval is measured with the
box's monotonic clock, so setting the wall clock meanwhile does not stretch it.
"""

from __future__ import annotations

import hashlib
import io
import math
import warnings
from itertools import count

from PIL import Image

from camera_drivers.clock import realtime_ns
from camera_drivers.exif import read_exif
from camera_drivers.jpeg import jpeg_end, jpeg_facts
from flight_file.documents import picture_header
from flight_file.frame import NS_PER_S, Exif, Frame, HostTimes

_MOST_BUFFERED_BYTES = 2 * 3 * 4896 * 3672  # coefficients of this camera's largest pictures in colour: 103 MiB
# Exceptions seen from Pillow on damaged pictures; it takes the size from the last of several headers.
_DAMAGE = (
    OSError,
    ValueError,
    SyntaxError,
    ArithmeticError,
    LookupError,
    TypeError,
    AttributeError,
    Image.DecompressionBombError,
)
_SHRUNK = (512, 512)  # decoded at an eighth: all of the coded data is read, little of the memory needed


def fault_of(jpeg: bytes) -> str:
    """Describe what is wrong with a picture, in a few words; empty if it can be shown.

    It is decoded only as far as a reader of the flight would, and within the board's memory.
    """
    if jpeg_facts(jpeg).width_px is None:
        return "the picture is not a JPEG"
    # A picture may be followed by something else, such as a second, smaller picture.
    end = jpeg_end(jpeg)
    if end is None:
        return "the picture is cut short"
    picture = jpeg[:end]
    header = picture_header(picture)
    if header is None or header.objection(len(picture)) or header.buffered_bytes > _MOST_BUFFERED_BYTES:
        return "the picture is larger than any of this camera, or coded in another way"
    return "" if _decodes(picture) else "the picture is damaged"


def _decodes(jpeg: bytes) -> bool:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow warns of odd EXIF, which does not matter here
            with Image.open(io.BytesIO(jpeg), formats=("JPEG",)) as image:
                image.draft("L", _SHRUNK)
                image.load()
    except _DAMAGE:
        return False
    return True


class FrameMaker:
    """Makes and counts frames; a lost picture leaves a gap in the count."""

    def __init__(self) -> None:
        self._numbers = count()

    def skip(self) -> None:
        """Count a picture that cannot be fetched."""
        next(self._numbers)

    def frame(
        self, jpeg: bytes, times: HostTimes, *, zoom_position: float | None, taken: tuple[int, int] | None = None
    ) -> Frame:
        """Make the next frame.

        Parameters
        ----------
        zoom_position
            0 to 100 percent; None if the camera does not say.
        taken
            Mid-exposure by the monotonic clock and its standard deviation, ns, if known better than from `times`.
        """
        facts = jpeg_facts(jpeg)
        exif = read_exif(facts.exif)
        middle_ns, sigma_ns = taken or middle_of_exposure(times, exif)
        return Frame(
            sequence=next(self._numbers),
            captured_ns=realtime_ns(middle_ns, times.after_answer),
            encoded=jpeg,
            sha256=hashlib.sha256(jpeg).hexdigest(),
            times=times,
            exif=exif,
            width_px=facts.width_px,
            height_px=facts.height_px,
            zoom_position=zoom_position,
            captured_sigma_ns=sigma_ns,
        )


def middle_of_exposure(times: HostTimes, exif: Exif) -> tuple[int, int]:
    """Estimate mid-exposure by the monotonic clock, and its standard deviation, ns."""
    start_ns, end_ns = times.before_request.monotonic_ns, times.after_answer.monotonic_ns
    took_ns = end_ns - start_ns
    exposure_ns = round(min((exif.exposure_s or 0.0) * NS_PER_S, took_ns))  # no infinite number can be rounded
    return (start_ns + end_ns) // 2, round((took_ns - exposure_ns) / math.sqrt(12))

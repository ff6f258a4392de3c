"""Films of a flight: one with each reading drawn in and a strip of values below, and a small plain one for the report.

Each frame is shown at its own time, so the rate varies as the camera's did. The file is what players expect: H.264 with
4:2:0 and even sides, the index at the start, limited-range levels and BT.709, and no B-frames, because with them FFmpeg
states a wrong duration if the rate varies.

Frames pass one at a time, and a fixed number of threads encodes: the same flight gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from heapq import merge
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from PIL import Image, ImageDraw

from decoder.imaging.pictures import ColourPicture, colour_picture
from decoder.imaging.video import GroupDecoder, encoded_of
from decoder.instruments.reading import Status
from decoder.outputs.csv_output import utc_text
from decoder.outputs.drawn_readings import (
    STATUS_COLOURS,
    DrawnReading,
    Point,
    ReadingPlaces,
    drawn_reading,
    label_decimals,
)
from decoder.outputs.frame_picture import (
    INK,
    PAPER,
    QUIET,
    Box,
    Chip,
    View,
    caption,
    draw_needles,
    font,
    matched_frames,
    moved,
    seen,
)
from decoder.outputs.outputs import Decoded
from decoder.panel.arrays import Floats
from decoder.panel.errors import OutputError, PictureError
from decoder.timeseries.flight_data import FlightData
from flight_file.frame import NS_PER_S, Frame, Sound, SoundPacket
from flight_file.video.sound import playable

if TYPE_CHECKING:
    from av.container import OutputContainer
    from av.video.stream import VideoStream

TICKS_PER_S = 90_000
"""What times in the film are counted in."""
PICTURES_OF_GROUP = 12  # from one key frame to the next, so that players can seek
REPORT_HEIGHT_PX, REPORT_CRF = 480, 26
USUAL_NS = NS_PER_S // 25  # how long a frame is shown if nothing tells
THREADS = "4"
BT709, TELEVISION = 1, 1  # FFmpeg's codes
NEEDS = "a film needs PyAV; install it: pip install 'image-flight-recorder[video]'"


@dataclass(frozen=True, slots=True)
class Shown:
    """One picture of a film, (H, W, 3) uint8 RGB with even sides, and when it is shown, in ticks from the first."""

    tick: int
    picture: ColourPicture


class FilmClock:
    """Tells when each frame is shown, from when it was taken.

    Attributes
    ----------
    jumps
        How often a frame was taken before its predecessor, or hours after it, because a clock was set; the film then
        continues with the previous step.
    """

    def __init__(self) -> None:
        self.jumps = 0
        self._taken_ns: int | None = None
        self._film_ns, self._step_ns, self._tick = 0, USUAL_NS, -1

    def tick(self, taken_ns: int) -> int:
        """Return when this frame is shown, in ticks from the first one; always later than the one before."""
        if self._taken_ns is not None:
            step_ns = taken_ns - self._taken_ns
            if 0 < _ticks(step_ns) <= np.iinfo(np.int32).max:  # the limit of MP4
                self._step_ns = step_ns
            else:
                self.jumps += 1
            self._film_ns += self._step_ns
        self._taken_ns = taken_ns
        self._tick = max(self._tick + 1, _ticks(self._film_ns))
        return self._tick


def _ticks(time_ns: int) -> int:
    return round(Fraction(time_ns * TICKS_PER_S, NS_PER_S))


def film_times_s(data: FlightData) -> Floats:
    """(N,): when each row of flight data is shown in a film of all of them, in seconds."""
    clock = FilmClock()
    return np.array([clock.tick(taken_ns) / TICKS_PER_S for taken_ns in data.time_ns.tolist()])


class FilmPainter:
    """Draws a flight's frames for its film, all at the size of the first.

    Each gauge's values stay in one place beside it, which is chosen in the first frame with a panel.
    """

    def __init__(self, decoded: Decoded, size_px: tuple[int, int]) -> None:
        self._data, self._recording = decoded.data, decoded.provenance.recording
        self._places = ReadingPlaces(decoded.source, decoded.data)
        self._reasons = {missing.frame: missing.reason for missing in decoded.data.missing_frames}
        self._size_px = size_px
        self._text_px = max(12, round(size_px[0] / 95))
        self._strip = _Strip(decoded.data, size_px[0], self._text_px)
        self._corners: list[Point] = []

    def painted(self, row: int, picture: ColourPicture | None, trouble: str = "") -> ColourPicture:
        """Draw one frame, by its row in the flight data; a dark one if its picture is damaged."""
        width, height = self._size_px
        strip_px = self._strip.height_px
        whole = Image.new("RGB", (width, height + strip_px + (height + strip_px) % 2), PAPER)
        if picture is not None:
            whole.paste(self._picture(row, picture), (0, 0))
        remark = trouble or self._reasons.get(int(self._data.frame[row]), "")
        self._strip.draw(ImageDraw.Draw(whole), height, row, (caption(self._data, row, self._recording), remark))
        return np.asarray(whole)

    def _picture(self, row: int, picture: ColourPicture) -> Image.Image:
        view = _fitting(picture, self._size_px)
        gauges = self._places.frame(row)
        pixels = _filled(seen(picture, view), self._size_px)
        for gauge in gauges:
            draw_needles(pixels, gauge, view)
        image = Image.fromarray(pixels)
        boxes = [moved(gauge.box_px, view) for gauge in gauges]
        chips = [Chip(_named(gauge.readings), self._text_px) for gauge in gauges]
        if gauges and not self._corners:
            self._corners = _corners(chips, boxes, self._size_px)
        for chip, box, (x, y) in zip(chips, boxes, self._corners if gauges else (), strict=True):
            chip.draw(image, chip.box_at((box[0] + x, box[1] + y), self._size_px))
        return image


def _named(readings: Sequence[DrawnReading]) -> list[DrawnReading]:
    """Drop the name of a gauge's only reading, which is obvious in the picture, and given in the strip."""
    return [replace(reading, name="") for reading in readings] if len(readings) == 1 else list(readings)


def _corners(chips: Sequence[Chip], boxes: Sequence[Box], size_px: tuple[int, int]) -> list[Point]:
    """Return where each gauge's values cover least of the others, relative to its box's top left corner."""
    taken = list(boxes)
    found = []
    for number, (chip, box) in enumerate(zip(chips, boxes, strict=True)):
        best = chip.box_near(box, taken[:number] + taken[number + 1 :], size_px)
        taken.append(best)
        found.append((best[0] - box[0], best[1] - box[1]))
    return found


def _fitting(picture: ColourPicture, size_px: tuple[int, int]) -> View:
    """Show a whole frame as large as it fits."""
    height, width = picture.shape[:2]
    return View(0, 0, width, height, min(size_px[0] / width, size_px[1] / height))


def _filled(pixels: ColourPicture, size_px: tuple[int, int]) -> ColourPicture:
    """Pad a picture with black, and crop it, to a size."""
    width, height = size_px
    if pixels.shape[:2] == (height, width):
        return pixels
    whole = np.full((height, width, 3), PAPER, np.uint8)
    part = pixels[:height, :width]
    whole[: len(part), : part.shape[1]] = part
    return whole


class _Strip:
    """The values below the picture: a line that identifies the frame, and a cell for each reading.

    A cell is as wide as its widest content over the whole flight, so that nothing moves.
    """

    def __init__(self, data: FlightData, width_px: int, text_px: int) -> None:
        self._data = [(series, label_decimals(series)) for series in data.series]
        self._large, self._small = font(round(text_px * 1.1)), font(round(text_px * 0.8))
        self._text_px, self._pad_px = text_px, text_px * 0.6
        extremes = [_extremes(series.value, series.sigma) for series, _ in self._data]
        widest = [
            self._cell_px(drawn_reading(series, row, decimals))
            for (series, decimals), rows in zip(self._data, extremes, strict=True)
            for row in rows
        ]
        self._columns = max(1, int((width_px - self._pad_px) // max(widest, default=width_px)))
        self._column_px = (width_px - self._pad_px) / self._columns
        rows = -(-len(self._data) // self._columns)
        self._row_px = text_px * 2.5
        self.height_px = round(text_px * 1.9 + rows * self._row_px + self._pad_px / 2)

    def draw(self, pencil: ImageDraw.ImageDraw, top: int, row: int, told: tuple[str, str]) -> None:
        """Draw it below a picture that ends at `top`."""
        words, remark = told
        middle = top + self._text_px
        pencil.text((self._pad_px, middle), words, font=self._large, fill=INK, anchor="lm")
        x = 3 * self._pad_px + self._large.getlength(words)
        pencil.text((x, middle), remark, font=self._large, fill=STATUS_COLOURS[Status.MISSING], anchor="lm")
        for place, (series, decimals) in enumerate(self._data):
            line, column = divmod(place, self._columns)
            at = (self._pad_px + column * self._column_px, top + self._text_px * 1.9 + line * self._row_px)
            self._draw_cell(pencil, at, drawn_reading(series, row, decimals))

    def _draw_cell(self, pencil: ImageDraw.ImageDraw, at: Point, reading: DrawnReading) -> None:
        (x, y), colour, unit = at, STATUS_COLOURS[reading.status], self._text_px
        pencil.rectangle((x, y + 0.1 * unit, x + 0.25 * unit, y + 2.1 * unit), fill=colour)
        x += self._pad_px
        pencil.text((x, y + 0.85 * unit), reading.name, font=self._small, fill=QUIET, anchor="ls")
        after = x + self._small.getlength(reading.name) + self._pad_px
        pencil.text((after, y + 0.85 * unit), reading.status.value, font=self._small, fill=colour, anchor="ls")
        pencil.text((x, y + 2.05 * unit), reading.text, font=self._large, fill=colour, anchor="ls")
        after = x + self._large.getlength(reading.text) + self._pad_px
        pencil.text((after, y + 2.05 * unit), reading.spread, font=self._small, fill=QUIET, anchor="ls")

    def _cell_px(self, reading: DrawnReading) -> float:
        """Return the width of a reading's cell, whatever its status."""
        longest = max(self._small.getlength(status.value) for status in Status)
        above = self._small.getlength(reading.name) + longest
        below = self._large.getlength(reading.text) + self._small.getlength(reading.spread)
        return max(above, below) + 4 * self._pad_px


def _extremes(value: Floats, sigma: Floats) -> set[int]:
    """Find the rows with the longest texts: the lowest and highest value, and the largest sigma."""
    if not value.size:
        return set()
    low, high = np.nan_to_num(value, nan=np.inf), np.nan_to_num(value, nan=-np.inf)
    return {int(low.argmin()), int(high.argmax()), int(np.nan_to_num(sigma, nan=-np.inf).argmax())}


def drawn_film(
    decoded: Decoded, frames: Iterable[tuple[int, Frame]], height_px: int, tell: Callable[[str], None]
) -> Iterator[Shown]:
    """Draw a film of frames, each with its row in the flight data; `tell` gets a sentence for each problem."""
    painter: FilmPainter | None = None
    clock = FilmClock()
    for row, frame, picture, trouble in _pictures(frames):
        if trouble:
            tell(f"frame {frame.sequence} is dark in the film: {trouble}")
        if painter is None:
            painter = FilmPainter(decoded, _size_px(decoded, picture, height_px))
        yield Shown(clock.tick(int(decoded.data.time_ns[row])), painter.painted(row, picture, trouble))
    if clock.jumps:
        tell(f"after {clock.jumps} of the frames the clock goes back, or on by hours: the film goes on steadily")


def write_report_film(decoded: Decoded, stream: IO[bytes]) -> None:
    """Write a small film of all frames as they are, for the report to show beside its plots.

    Raises
    ------
    OutputError
        As `write_film`.
    """
    write_film(_plain_film(decoded), Path(stream.name), REPORT_CRF)


def _plain_film(decoded: Decoded) -> Iterator[Shown]:
    size_px: tuple[int, int] | None = None
    clock = FilmClock()
    for row, _, picture, _ in _pictures(enumerate(matched_frames(decoded.data, decoded.frames))):
        size_px = size_px or _size_px(decoded, picture, REPORT_HEIGHT_PX)
        small = np.empty((0, 0, 3), np.uint8) if picture is None else seen(picture, _fitting(picture, size_px))
        yield Shown(clock.tick(int(decoded.data.time_ns[row])), _filled(small, size_px))


def _pictures(frames: Iterable[tuple[int, Frame]]) -> Iterator[tuple[int, Frame, ColourPicture | None, str]]:
    """Decompress frames: row, frame, picture, and the reason if there is none."""
    video = GroupDecoder()
    for row, frame in frames:
        try:
            yield row, frame, colour_picture(encoded_of(frame), video), ""
        except PictureError as error:
            yield row, frame, None, str(error)


def _size_px(decoded: Decoded, picture: ColourPicture | None, height_px: int) -> tuple[int, int]:
    """Return width and height of a film's pictures, both even, for frames of this size, or else the panel picture's."""
    width, height = decoded.source.optics.size_px if picture is None else picture.shape[1::-1]
    wanted = min(height_px, height)
    return max(2, round(width * wanted / height) // 2 * 2), max(2, wanted // 2 * 2)


@dataclass(frozen=True, slots=True)
class Sounding:
    """A packet of sound as it was recorded, in the film's ticks."""

    tick: int
    packet: SoundPacket


def sound_beside(heard: Iterable[Sound], first_ns: int, last_ns: int) -> Iterator[Sounding]:
    """Choose the packets of sound between the first and the last picture, at their times in the film."""
    for each in heard:
        if isinstance(each, SoundPacket) and first_ns <= each.time_ns <= last_ns:
            yield Sounding(_ticks(each.time_ns - first_ns), each)


def write_film(
    shown: Iterable[Shown],
    path: Path,
    crf: int,
    began_ns: int | None = None,
    sound: Iterable[Sounding] = (),
) -> None:
    """Encode pictures into an MP4, and add packets of sound unchanged.

    Parameters
    ----------
    began_ns
        When the first was taken, if known: the creation time that the file states.
    sound
        In order of time, all of one codec.

    Raises
    ------
    OutputError
        PyAV is not installed, or lacks x264; there is no picture; or the file cannot be written.
    """
    if find_spec("av") is None:
        raise OutputError(NEEDS)
    import av  # noqa: PLC0415 - an extra, which other outputs do not need

    coming = iter(shown)
    first = next(coming, None)
    if first is None:
        raise OutputError("there is no frame to make a film of; choose another --from and --to")
    height, width = first.picture.shape[:2]
    try:
        with av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"}) as container:
            if began_ns is not None:
                container.metadata["creation_time"] = utc_text(began_ns)
            stream: VideoStream = container.add_stream("libx264", options=_x264(crf))
            _describe(stream, width, height)
            pictures = _encoded(stream, chain([first], coming))
            for packet in merge(pictures, _packed(container, sound), key=lambda each: each.pts):
                container.mux(packet)
    except av.codec.codec.UnknownCodecError as error:
        raise OutputError(f"this PyAV lacks x264; {NEEDS}") from error
    except av.FFmpegError as error:
        if isinstance(error, OSError) and error.errno:
            raise
        raise OutputError(f"the film cannot be encoded: {error.strerror}") from error


def _x264(crf: int) -> dict[str, str]:
    return {"crf": str(crf), "preset": "veryfast", "profile": "high", "threads": THREADS}


def _describe(stream: VideoStream, width: int, height: int) -> None:
    stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
    coder = stream.codec_context
    stream.time_base = coder.time_base = Fraction(1, TICKS_PER_S)
    coder.gop_size, coder.max_b_frames = PICTURES_OF_GROUP, 0
    coder.color_primaries = coder.color_trc = coder.colorspace = BT709
    coder.color_range = TELEVISION


def _packed(container: OutputContainer, sound: Iterable[Sounding]) -> Iterator[Any]:
    """Pack sound for the container; its stream has to be created before the first picture is written."""
    coming = iter(sound)
    first = next(coming, None)
    if first is None:
        return iter(())
    stream = container.add_mux_stream(first.packet.codec, rate=first.packet.sample_rate_hz)
    return (_sound_packet(each, stream) for each in chain([first], coming))


def _sound_packet(sounding: Sounding, stream: Any) -> Any:  # noqa: ANN401 - PyAV's, an extra
    from av import Packet  # noqa: PLC0415 - as above

    packet = Packet(playable(sounding.packet))
    packet.stream, packet.time_base = stream, Fraction(1, TICKS_PER_S)
    packet.pts = packet.dts = sounding.tick
    return packet


def _encoded(stream: VideoStream, shown: Iterable[Shown]) -> Iterator[Any]:
    """Encode pictures; the last is shown as long as the one before, since nothing else tells."""
    held: Any = None
    step = round(USUAL_NS * TICKS_PER_S / NS_PER_S)
    for packet in _packets(stream, shown):
        if held is not None:
            step = packet.pts - held.pts
            yield held
        held = packet
    held.duration = step
    yield held


def _packets(stream: VideoStream, shown: Iterable[Shown]) -> Iterator[Any]:
    from av import VideoFrame  # noqa: PLC0415 - as above

    for each in shown:
        frame = VideoFrame.from_ndarray(np.ascontiguousarray(each.picture), "rgb24")
        frame = frame.reformat(format="yuv420p", dst_colorspace="ITU709")
        frame.pts, frame.time_base = each.tick, Fraction(1, TICKS_PER_S)
        yield from stream.encode(frame)
    yield from stream.encode(None)

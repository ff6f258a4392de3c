"""The part of a film's sound that is kept: the strongest tones of short windows, which do not reveal speech.

Windows of 0.75 s, one every 0.25 s, each weighted by a Hann window; the sound is mixed to one channel and brought to
2400 samples a second before. At most 24 peaks of a window's power spectrum between 20 and 1000 Hz are kept, the highest
above the spectrum around them, with only frequency and level. docs/sound.md explains why speech is not contained.

Peaks lie between the spectrum's points, at the vertex of a parabola through the three highest levels in dB. Source:
J. O. Smith, Spectral Audio Signal Processing, "Quadratic Interpolation of Spectral Peaks".
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

import av
import numpy as np
from av.audio.frame import AudioFrame
from av.audio.stream import AudioStream
from av.container import InputContainer
from av.error import FFmpegError
from av.stream import Discard
from numpy.typing import NDArray

from flight_file.frame import NS_PER_S, Sound, SoundPacket, SoundPeaks

RATE_HZ = 2400
WINDOW, STEP = 1800, 600  # samples
BAND_HZ = (20.0, 1000.0)
MOST_PEAKS = 24
_POINTS = 4096  # of the transform: a point each 0.59 Hz
_LOBE = 5  # points to the edge of a tone's main lobe
_AROUND = 34  # points, 20 Hz: the spectrum around a tone is the median of five such blocks
_SILENCE = 1e-20  # of a full-scale tone's power: gives zeros a level too
_BATCH = 64  # windows transformed together

_Samples = NDArray[np.float64]


def _track(container: InputContainer) -> AudioStream | None:
    """Choose the track to be heard: the first with a known codec; None if there is none."""
    return next((each for each in container.streams.audio if each.codec_context is not None), None)  # type: ignore[redundant-expr]  # it is where FFmpeg knows no such codec


def listened(container: InputContainer, zero_ns: int, *, keep_packets: bool) -> Iterator[Sound]:
    """Iterate over what is kept of a film's sound, in order of time; nothing if it has no sound.

    No window spans missing or undecodable packets: the gap shows in the windows' times.

    Parameters
    ----------
    container
        The film, opened for this only.
    zero_ns
        Time at which its own time is 0.
    keep_packets
        Whether the packets themselves are wanted too.
    """
    track = _track(container)
    if track is None:
        return
    for stream in container.streams:
        if stream.index != track.index:
            stream.discard = Discard.all  # no need to read the pictures twice
    windows = _Windows(zero_ns)
    packets = _packets(container, track)
    for packet in packets:
        if keep_packets and packet.size and packet.pts is not None:
            yield _kept(packet, track, zero_ns)
        try:
            frames = track.decode(packet)
        except FFmpegError:
            continue
        for frame in frames:
            yield from windows.feed(frame)
    yield from windows.end()


def _packets(container: InputContainer, track: AudioStream) -> Iterator[av.Packet[AudioStream]]:
    """Iterate over the packets up to where the file breaks off; the last one is empty and flushes the decoder."""
    try:
        yield from container.demux(track)
    except FFmpegError:
        return


def _kept(packet: av.Packet[AudioStream], track: AudioStream, zero_ns: int) -> SoundPacket:
    context = track.codec_context
    time_ns = round((packet.pts or 0) * (packet.time_base or Fraction(0)) * NS_PER_S)
    return SoundPacket(
        time_ns=max(zero_ns + time_ns, 0),
        codec=context.name,
        sample_rate_hz=track.rate,
        channels=track.channels,
        header=bytes(context.extradata or b""),
        encoded=bytes(packet),
    )


class _Windows:
    """Cuts frames of sound into windows, restarting after every gap."""

    def __init__(self, zero_ns: int) -> None:
        self._zero_ns = zero_ns
        self._begin()

    def _begin(self) -> None:
        self._resampler = av.AudioResampler(format="flt", layout="mono", rate=RATE_HZ)
        self._start_s: Fraction | None = None
        self._until_s = Fraction(0)
        self._samples: _Samples = np.empty(0)

    def feed(self, frame: AudioFrame) -> Iterator[SoundPeaks]:
        """Take a frame; yield the windows that are full by then."""
        if frame.pts is None or frame.time_base is None or not frame.samples:
            return
        time_s, length_s = Fraction(frame.pts * frame.time_base), Fraction(frame.samples, frame.sample_rate)
        if self._start_s is not None and abs(time_s - self._until_s) > length_s / 2:
            yield from self.end()
        if self._start_s is None:
            self._start_s = self._until_s = time_s
        self._until_s += length_s
        self._take(frame)
        if len(self._samples) >= WINDOW + _BATCH * STEP:
            yield from self._full()

    def end(self) -> Iterator[SoundPeaks]:
        """Yield the remaining windows, and restart."""
        if self._start_s is not None:
            self._take(None)
            yield from self._full()
        self._begin()

    def _take(self, frame: AudioFrame | None) -> None:
        came = [each.to_ndarray().ravel() for each in self._resampler.resample(frame)]
        self._samples = np.concatenate([self._samples, *came])

    def _full(self) -> Iterator[SoundPeaks]:
        count = max((len(self._samples) - WINDOW) // STEP + 1, 0)
        if not count or self._start_s is None:
            return
        cut = np.lib.stride_tricks.sliding_window_view(self._samples, WINDOW)[: count * STEP : STEP]
        for index, (frequencies, levels, above) in enumerate(spectral_peaks(cut)):
            middle_s = self._start_s + Fraction(2 * index * STEP + WINDOW, 2 * RATE_HZ)
            time_ns = max(self._zero_ns + round(middle_s * NS_PER_S), 0)
            yield SoundPeaks(time_ns, WINDOW / RATE_HZ, frequencies, levels, above)
        self._samples = self._samples[count * STEP :]
        self._start_s += Fraction(count * STEP, RATE_HZ)


def spectral_peaks(windows: _Samples) -> Iterator[tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]]:
    """Find the strongest tones of each window.

    Parameters
    ----------
    windows
        (N, 1800) samples at 2400 Hz, full scale 1.

    Yields
    ------
    tuple
        For each window frequencies in Hz, rising, to 0.01; levels in dB of a full-scale sine, and dB above the spectrum
        around, both to 0.1.
    """
    hann = np.sin(np.pi * np.arange(WINDOW) / WINDOW) ** 2
    spectra = np.abs(np.fft.rfft(windows * hann, _POINTS)) * 2 / hann.sum()
    level = 10 * np.log10(spectra**2 + _SILENCE)
    above = level - _around(level)
    first, last = (round(edge / RATE_HZ * _POINTS) for edge in BAND_HZ)
    points = np.arange(first, last)
    beside = np.delete(np.arange(-_LOBE, _LOBE + 1), _LOBE)
    highest = level[:, points[:, None] + beside].max(axis=2)
    for row in range(len(level)):
        own = points[level[row, points] > highest[row]]
        own = np.sort(own[np.argsort(-above[row, own], kind="stable")[:MOST_PEAKS]])
        left, top, right = (level[row, own + shift] for shift in (-1, 0, 1))
        off = (left - right) / (2 * (left - 2 * top + right))
        yield (
            tuple(np.round((own + off) * RATE_HZ / _POINTS, 2).tolist()),
            tuple(np.round(top - (left - right) * off / 4, 1).tolist()),
            tuple(np.round(above[row, own], 1).tolist()),
        )


def _around(level: _Samples) -> _Samples:
    """(N, P): the level around each point of spectra, dB: the median of 20 Hz, and of such over 100 Hz."""
    blocks = level.shape[1] // _AROUND
    medians = np.median(level[:, : blocks * _AROUND].reshape(len(level), blocks, _AROUND), axis=2)
    padded = np.pad(medians, ((0, 0), (2, 2)), mode="edge")
    smooth = np.median(np.stack([padded[:, shift : shift + blocks] for shift in range(5)]), axis=0)
    middles = (np.arange(blocks) + 0.5) * _AROUND
    around: _Samples = np.stack([np.interp(np.arange(level.shape[1]), middles, row) for row in smooth])
    return around

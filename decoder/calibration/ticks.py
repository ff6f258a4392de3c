"""A ruler's ticks along a line of a photograph, to a few hundredths of a pixel.

The period comes from the profile's autocorrelation, checked against the graduations that rulers have; its drift along
the ruler (perspective, distortion) from the local phase; each tick's own place from least squares against the mean
tick. A tick that does not look like the others, because a numeral touches it or light washes it out, is left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from decoder.calibration.profile import Array, Line, profile
from decoder.calibration.thresholds import MIN_PERIOD_PX, MIN_TICKS, PER_PX, PERIODIC
from decoder.calibration.tick_shape import fitted
from decoder.imaging.pictures import GreyPicture
from decoder.imaging.thresholds import HALF, HAND_PART
from decoder.panel.errors import CalibrationError
from decoder.registration.thresholds import NOISE_LEVELS

INCHES_PER_CM = 1 / 2.54
GRADUATIONS_INCHES = {
    **{f"{Fraction(1, part)} inch": 1 / part for part in (32, 16, 10, 8, 4, 2, 1)},
    "1 mm": INCHES_PER_CM / 10,
    "5 mm": INCHES_PER_CM / 2,
    "1 cm": INCHES_PER_CM,
}
_PHASE_WINDOW = 2.0  # periods
_CARRIED = 20  # ticks whose distances predict the next one's number
_NEAR = 0.08  # the furthest a tick may be from where the phase puts it, in periods
_ROUNDS = 4


@dataclass(frozen=True, slots=True, eq=False)
class Ticks:
    """Ticks found on a line.

    Attributes
    ----------
    graduation
        What lies between two ticks, such as "1 mm".
    number
        (N,) which tick each is; whole numbers that rise along the line, with gaps where a tick was left out.
    along_px
        (N,) their distances from the line's start.
    points_px
        (N, 2) where they are.
    """

    graduation: str
    number: Array
    along_px: Array
    points_px: Array

    @property
    def inches(self) -> Array:
        """(N,) their places on the ruler, counted from the first."""
        return np.asarray((self.number - self.number[0]) * GRADUATIONS_INCHES[self.graduation])


def find_ticks(picture: GreyPicture, line: Line, inches: float) -> Ticks:
    """Find the ticks along a line.

    Parameters
    ----------
    picture : (H, W) uint8
    line : along the ruler, across the ticks; its ends need not be on ticks
    inches : about how long the line is on the ruler; within a few percent

    Raises
    ------
    CalibrationError
        If there are none, or they are at distances that no ruler has.
    """
    levels = profile(picture, line)
    graduation, period = _period(levels, line.length_px / inches)
    cycles = _cycles(levels, period)
    places = _rough_places(levels, cycles)
    if len(places) < MIN_TICKS:
        raise _none_found()
    along, good = fitted(picture, line, places)
    if np.count_nonzero(good) < MIN_TICKS:
        raise _none_found()
    along = along[good]
    return Ticks(graduation, _numbers(along), along, line.points(along))


def _numbers(along: Array) -> Array:
    """(N,) which tick each is, counted from tick to tick: over a gap the phase may lose count, distances do not."""
    numbers = np.zeros(len(along))
    per_px = 1 / float(np.median(np.diff(along)[:_CARRIED]))
    for index in range(1, len(along)):
        if index >= MIN_TICKS:
            per_px = float(np.polyfit(along[:index][-_CARRIED:], numbers[:index][-_CARRIED:], 1)[0])
        numbers[index] = numbers[index - 1] + max(round(per_px * (along[index] - along[index - 1])), 1)
    return numbers


def _none_found() -> CalibrationError:
    return CalibrationError(
        "no ticks are found on the line; draw it along the ruler's edge, across ticks that stand at least three pixels"
        " apart"
    )


def _period(levels: Array, px_per_inch: float) -> tuple[str, float]:
    """Recognize the graduation by the shortest period a ruler may have; return its name, and the period in samples."""
    smooth = levels - _moving_mean(levels, max(len(levels) // 6, 8 * PER_PX))
    if np.std(smooth) < NOISE_LEVELS:
        raise _none_found()
    correlation = _autocorrelation(smooth)
    inner = correlation[1:-1]
    peaks = 1 + np.flatnonzero((inner > correlation[:-2]) & (inner >= correlation[2:]))
    peaks = peaks[peaks >= MIN_PERIOD_PX * PER_PX]
    if not peaks.size or correlation[peaks].max() < PERIODIC:
        raise _none_found()
    shortest = peaks[correlation[peaks] >= HALF * correlation[peaks].max()][0]
    period = _parabola(correlation, int(shortest))
    apart = period / PER_PX / px_per_inch
    name, size = min(GRADUATIONS_INCHES.items(), key=lambda item: abs(np.log(item[1] / apart)))
    if abs(apart / size - 1) < HAND_PART:
        return name, period
    raise CalibrationError(
        f"the ticks on the line are {apart:.3g} inches apart if the"
        " line is as long as you say, and no ruler has that; check its ends and its length"
    )


def _autocorrelation(levels: Array) -> Array:
    """(n / 2,) the autocorrelation of the levels at each shift, over the overlap."""
    count = len(levels)
    spectrum = np.fft.rfft(levels, 2 * count)
    sums = np.fft.irfft(np.abs(spectrum) ** 2)[: count // 2]
    overlap = count - np.arange(count // 2)
    return np.asarray(sums / overlap / (sums[0] / count))


def _parabola(values: Array, peak: int) -> float:
    before, at, after = values[peak - 1 : peak + 2]
    return float(peak + 0.5 * (before - after) / (before - 2 * at + after))


def _moving_mean(levels: Array, window: int) -> Array:
    padded = np.pad(levels, window // 2, mode="reflect")
    sums = np.concatenate([[0.0], np.cumsum(padded)])
    return np.asarray((sums[2 * (window // 2) + 1 :] - sums[: len(levels)])[: len(levels)] / (2 * (window // 2) + 1))


def _cycles(levels: Array, period: float) -> Array:
    """Count (samples,) how many periods have passed at each sample, smoothly along the line."""
    place = np.arange(len(levels))
    wave = (levels - _moving_mean(levels, 2 * round(period))) * np.exp(-2j * np.pi * place / period)
    reach = int(3 * _PHASE_WINDOW * period)
    window = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (_PHASE_WINDOW * period)) ** 2)
    local = np.convolve(wave, window, mode="full")[reach : reach + len(levels)]
    nodes = np.arange(0, len(levels), max(int(period / 2), 1))
    phase = np.unwrap(np.angle(local[nodes])) / (2 * np.pi)
    order = 4 if len(levels) > 12 * period else 2  # few ticks drift little
    middle, half = len(levels) / 2, len(levels) / 2
    weight = np.abs(local[nodes])
    for _ in range(_ROUNDS):  # a phase shift by a numeral or a gap is not drift
        drift = np.polynomial.Polynomial.fit((nodes - middle) / half, phase, order, w=weight, domain=[-1, 1])
        miss = phase - drift((nodes - middle) / half)
        weight = np.abs(local[nodes]) / (1 + (miss / (2 * np.median(np.abs(miss)) + 1e-6)) ** 2)
    return np.asarray(place / period + drift((place - middle) / half))


def _rough_places(levels: Array, cycles: Array) -> Array:
    """(K,) distances along the line, in pixels, at which ticks are expected."""
    bins = 32
    flat = levels - _moving_mean(levels, round(2 * len(levels) / max(cycles[-1] - cycles[0], 1.0)))
    which = (np.floor(cycles * bins) % bins).astype(int)
    folded = np.array([np.median(flat[which == number]) if np.any(which == number) else 0.0 for number in range(bins)])
    folded -= np.median(folded)
    sign = 1 if folded.max() > -folded.min() else -1  # ticks may be bright, but seldom are
    folded *= sign
    middle = (np.argmax(folded) + 0.5) / bins
    first, last = np.ceil(cycles[0] - middle + 0.3), np.floor(cycles[-1] - middle - 0.3)
    wanted = np.arange(first, last + 1) + middle
    places = np.interp(wanted, cycles, np.arange(len(cycles)))
    return _peaks(sign * flat, places, period=len(cycles) / max(cycles[-1] - cycles[0], 1.0)) / PER_PX


def _peaks(light: Array, places: Array, period: float) -> Array:
    """(K,) the samples with the highest light near each place, for ticks so far apart that a bin is coarse."""
    reach = int(period * _NEAR)
    if reach < PER_PX:
        return places
    smooth = np.convolve(light, np.ones(PER_PX + 1) / (PER_PX + 1), mode="same")
    near = np.clip(np.round(places)[:, None].astype(int) + np.arange(-reach, reach + 1), 0, len(light) - 1)
    return np.take_along_axis(near, np.argmax(smooth[near], axis=1)[:, None], axis=1)[:, 0].astype(float)

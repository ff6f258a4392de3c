"""The engine's speed from its sound: combs of tones fitted to the spectral peaks that a flight keeps of its sound.

A four-stroke engine fires cylinders / 2 times per turn of its crankshaft, and a propeller's blades pass by. Both sound
as a comb of tones at multiples of that rate, and differences between cylinders add tones at multiples of half a turn. A
comb explains a window's peaks as far as they lie on its teeth:

    L(rpm) = sum over peaks of log(1 - c + c * p(f | rpm) / p(f | anything)),   c: how surely a peak is a tone

The more teeth a comb has, the less it predicts where a tone lies, so half the true speed explains the same peaks less
well. Time helps to choose between combs: the best path through the windows (Viterbi) pays a cost for being unsteady.
That never decides alone. The surrounding windows must distinguish the comb from chance, and from the best path that is
not near it, and the window itself must have peaks on it. If another path explains the sound nearly as well, there is no
value, and the other speeds are listed.

Sources: Vaidya, Shin and Hwang, AIAA 2017-0792 (propeller and engine speed from cockpit sound); Klapuri, IEEE TSAP 11
(2003) 804 (combs and the errors by octaves); ATSB, whose reports give propeller speeds by sound.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from decoder.imaging.sorting import MAD_TO_SIGMA
from decoder.panel.arrays import Floats, Indices, Mask
from decoder.timeseries.thresholds import MAX_UNSTEADY_PART, MIN_EVIDENCE, MIN_LEAD
from flight_file.frame import NS_PER_S, SoundPeaks

USUAL_CYLINDERS, USUAL_BLADES = (4, 6, 8), (2, 3, 4)
HALF_TURN = 0.5
_STEP = 0.002  # between the speeds tried, as a part of the speed
_BAND_HZ = (15.0, 1005.0)
_POINT_HZ = 0.2
_TOOTH_HZ, _TOOTH_PART = 0.3, 0.0015  # distance of a tone from its tooth, 1 sigma
_STRONG_PART = 0.7  # of an engine's tones, those of firings or blades; the others are at multiples of half turns
_NOISE_DB, _SURE_DB, _SURE = 7.0, 21.0, 0.7  # above the spectrum around: no peak is a tone; this part of peaks is
_UNSTEADY, _WILD = 0.05, 2.0  # cost per step between speeds; a bend of this many steps costs log 2
_REACH = 40  # steps between speeds from one window to the next: a third in a second
_AROUND = 12  # windows to either side: three seconds
_BLOCK = 1000  # windows that are processed together
_CACHED = 8  # speeds that are processed together, so few that the processor keeps them at hand
_APART = 3  # windows that share no sound
_STRAY = 2.0  # sigma of a tooth that half counts
_SPREAD_OF_STRAYS = (1 + 34 / 36) ** 0.5
_NEAR = 7  # steps between speeds that are one
_MOST_OTHERS = 3
_TAKEN = 30.0  # penalty of a speed that is already taken, in each window
_READ_HZ, _READ_PART, _SMEARED = 0.1, 0.0003, 0.05  # precision of a strong tone; and as a part of its drift


class SpeedStatus(Enum):
    """What is known of the engine's speed in a window."""

    READ = "read"
    AMBIGUOUS = "ambiguous"
    """Another speed explains the sound nearly as well."""
    MISSING = "missing"
    """No comb stands out of the sound."""


@dataclass(frozen=True, slots=True)
class Engine:
    """What is known of an engine and its propeller.

    Attributes
    ----------
    cylinders
        Of a four-stroke engine; 0 if it has none; None if unknown.
    blades
        Of the propeller; 0 if none can be heard; None if unknown.
    gearing
        Turns of the engine per turn of the propeller.
    rpm_range
        The lowest and the highest speed of the engine.
    """

    cylinders: int | None = None
    blades: int | None = None
    gearing: float = 1.0
    rpm_range: tuple[float, float] = (500.0, 3500.0)

    @property
    def is_known(self) -> bool:
        """Whether enough is known to tell which speed a comb belongs to."""
        return self.cylinders is not None or self.blades is not None

    @property
    def combs(self) -> list[Comb]:
        """The combs that may be heard, firings, blades or both, for all possible numbers of them."""
        firings = [None] if self.cylinders == 0 else [each / 2 for each in _known(self.cylinders, USUAL_CYLINDERS)]
        blades = [None] if self.blades == 0 else [each / self.gearing for each in _known(self.blades, USUAL_BLADES)]
        heard = {tuple(sorted({each for each in pair if each is not None})) for pair in _pairs(firings, blades)}
        fine = 1 / self.gearing if self.cylinders == 0 else HALF_TURN
        return [Comb(orders, fine) for orders in sorted(heard) if orders]


def _known(count: int | None, usual: tuple[int, ...]) -> tuple[int, ...]:
    return usual if count is None else (count,)


def _pairs(
    firings: Sequence[float | None], blades: Sequence[float | None]
) -> Iterator[tuple[float | None, float | None]]:
    yield from ((firing, None) for firing in firings)
    yield from ((None, blade) for blade in blades)
    yield from ((firing, blade) for firing in firings for blade in blades)


@dataclass(frozen=True, slots=True)
class Comb:
    """Tones at multiples of the engine's turns.

    Attributes
    ----------
    strong
        Strong tones are expected at these multiples: firings or blades per turn.
    fine
        Weaker tones are expected at these.
    """

    strong: tuple[float, ...]
    fine: float

    @property
    def families(self) -> list[tuple[float, float]]:
        """The families of teeth, each with its share of the tones."""
        return [*((order, _STRONG_PART / len(self.strong)) for order in self.strong), (self.fine, 1 - _STRONG_PART)]

    def orders(self, rpm: float, frequencies_hz: Floats) -> Floats:
        """(P,): the tooth next to each frequency, in turns; a fine one only if it is nearer by more than a sigma."""
        turn_hz = rpm / 60
        families = [order for order, _ in self.families]
        teeth = np.array([np.round(frequencies_hz / (turn_hz * order)) * order for order in families])
        off_hz = np.where(teeth > 0, np.abs(frequencies_hz - teeth * turn_hz), np.inf)
        off_hz[-1] += np.hypot(_TOOTH_HZ, _TOOTH_PART * frequencies_hz)
        nearest: Floats = np.take_along_axis(teeth, off_hz.argmin(axis=0)[None], axis=0)[0]
        return nearest


def _densities(combs: Sequence[Comb], rpm: Floats, frequencies_hz: Floats) -> list[NDArray[np.float32]]:
    """(S, P) for each comb: how much more likely a tone at a frequency is for each speed than by chance, as a ratio."""
    sigma_hz = np.hypot(_TOOTH_HZ, _TOOTH_PART * frequencies_hz)
    teeth = {}
    for order in {order for comb in combs for order, _ in comb.families}:
        apart_hz = rpm[:, None] / 60 * order
        tooth = np.round(frequencies_hz / apart_hz)
        off = (frequencies_hz - tooth * apart_hz) / sigma_hz
        teeth[order] = apart_hz, np.where(tooth > 0, np.exp(-0.5 * off**2), 0)
    found = []
    for comb in combs:
        ratio = np.zeros((len(rpm), len(frequencies_hz)), np.float64)
        for order, part in comb.families:
            apart_hz, near = teeth[order]
            ratio += part * apart_hz * near / (sigma_hz * np.sqrt(2 * np.pi))
        found.append(ratio.astype(np.float32))
    return found


@dataclass(frozen=True, slots=True)
class EngineSpeed:
    """The engine's speed, window by window.

    Attributes
    ----------
    time_ns
        (N,): the windows' middles.
    rpm, sigma
        (N,): NaN where it is not read.
    status
        N of them.
    evidence
        (N,): how much better the comb explains the surrounding windows than chance does, as a logarithm.
    lead
        (N,): how much better than any other path.
    others
        For each window, the speeds that explain the sound nearly as well, best first.
    """

    time_ns: NDArray[np.int64]
    rpm: Floats
    sigma: Floats
    status: tuple[SpeedStatus, ...]
    evidence: Floats
    lead: Floats
    others: tuple[tuple[float, ...], ...]

    def has(self, status: SpeedStatus) -> Mask:
        """(N,): where it has this status."""
        return np.array([each is status for each in self.status], dtype=np.bool_)


def engine_speed(peaks: Sequence[SoundPeaks], engine: Engine) -> EngineSpeed:
    """Read the engine's speed; windows are sorted by time, and duplicates dropped.

    Parameters
    ----------
    peaks
        Of a flight, or of a part of it; at least one.
    engine
        What is known of the engine; with less, more speeds are ambiguous.
    """
    windows = sorted({each.time_ns: each for each in peaks}.values(), key=lambda each: each.time_ns)
    listener = _Listener(engine)
    found: list[_Row] = [
        row
        for run in _runs(windows)
        for start in range(0, len(run), _BLOCK)
        for row in _own(listener, run, start, start + _BLOCK)
    ]
    rpm = np.array([row.rpm for row in found])
    sigma = np.fmax([row.sigma for row in found], _scatter(rpm))
    is_read = np.array([row.status is SpeedStatus.READ for row in found], np.bool_)
    steady = sigma <= MAX_UNSTEADY_PART * rpm
    return EngineSpeed(
        time_ns=np.array([window.time_ns for window in windows], np.int64),
        rpm=np.where(is_read & steady, rpm, np.nan),
        sigma=np.where(is_read & steady, sigma, np.nan),
        status=tuple(row.status if well else SpeedStatus.MISSING for row, well in zip(found, steady, strict=True)),
        evidence=np.array([row.evidence for row in found]),
        lead=np.array([row.lead for row in found]),
        others=tuple(row.others if well else () for row, well in zip(found, steady, strict=True)),
    )


@dataclass(frozen=True, slots=True)
class _Row:
    status: SpeedStatus
    evidence: float
    lead: float
    rpm: float
    sigma: float
    others: tuple[float, ...] = ()


def _runs(windows: Sequence[SoundPeaks]) -> Iterator[list[SoundPeaks]]:
    """Split where the sound has a gap, since windows that share no sound are not consecutive."""
    run: list[SoundPeaks] = []
    for window in windows:
        if run and window.time_ns - run[-1].time_ns > window.window_s * NS_PER_S:
            yield run
            run = []
        run.append(window)
    if run:
        yield run


def _own(listener: _Listener, run: Sequence[SoundPeaks], start: int, stop: int) -> list[_Row]:
    """Process some windows of a run, with the surrounding ones that affect them."""
    margin = 2 * _AROUND
    first = start - min(start, margin)
    return listener.rows(run[first : stop + margin])[start - first : stop - first]


class _Listener:
    """Stores the densities of an engine's combs at every frequency, for all speeds."""

    def __init__(self, engine: Engine) -> None:
        low, high = np.log(engine.rpm_range)
        self._rpm: Floats = np.exp(np.arange(low, high + _STEP, _STEP))
        self._combs = engine.combs
        self._needed_lead = MIN_LEAD if engine.is_known else np.inf
        points = np.arange(*_BAND_HZ, _POINT_HZ)
        some = np.array_split(self._rpm, len(self._rpm) // _CACHED + 1)
        blocks = [_densities(self._combs, rpm, points) for rpm in some]
        self._density = [np.concatenate(rows) for rows in zip(*blocks, strict=True)]

    def rows(self, windows: Sequence[SoundPeaks]) -> list[_Row]:
        """Read consecutive windows."""
        told = np.array([self._told(window, density) for density in self._density for window in windows])
        by_comb = told.reshape(len(self._density), len(windows), -1)
        shared = _shared(windows)
        best = by_comb.max(axis=0) * shared  # windows overlap, so what is in three of them counts once
        path = _steadiest(best)
        evidence = _around(best, path)
        others = self._others(best, path, evidence)
        rate = np.gradient(np.log(self._rpm[path])) / shared if len(path) > 1 else np.zeros(1)
        rows = []
        for row, window in enumerate(windows):
            rivals = [at[row] for at, worth in others if evidence[row] - worth[row] < self._needed_lead]
            lead = float(min(evidence[row] - worth[row] for _, worth in others))
            status = self._status(float(evidence[row]), by_comb[:, row, path[row]], rivals)
            comb = self._combs[int(by_comb[:, row, path[row]].argmax())]
            rpm, sigma = _measured(window, comb, float(self._rpm[path[row]]), float(rate[row]))
            named = [path[row], *rivals] if status is SpeedStatus.AMBIGUOUS else []
            speeds = tuple(round(float(self._rpm[at])) for at in named)
            rows.append(_Row(status, float(evidence[row]), lead, rpm, sigma, speeds))
        return rows

    @staticmethod
    def _status(evidence: float, told: Floats, rivals: Sequence[int]) -> SpeedStatus:
        if evidence < MIN_EVIDENCE or told.max() <= 0:
            return SpeedStatus.MISSING
        return SpeedStatus.AMBIGUOUS if rivals else SpeedStatus.READ

    def _others(self, best: Floats, path: Indices, evidence: Floats) -> list[tuple[Indices, Floats]]:
        """Find the paths that are not near earlier ones, each with its evidence, as long as one may be a rival."""
        rest, found, taken = best.copy(), list[tuple[Indices, Floats]](), path
        for _ in range(_MOST_OTHERS):
            least = rest.min(axis=1) - _TAKEN
            for row, at in enumerate(taken):
                np.put(rest[row], at + np.arange(-_NEAR, _NEAR + 1), least[row], mode="clip")
            taken = _steadiest(rest)
            worth = _around(best, taken)
            found.append((taken, worth))
            if not np.any((evidence >= MIN_EVIDENCE) & (evidence - worth < self._needed_lead)):
                break
        return found

    def _told(self, window: SoundPeaks, density: Floats) -> Floats:
        """(S,): how much better each speed explains a window's peaks than chance does, as a logarithm."""
        sure = _sureness(np.array(window.above_db))
        points = np.round((np.array(window.frequencies_hz) - _BAND_HZ[0]) / _POINT_HZ).astype(np.intp)
        inside = (points >= 0) & (points < density.shape[1])
        told: Floats = np.log1p(sure[inside] * (density[:, points[inside]] - 1)).sum(axis=1)
        return told


def _sureness(above_db: Floats) -> Floats:
    """(P,): the probability that a peak is a tone of the engine, 0 to 0.7: noise has peaks, and speech has tones."""
    sure: Floats = np.interp(above_db, [_NOISE_DB, _SURE_DB], [0.0, _SURE])
    return sure


def _shared(windows: Sequence[SoundPeaks]) -> float:
    """Return the part of a window that is not in the one before; 1 if they do not overlap."""
    apart_s = np.diff([window.time_ns for window in windows]) / NS_PER_S
    return float(min(np.median(apart_s) / windows[0].window_s, 1.0)) if len(windows) > 1 else 1.0


def _steadiest(told: Floats) -> Indices:
    """(T,): the path through (T, S) that explains most, less its cost for being unsteady."""
    cost = _UNSTEADY * np.abs(np.arange(-_REACH, _REACH + 1))
    came = np.zeros(told.shape, np.int16)
    score = told[0]
    for row in range(1, len(told)):
        padded = np.pad(score, _REACH, constant_values=-np.inf)
        ways = np.lib.stride_tricks.sliding_window_view(padded, 2 * _REACH + 1) - cost
        came[row] = ways.argmax(axis=1) - _REACH
        score = np.take_along_axis(ways, (came[row] + _REACH)[:, None].astype(np.intp), axis=1)[:, 0] + told[row]
    path = [int(score.argmax())]
    for row in range(len(told) - 1, 0, -1):
        path.append(path[-1] + int(came[row, path[-1]]))
    return np.array(path[::-1])


def _around(told: Floats, path: Indices) -> Floats:
    """(T,): the evidence for a path in the windows around each, less the cost of its bends."""
    bends = np.zeros(len(path))
    bends[1:-1] = np.abs(np.diff(path, 2))
    each = told[np.arange(len(path)), path] - np.log1p((bends / _WILD) ** 2)
    sums: Floats = np.convolve(each, np.ones(2 * _AROUND + 1))[_AROUND : _AROUND + len(path)]
    return sums


def _measured(window: SoundPeaks, comb: Comb, rpm: float, rate: float) -> tuple[float, float]:
    """Fit the speed to the peaks on its teeth by least squares; return it with its sigma; NaN if there are no peaks.

    Parameters
    ----------
    rate
        The relative change of the speed within a window: drifting tones are measured less precisely.
    """
    frequencies, above = np.array(window.frequencies_hz), np.array(window.above_db)
    orders = comb.orders(rpm, frequencies)
    noise_hz = np.hypot(_READ_HZ, _READ_PART * frequencies) + 3 / window.window_s * 10 ** (-above / 20)
    sigma_hz = np.hypot(noise_hz, _SMEARED * rate * frequencies)
    weights = np.where(orders > 0, _sureness(above), 0.0) / sigma_hz**2
    reach_hz = 2 * np.hypot(_TOOTH_HZ, (_TOOTH_PART + _STEP) * frequencies)
    for sigmas in (2.0, 1.0, 0.6, 0.6, 0.6):
        off_hz = frequencies - orders * rpm / 60
        own = weights * (np.abs(off_hz) < sigmas * reach_hz)
        if not own.any():
            return np.nan, np.nan
        own /= 1 + (off_hz / (_STRAY * sigma_hz)) ** 2 if sigmas < 1 else 1  # so that voices have little effect
        rpm += 60 * float((own * orders * off_hz).sum() / (own * orders**2).sum())
    off = (frequencies - orders * rpm / 60) / sigma_hz
    counted = own > 0
    spread = max(1.0, float((off[counted] ** 2).sum() / max(counted.sum() - 1, 1)) ** 0.5)
    return rpm, 60 * spread / float((orders[counted] ** 2 / sigma_hz[counted] ** 2).sum()) ** 0.5


def _scatter(rpm: Floats) -> Floats:
    """(N,): the scatter of speeds about a cubic through surrounding ones that share no sound, 1 sigma.

    It is at least two thirds of the window's own deviation, since something other than the engine may lie on its teeth.
    """
    wide = np.pad(rpm, 2 * _APART, constant_values=np.nan)
    far, near, own, after, last = (wide[at * _APART : len(wide) + (at - 4) * _APART] for at in range(5))
    strays = np.abs(own - (4 * (near + after) - (far + last)) / 6) / _SPREAD_OF_STRAYS
    padded = np.pad(strays, _AROUND, constant_values=np.nan)
    ordered = np.sort(np.lib.stride_tricks.sliding_window_view(padded, 2 * _AROUND + 1), axis=1)  # NaN is sorted last
    known = np.isfinite(ordered).sum(axis=1)
    middle = np.take_along_axis(ordered, (known // 2)[:, None], axis=1)[:, 0]
    return np.fmax(MAD_TO_SIGMA * middle, strays / 1.5)

"""Sounds whose truth is a formula: engines with their propellers, voices, wind, noise; and what a flight keeps of them.

All are mono at 16 kHz with a spread of 1. Amplitudes are drawn at random, so that fundamentals may be missing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

RATE_HZ = 16_000
HIGHEST_HZ = 3000
CACHED = 8192  # samples, so few that the processor keeps them at hand
Sound = NDArray[np.float64]
VOWELS = ((730, 1090, 2440), (270, 2290, 3010), (300, 870, 2240), (530, 1840, 2480), (570, 840, 2410))  # formants, Hz


def times_s(seconds: float) -> Sound:
    """(N,): when each sample is."""
    return np.arange(round(seconds * RATE_HZ)) / RATE_HZ


def _loud_as_one(made: Sound) -> Sound:
    """Bring it to a spread of 1."""
    scaled: Sound = made / made.std()
    return scaled


def noise(count: int, rng: np.random.Generator, *, slope: float = 0.0, from_hz: float = 15.0) -> Sound:
    """Noise whose power falls with frequency to the power of `slope`, above `from_hz`."""
    spectrum = np.fft.rfft(rng.standard_normal(count))
    spectrum *= (np.maximum(np.fft.rfftfreq(count, 1 / RATE_HZ), from_hz) / from_hz) ** (-slope / 2)
    made = np.fft.irfft(spectrum, count)
    return _loud_as_one(made)


def wind(count: int, rng: np.random.Generator) -> Sound:
    """Rumble that comes in gusts."""
    gusts = np.exp(0.5 * noise(count, rng, slope=2, from_hz=0.2))
    made = noise(count, rng, slope=2.5, from_hz=20) * gusts
    return _loud_as_one(made)


def engine(
    rpm: Sound,
    rng: np.random.Generator,
    *,
    cylinders: int = 4,
    blades: int = 0,
    gearing: float = 1.0,
    rough_db: float = -18.0,
    from_hz: float = 100.0,
) -> Sound:
    """Firings, blades, and what differs from cylinder to cylinder; below `from_hz` the microphone hears little."""
    turns, low = np.cumsum(rpm / 60) / RATE_HZ, (60 * from_hz / rpm) ** 4
    made = np.zeros(len(rpm))
    wobbles = [1 + 0.1 * noise(len(rpm), rng, slope=2, from_hz=0.5) for _ in range(5)]
    families = [(cylinders / 2, 0.0, 4.0), (blades / gearing, rng.uniform(-6, 3), 6.0), (0.5, rough_db, 2.0)]
    for step, level_db, fall_db in families if cylinders else families[1:2]:
        orders = np.arange(1, 200) * step if step else np.empty(0)
        orders = orders[orders * rpm.mean() / 60 < HIGHEST_HZ]
        drawn = [(rng.normal(0, 6), rng.random()) for _ in orders]
        for start in range(0, len(rpm), CACHED):
            part = slice(start, start + CACHED)
            first, phasor = np.exp(2j * np.pi * step * turns[part]), np.ones(len(turns[part]), complex)
            for number, (order, (other_db, phase)) in enumerate(zip(orders, drawn, strict=True), start=1):
                loud = 10 ** ((level_db + other_db - fall_db * np.log2(number)) / 20)
                loud = loud / np.sqrt(1 + low[part] / order**4)
                phasor *= first  # quicker than a cosine for each
                made[part] += loud * wobbles[number % 5][part] * (phasor * np.exp(2j * np.pi * phase)).real
    return _loud_as_one(made)


def voice(count: int, rng: np.random.Generator) -> Sound:
    """Vowels of a voice whose pitch glides, with pauses."""
    times, pitch, loud = np.arange(count) / RATE_HZ, np.zeros(count), np.zeros(count)
    formants = np.ones((3, count))
    base_hz, at_s = rng.choice([110, 130, 200, 220]), 0.0
    while at_s < count / RATE_HZ:
        at_s += rng.uniform(0.3, 1.2) if rng.random() < 0.2 else rng.uniform(0, 0.05)
        length_s = rng.uniform(0.12, 0.35)
        own = (times >= at_s) & (times < at_s + length_s)
        part = (times[own] - at_s) / length_s
        loud[own] = np.sqrt(np.sin(np.pi * part))
        pitch[own] = base_hz * 2 ** (rng.uniform(-0.25, 0.3) + rng.uniform(-0.3, 0.15) * part)
        formants[:, own] = np.array(VOWELS[rng.integers(len(VOWELS))])[:, None]
        at_s += length_s
    turns, made = np.cumsum(pitch) / RATE_HZ, np.zeros(count)
    for harmonic in range(1, 30):
        heard = sum(
            0.5**each / np.sqrt(1 + ((harmonic * pitch - formants[each]) / (50 + 20 * each)) ** 2) for each in range(3)
        )
        made += np.where(harmonic * pitch < RATE_HZ / 2.2, heard, 0) * loud * np.cos(2 * np.pi * harmonic * turns)
    return _loud_as_one(made)


def mixed(sound: Sound, other: Sound, snr_db: float) -> Sound:
    """Add another sound that is so many dB weaker."""
    together: Sound = _loud_as_one(sound) + _loud_as_one(other) * 10 ** (-snr_db / 20)
    return together


def recorded(sound: Sound, *, clipped_at: float = np.inf) -> Sound:
    """Bring it to nine tenths of full scale, after clipping it at so many times its spread."""
    cut = np.clip(sound, -clipped_at * sound.std(), clipped_at * sound.std())
    scaled: Sound = 0.9 * cut / max(float(np.abs(cut).max()), 1e-9)
    return scaled

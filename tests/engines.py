"""Engines with a speed by formula, among other sounds: for the tests, and for the table in docs/sound.md."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from camera_drivers.replay.sound import RATE_HZ as KEPT_HZ
from camera_drivers.replay.sound import STEP, WINDOW, spectral_peaks
from decoder.timeseries.engine_sound import Engine, EngineSpeed
from flight_file.frame import SoundPeaks
from tests.sounds import RATE_HZ, Sound, engine, mixed, noise, recorded, times_s, voice, wind

SECONDS = 30.0
COUNT = round(SECONDS * RATE_HZ)
AT_S = times_s(SECONDS)
STEADY = np.full(COUNT, 2400.0)
RAMP = 1200 + 1300 * (0.5 - 0.5 * np.cos(np.pi * AT_S / SECONDS))  # up to 68 rpm in a second
WAVERING = 2250 + 100 * np.sin(AT_S / 5)
LYCOMING = Engine(cylinders=4, blades=2, rpm_range=(600.0, 3000.0))
SIX = Engine(cylinders=6, blades=3)
ROTAX = Engine(cylinders=4, blades=3, gearing=2.43, rpm_range=(1400.0, 6000.0))
TURBOPROP = Engine(cylinders=0, blades=4, gearing=15.0, rpm_range=(12_000.0, 34_000.0))


def peaks_of(sound: Sound) -> list[SoundPeaks]:
    """The peaks that a flight would keep of it; resampled by a Fourier transform."""
    spectrum = np.fft.rfft(sound)
    kept = np.fft.irfft(spectrum[: len(sound) * KEPT_HZ // RATE_HZ // 2 + 1]) * KEPT_HZ / RATE_HZ
    cut = np.lib.stride_tricks.sliding_window_view(kept, WINDOW)[::STEP]
    return [
        SoundPeaks(round((index * STEP + WINDOW / 2) / KEPT_HZ * 1e9), WINDOW / KEPT_HZ, *found)
        for index, found in enumerate(spectral_peaks(cut))
    ]


def sounding(known: Engine, rpm: Sound, seed: int, **more: float) -> tuple[Sound, np.random.Generator]:
    """Make the sound of an engine with these properties, and return the generator that drew it."""
    rng = np.random.default_rng(seed)
    return engine(
        rpm, rng, cylinders=known.cylinders or 0, blades=known.blades or 0, gearing=known.gearing, **more
    ), rng


def truth_of(speed: EngineSpeed, rpm: Sound) -> Sound:
    """(N,): the true speed in the middle of each window."""
    return np.interp(speed.time_ns / 1e9, AT_S, rpm)


def in_noise(sound: Sound, rng: np.random.Generator, snr_db: float) -> Sound:
    """Broadband noise that falls with frequency."""
    return mixed(sound, noise(len(sound), rng, slope=1), snr_db)


HEARD: dict[str, tuple[Engine, Sound, Callable[[Sound, np.random.Generator], Sound]]] = {
    "loud": (LYCOMING, STEADY, lambda sound, rng: in_noise(sound, rng, 10)),
    "10 dB below the noise": (LYCOMING, STEADY, lambda sound, rng: in_noise(sound, rng, -10)),
    "ramps": (LYCOMING, RAMP, lambda sound, rng: in_noise(sound, rng, 10)),
    "clipped": (SIX, WAVERING, lambda sound, rng: recorded(in_noise(sound, rng, 6), clipped_at=1.0)),
    "geared": (ROTAX, 2 * WAVERING, lambda sound, rng: in_noise(sound, rng, 3)),
    "turboprop": (TURBOPROP, 12 * WAVERING, lambda sound, rng: in_noise(sound, rng, 3)),
    "voices as loud": (SIX, WAVERING, lambda sound, rng: mixed(in_noise(sound, rng, 6), voice(COUNT, rng), 0)),
    "wind as loud": (SIX, WAVERING, lambda sound, rng: mixed(sound, wind(COUNT, rng), 0)),
}


RUN_UP = 800 + 1700 / (1 + np.exp(-(AT_S - SECONDS / 2) / 0.8))
HARDER: dict[str, tuple[Engine, Sound, Callable[[Sound, np.random.Generator], Sound]]] = {
    "ramps of 200 rpm in a second": (
        LYCOMING,
        1200 + 1300 * (0.5 - 0.5 * np.cos(2 * np.pi * AT_S / 20)),
        lambda sound, rng: in_noise(sound, rng, 6),
    ),
    "a run-up of 500 rpm in a second": (SIX, RUN_UP, lambda sound, rng: in_noise(sound, rng, 6)),
    "voices of twice the amplitude": (
        SIX,
        WAVERING,
        lambda sound, rng: mixed(in_noise(sound, rng, 6), voice(COUNT, rng), -6),
    ),
    "16 dB below the noise": (LYCOMING, STEADY, lambda sound, rng: in_noise(sound, rng, -16)),
}
"""What is not read throughout, or not to half a percent."""

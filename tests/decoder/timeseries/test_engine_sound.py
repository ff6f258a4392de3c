"""The engine's speed by its sound, for engines with a speed by formula, among other sounds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from decoder.timeseries.engine_sound import Engine, EngineSpeed, SpeedStatus, engine_speed
from flight_file.frame import SoundPeaks
from tests.engines import COUNT, HEARD, LYCOMING, SIX, STEADY, WAVERING, in_noise, peaks_of, sounding, truth_of
from tests.sounds import Sound, mixed, noise, voice, wind

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("name", HEARD)
def test_speed_is_right_to_half_a_percent_and_sigma_holds(name: str) -> None:
    """With fundamentals missing, amplitudes drawn at random; 95 % of true values are in the intervals."""
    known, rpm, surroundings = HEARD[name]
    errors, sigmas = [], []
    for seed in range(2):
        speed = engine_speed(peaks_of(surroundings(*sounding(known, rpm, seed))), known)
        read, truth = speed.has(SpeedStatus.READ), truth_of(speed, rpm)

        assert read.mean() > 0.9
        assert np.isfinite(speed.rpm).tolist() == read.tolist() == np.isfinite(speed.sigma).tolist()
        errors.append((speed.rpm / truth - 1)[read])
        sigmas.append((speed.sigma / truth)[read])
    error, sigma = np.concatenate(errors), np.concatenate(sigmas)

    assert np.mean(np.abs(error) < 0.005) > 0.98
    assert np.abs(error).max() < 0.02
    assert np.mean(np.abs(error) < 1.96 * sigma) >= 0.94
    assert np.median(sigma) < 0.002


@pytest.mark.parametrize(
    ("made", "seed"),
    [
        (lambda _count, _rng: np.zeros(COUNT), 11),
        (noise, 11),
        (wind, 11),
        (voice, 20),  # voices that glide little
        (lambda count, rng: mixed(voice(count, rng), wind(count, rng), 6), 11),
    ],
    ids=["silence", "noise", "wind", "voices", "voices in wind"],
)
def test_where_no_engine_is_heard_there_is_no_speed(made: Callable[..., Sound], seed: int) -> None:
    """Neither a value nor a list of candidates, whatever is known of the engine."""
    windows = peaks_of(made(COUNT, np.random.default_rng(seed)))
    for known in (LYCOMING, Engine()):
        assert set(engine_speed(windows, known).status) == {SpeedStatus.MISSING}


@pytest.fixture(scope="module")
def smooth() -> list[SoundPeaks]:
    """An engine so smooth that only its firings are heard."""
    sound, rng = sounding(LYCOMING, STEADY, 4, rough_db=-90.0)
    return peaks_of(in_noise(sound, rng, 10))


def spoken_of(speed: EngineSpeed) -> set[int]:
    """The candidate speeds, in hundreds of rpm."""
    return {round(each / 100) for others in speed.others for each in others}


@pytest.mark.parametrize(
    "known", [Engine(cylinders=4), Engine(blades=2), Engine()], ids=["cylinders", "blades", "nothing"]
)
def test_what_cannot_be_told_apart_is_listed_and_has_no_value(smooth: list[SoundPeaks], known: Engine) -> None:
    """A tone at 80 Hz may be firings, or blades of a propeller with two, three or four."""
    speed = engine_speed(smooth, known)

    assert SpeedStatus.READ not in speed.status
    assert np.isnan(speed.rpm).all()
    assert {24, 16, 12} <= spoken_of(speed)


def test_a_narrower_range_tells_what_was_ambiguous(smooth: list[SoundPeaks]) -> None:
    """Among speeds that explain the sound equally, the one in the engine's range."""
    speed = engine_speed(smooth, Engine(cylinders=4, rpm_range=(2000.0, 2700.0)))

    assert np.nanmedian(speed.rpm) == pytest.approx(2400, rel=0.001)
    assert speed.has(SpeedStatus.READ).mean() > 0.95


def test_time_alone_gives_no_value() -> None:
    """A window without a peak on the comb has none, whatever those around it say; a gap in the sound ends a run."""
    sound, rng = sounding(LYCOMING, STEADY, 5)
    windows = peaks_of(in_noise(sound, rng, 10))
    silent = replace(windows[60], frequencies_hz=(), levels_db=(), above_db=())
    speed = engine_speed([*windows[:60], silent, *windows[61:90], *windows[100:]], LYCOMING)

    assert speed.status[60] is SpeedStatus.MISSING
    assert speed.status[59] is speed.status[61] is SpeedStatus.READ
    assert len(speed.rpm) == len(windows) - 10


def test_windows_are_read_alike_in_whatever_order_they_come() -> None:
    """Pictures of a film are not stored in order of time, nor is their sound."""
    sound, rng = sounding(SIX, WAVERING, 6)
    windows: Sequence[SoundPeaks] = peaks_of(in_noise(sound, rng, 10))[:60]
    shuffled = [windows[index] for index in rng.permutation(len(windows))]
    one, two = engine_speed(windows, SIX), engine_speed(shuffled, SIX)

    assert np.array_equal(one.time_ns, two.time_ns)
    assert np.array_equal(one.rpm, two.rpm, equal_nan=True)

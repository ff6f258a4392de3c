"""What is kept of a film's sound: tones of known frequency and level, in silence and noise, at known times."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from camera_drivers.replay.sound import BAND_HZ, MOST_PEAKS, RATE_HZ, STEP, WINDOW, spectral_peaks
from camera_drivers.replay.video_clocks import Believed
from flight_file.frame import Frame, SoundPeaks
from tests.sounds import RATE_HZ as SOUND_RATE_HZ
from tests.sounds import recorded, times_s
from tests.videos import film, played

START, START_NS = "2026-05-04T09:30:00Z", 1_777_887_000_000_000_000
LONG = tuple(range(0, 40 * 1200, 1200))  # 4 s


def tones(*given: tuple[float, float], seconds: float = WINDOW / RATE_HZ, rate_hz: int = RATE_HZ) -> np.ndarray:
    """Sines of these frequencies (Hz) and levels (dB of full scale)."""
    at_s = np.arange(round(seconds * rate_hz)) / rate_hz
    return np.sum([10 ** (level / 20) * np.sin(2 * np.pi * (hertz * at_s + 0.1)) for hertz, level in given], axis=0)


def peaks_of(frames: list[Frame]) -> list[SoundPeaks]:
    """The windows that went along with frames."""
    return [each for frame in frames for each in frame.sound if isinstance(each, SoundPeaks)]


@given(
    hertz=st.lists(st.floats(25, 990), min_size=1, max_size=4),
    level_db=st.floats(-60, -6),
)
def test_tones_are_kept_with_frequency_and_level(hertz: list[float], level_db: float) -> None:
    """To a twentieth of a hertz and half a decibel, where they are further apart than a window tells."""
    apart = [each for index, each in enumerate(hertz) if all(abs(each - other) > 12 for other in hertz[:index])]
    ((frequencies, levels, _),) = spectral_peaks(tones(*((each, level_db) for each in apart))[None])

    for each in apart:
        nearest = int(np.argmin(np.abs(np.array(frequencies) - each)))
        assert frequencies[nearest] == pytest.approx(each, abs=0.05)
        assert levels[nearest] == pytest.approx(level_db, abs=0.5)


def test_no_more_is_kept_than_is_said() -> None:
    """At most 24 peaks of the band, whatever is loud outside; none of silence."""
    rng = np.random.default_rng(1)
    windows = np.stack([rng.normal(0, 0.1, WINDOW) + tones((1150, -3)), np.zeros(WINDOW)])
    (noisy, _, above), (silent, _, _) = spectral_peaks(windows)

    assert len(noisy) == MOST_PEAKS
    assert list(noisy) == sorted(noisy)
    assert BAND_HZ[0] - 1 < min(noisy) < max(noisy) < BAND_HZ[1] + 1
    assert min(above) > 0
    assert silent == ()


@pytest.mark.parametrize("codec", ["libx264", "mjpeg"])
def test_windows_are_on_the_clock_of_the_frames(tmp_path: Path, codec: str) -> None:
    """A tone that begins at 2 s begins there, and each window goes with a picture less than a second off."""
    at_s = times_s(4)
    sound = recorded(np.where(at_s < 2, np.sin(2 * np.pi * 200 * at_s), np.sin(2 * np.pi * 300 * at_s)))
    kind = {"libx264": "yuv420p", "mjpeg": "yuvj420p"}[codec]
    frames = played(
        film(tmp_path / "a.mov", ticks=LONG, codec=codec, pixels=kind, sound=sound), believed=Believed(start=START)
    )
    windows = peaks_of(frames)
    half_ns = round(WINDOW / RATE_HZ / 2 * 1e9)
    loudest = {window.time_ns - START_NS: window.frequencies_hz[int(np.argmax(window.levels_db))] for window in windows}

    assert np.diff([window.time_ns for window in windows]) == pytest.approx(STEP / RATE_HZ * 1e9, abs=2)
    assert len(windows) == (4 * RATE_HZ - WINDOW) // STEP + 1
    for time_ns, hertz in loudest.items():
        if abs(time_ns - 2e9) > half_ns / 2:
            assert hertz == pytest.approx(200 if time_ns < 2e9 else 300, abs=0.1)
    assert all(abs(each.time_ns - frame.captured_ns) <= 1.1e9 for frame in frames for each in frame.sound)


def test_lost_packets_leave_a_gap_that_no_window_reaches_across(tmp_path: Path) -> None:
    """What stands behind is at its own time."""
    sound = recorded(tones((200, 0), seconds=4, rate_hz=SOUND_RATE_HZ))
    path = film(tmp_path / "a.mkv", ticks=LONG, sound=sound, sound_codec="pcm_s16le")
    cut = tmp_path / "cut.mkv"
    with av.open(str(path)) as given_film, av.open(str(cut), "w") as made:
        copies = {each.index: made.add_stream_from_template(each) for each in given_film.streams}
        for packet in given_film.demux():
            is_lost = packet.stream.type == "audio" and packet.pts is not None and 1500 <= packet.pts < 2000
            if packet.size and not is_lost:
                packet.stream = copies[packet.stream.index]
                made.mux(packet)
    middles = np.array([window.time_ns for window in peaks_of(played(cut))]) / 1e9

    assert len(middles) > 4
    half = WINDOW / RATE_HZ / 2
    assert not ((middles > 1.55 - half) & (middles < 1.95 + half)).any()
    assert middles.max() == pytest.approx(4 - half, abs=0.3)

"""Video files as a camera: each oddity of them by its name, on films with known pictures and times."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from contextlib import suppress
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from camera_drivers.errors import ReplayError
from camera_drivers.replay.camera import open_source
from camera_drivers.replay.chapters import in_order
from camera_drivers.replay.video_clocks import Believed
from flight_file.frame import Frame
from flight_file.session import UNKNOWN
from recorder.host import SimulatedClock
from tests.videos import (
    STEADY,
    TICKS_PER_S,
    UNSTEADY,
    decoded,
    drawn,
    film,
    luma,
    packets,
    played,
    remuxed,
    times_ns,
    turned,
)

START = "2026-05-04T09:30:00Z"
START_NS = 1_777_887_000_000_000_000
CAMERA = {"creation_time": "2026-05-04T11:30:00Z", "timecode": "11:29:03:15"}


def decoded_again(frames: Sequence[Frame]) -> list[np.ndarray]:
    """Luma planes in the order of time, from nothing but what is stored."""
    decoder = av.CodecContext.create({"h264": "h264", "h265": "hevc"}[frames[0].format], "r")
    assert isinstance(decoder, av.VideoCodecContext)
    pictures = [each for frame in frames for each in decoder.decode(av.Packet(frame.encoded))]
    return [luma(picture) for picture in (*pictures, *decoder.decode(None))]


def refusal(*paths: Path, believed: Believed | None = None) -> str:
    """The sentence with which something is refused."""
    with pytest.raises(ReplayError) as caught:
        played(*paths, believed=believed)
    return str(caught.value)


@pytest.mark.parametrize("b_frames", [0, 2])
@pytest.mark.parametrize(("codec", "stored_as"), [("libx264", "h264"), ("libx265", "h265")])
def test_each_picture_has_its_own_time_at_a_variable_frame_rate(
    tmp_path: Path, codec: str, stored_as: str, b_frames: int
) -> None:
    """With and without B-frames; time counts from the first picture that is shown."""
    path = film(tmp_path / "a.mp4", ticks=UNSTEADY, codec=codec, b_frames=b_frames)
    frames = played(path, believed=Believed(start=START))
    wanted = times_ns([tick - UNSTEADY[0] for tick in UNSTEADY])

    assert sorted(frame.captured_ns - frames[0].captured_ns for frame in frames) == pytest.approx(wanted, abs=1)
    assert [frame.sequence for frame in frames] == list(range(len(UNSTEADY)))
    assert {(frame.format, frame.width_px, frame.height_px) for frame in frames} == {(stored_as, 160, 120)}


@pytest.mark.parametrize("options", [{}, {"x264-params": "open-gop=1:scenecut=0"}], ids=["closed", "open"])
def test_b_frames_are_stored_in_decoding_order_and_decode_to_the_same_pictures(
    tmp_path: Path, options: dict[str, str]
) -> None:
    """Whatever is built on pictures before or behind it, to the last bit."""
    path = film(tmp_path / "a.mp4", b_frames=3, options=options)
    frames = played(path)
    times = [frame.captured_ns for frame in frames]

    assert times != sorted(times)
    assert np.array_equal(decoded_again(frames), decoded(path))


@pytest.mark.parametrize("codec", ["libx264", "libx265"])
def test_parameter_sets_stand_before_each_key_frame(tmp_path: Path, codec: str) -> None:
    """In Annex B, so that a viewer can begin at any of them."""
    frames = played(film(tmp_path / "a.mp4", codec=codec, group=10))
    shift, mask, kind = {"libx264": (0, 31, 7), "libx265": (1, 63, 32)}[codec]

    assert all(frame.encoded.startswith((b"\0\0\0\1", b"\0\0\1")) for frame in frames)
    with_sets = [frame.sequence for frame in frames if frame.encoded.lstrip(b"\0")[1] >> shift & mask == kind]
    assert with_sets == [0, 10, 20, 30]
    for key in with_sets:
        (first, *_) = decoded_again(frames[key : key + 10])
        assert first.shape == (120, 160)


def test_digests_are_of_the_packets_as_they_came_and_as_they_are_stored(tmp_path: Path) -> None:
    """One proves where a picture came from, the other that it is whole."""
    path = film(tmp_path / "a.mp4", b_frames=2)
    frames = played(path)

    assert [frame.origin.sha256 for frame in frames] == [hashlib.sha256(each).hexdigest() for each in packets(path)]
    assert all(frame.sha256 == hashlib.sha256(frame.encoded).hexdigest() for frame in frames)
    assert all(frame.origin.file == 0 for frame in frames)


def test_pictures_before_an_edit_list_are_kept_with_times_before_its_start(tmp_path: Path) -> None:
    """The first that is shown is at the start; those that it is built on are in the flight, and decode."""
    whole = film(tmp_path / "whole.mp4", group=20, b_frames=2)
    cut = remuxed(whole, tmp_path / "cut.mp4", shift_s=0.8)
    frames = played(cut, believed=Believed(start=START))
    shown = [frame for frame in frames if frame.captured_ns >= START_NS]

    assert START_NS in [frame.captured_ns for frame in shown]
    assert 0 < len(frames) - len(shown) < 20
    first_shown = round(0.8 * TICKS_PER_S / 400)
    pictures = dict(zip(sorted(frame.captured_ns for frame in frames), decoded_again(frames), strict=True))
    assert np.array_equal(pictures[START_NS], decoded(whole)[first_shown])


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_rotation_is_kept_beside_the_pictures(tmp_path: Path, turns: int) -> None:
    """The packets stay as they are, each frame says by how much it is to be turned clockwise."""
    plain = film(tmp_path / "a.mp4")
    stored = [frame.encoded for frame in played(plain)]
    frames = played(turned(plain, turns))

    assert {frame.rotation_deg for frame in frames} == {90 * turns}
    assert [frame.encoded for frame in frames] == stored


def test_of_several_tracks_the_one_that_is_shown_is_taken(tmp_path: Path) -> None:
    """The larger of two that are shown alike; a cover picture and sound are none."""
    path = tmp_path / "two.mkv"
    with av.open(str(path), "w") as container:
        streams = [container.add_stream("libx264", rate=30) for _ in range(2)]
        sound = container.add_stream("aac", rate=48_000)
        for small, size in zip(streams, [(80, 60), (160, 120)], strict=True):
            small.width, small.height, small.pix_fmt = *size, "yuv420p"
        silence = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), "fltp", "mono")
        silence.sample_rate = 48_000
        container.mux(sound.encode(silence))
        for number in range(5):
            for stream in streams:
                frame = av.VideoFrame.from_ndarray(drawn(number, (stream.width, stream.height)), "rgb24")
                frame.pts, frame.time_base = number, Fraction(1, 30)
                container.mux(stream.encode(frame))
        container.mux([packet for stream in streams for packet in stream.encode(None)])
        container.mux(sound.encode(None))
    frames = played(path)
    (original,) = open_source([path], rate_hz=None, clock=SimulatedClock(0)).identity.originals

    assert [(frame.width_px, frame.height_px) for frame in frames] == [(160, 120)] * 5
    assert original.facts["track"] == "1, one of 2 with video"


def test_chapters_are_joined_in_their_order(tmp_path: Path) -> None:
    """However they are given; each goes on where the one before ended, and keeps its own times beside."""
    second = film(tmp_path / "GX020123.MP4", first_number=40, ticks=STEADY[:30])
    first = film(tmp_path / "GX010123.MP4")
    frames = played(second, first, believed=Believed(start=START))

    assert [frame.captured_ns - START_NS for frame in frames] == pytest.approx(times_ns(range(0, 70 * 400, 400)), abs=1)
    assert [frame.origin.file for frame in frames] == [0] * 40 + [1] * 30
    assert frames[40].origin.time_ns == 0
    assert np.array_equal(decoded_again(frames), [*decoded(first), *decoded(second)])


ROWS = [
    (["GP020007.MP4", "GOPR0007.MP4", "GP010007.MP4"], ["GOPR0007.MP4", "GP010007.MP4", "GP020007.MP4"]),
    (["GX020001.MP4", "GX010001.MP4"], ["GX010001.MP4", "GX020001.MP4"]),
    (["DJI_10.MP4", "DJI_9.MP4"], ["DJI_9.MP4", "DJI_10.MP4"]),
]
NO_ROWS = [
    (["GX010001.MP4", "GX010002.MP4"], "two recordings"),
    (["GX010001.MP4", "GX030001.MP4"], "chapter 2"),
    (["a.mp4", "a.mp4"], "twice"),
]


def test_chapters_are_sorted_as_cameras_name_them_or_refused() -> None:
    """A GoPro's old first chapter is before the others, 9 before 10; two recordings, a hole, a copy are no row."""
    for given_names, wanted in ROWS:
        assert in_order([Path(name) for name in given_names]) == [Path(name) for name in wanted]
    for names, words in NO_ROWS:
        with pytest.raises(ReplayError, match=words):
            in_order([Path(name) for name in names])


def test_chapters_of_different_kinds_are_refused(tmp_path: Path) -> None:
    """Another size, codec or rotation is another recording."""
    one, two = film(tmp_path / "1.mp4"), film(tmp_path / "2.mp4", size_px=(80, 60))

    assert "no chapters of one recording" in refusal(one, two)


def test_a_file_without_its_end_is_refused_with_what_to_do(tmp_path: Path) -> None:
    """A camera that lost its power writes no index (moov)."""
    path = film(tmp_path / "a.mp4")
    data = path.read_bytes()
    path.write_bytes(data[: data.index(b"moov") - 4])

    assert "(moov) is missing" in refusal(path)


def test_a_copy_that_broke_off_gives_the_pictures_that_are_whole(tmp_path: Path) -> None:
    """Where the index stands at the front; how many it lists is said, so that the loss is seen."""
    path = film(tmp_path / "a.mp4", muxing={"movflags": "faststart"})
    whole = packets(path)
    path.write_bytes(path.read_bytes()[: -sum(map(len, whole[30:])) - 10])
    frames = played(path)
    (original,) = open_source([path], rate_hz=None, clock=SimulatedClock(0)).identity.originals

    assert original.facts["pictures"] == "40"
    assert len(frames) == 29
    assert [frame.origin.sha256 for frame in frames] == [hashlib.sha256(each).hexdigest() for each in whole[:29]]


def test_mjpeg_is_stored_as_the_jpegs_that_it_is(tmp_path: Path) -> None:
    """Byte for byte, as pictures that anything opens."""
    path = film(tmp_path / "a.avi", codec="mjpeg", pixels="yuvj420p")
    frames = played(path)

    assert [frame.encoded for frame in frames] == packets(path)
    assert {frame.format for frame in frames} == {"jpeg"}


@pytest.mark.parametrize(
    ("believed", "start_ns", "by"),
    [
        (Believed(), 0, UNKNOWN),
        (Believed(start=START), START_NS, "start"),
        (Believed(start="2026-05-04T11:30:00", utc_offset="+02:00"), START_NS, "start"),
        (Believed(clock="creation"), START_NS + 7200 * 10**9, "creation"),
        (Believed(clock="creation", utc_offset="+02:00"), START_NS, "creation"),
        (Believed(clock="timecode", utc_offset="+02:00"), START_NS - 57 * 10**9 + 5 * 10**8, "timecode"),
    ],
)
def test_no_clock_is_believed_unless_somebody_says_so(
    tmp_path: Path, believed: Believed, start_ns: int, by: str
) -> None:
    """A creation time is often local time that is labelled UTC."""
    path = film(tmp_path / "a.mov", metadata=CAMERA)
    source = open_source([path], rate_hz=None, clock=SimulatedClock(0), believed=believed)
    (original,) = source.identity.originals

    assert (source.start_ns, source.identity.time_of_day) == (start_ns, by)
    assert original.facts["creation time"] == "2026-05-04T11:30:00.000000Z"
    assert original.facts["timecode"] == "11:29:03:15"
    assert original.facts["clocks"] == "the timecode is 57 s behind the creation time"
    assert (original.name, original.size_bytes) == ("a.mov", path.stat().st_size)
    assert original.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    sigmas = {frame.captured_sigma_ns for frame in played(path, believed=believed)}
    assert sigmas == ({None} if by == UNKNOWN else {500_000_000})


@pytest.mark.parametrize(
    ("believed", "words"),
    [
        (Believed(start="half past nine"), "is no time"),
        (Believed(start="2026-05-04T09:30:00"), "needs a Z"),
        (Believed(start="1969-12-31T09:30:00Z"), "before 1970"),
        (Believed(start=START, clock="creation"), "leave one out"),
        (Believed(clock="timecode"), "has no timecode"),
        (Believed(clock="creation"), "has no creation time"),
        (Believed(utc_offset="+02:00"), "says nothing by itself"),
        (Believed(start=START, utc_offset="two"), "is no offset"),
    ],
)
def test_a_time_that_cannot_be_is_refused(tmp_path: Path, believed: Believed, words: str) -> None:
    """Each in a sentence that says what to type."""
    assert words in refusal(film(tmp_path / "a.mp4"), believed=believed)


def test_a_timecode_that_ran_on_past_midnight_is_no_time_of_day(tmp_path: Path) -> None:
    """A counter of 25 hours would begin a flight on the next day: it is listed, compared with nothing, and refused."""
    path = film(tmp_path / "a.mov", metadata={**CAMERA, "timecode": "25:10:03:15"})
    (original,) = open_source([path], rate_hz=None, clock=SimulatedClock(0)).identity.originals

    assert original.facts["timecode"] == "25:10:03:15"
    assert "clocks" not in original.facts
    assert "its timecode is '25:10:03:15', which is no time; give --start" in refusal(
        path, believed=Believed(clock="timecode")
    )


def test_another_codec_is_refused_with_the_command_that_converts_it(tmp_path: Path) -> None:
    """Only what Foxglove and the desk know is stored."""
    assert "ffmpeg -i a.mp4 -c:v libx264" in refusal(film(tmp_path / "a.mp4", codec="mpeg4"))


@pytest.mark.parametrize(
    "content",
    [b"", b"no film", b"ffconcat version 1.0\nfile a.mp4\n", b"#EXTM3U\n#EXTINF:1,\na.mp4\n", b"\0\0\0\x18ftypisom"],
    ids=["nothing", "text", "a list of films", "a playlist", "a head alone"],
)
def test_what_is_no_film_is_refused(tmp_path: Path, content: bytes) -> None:
    """Nor is anything opened that it names."""
    film(tmp_path / "a.mp4")
    path = tmp_path / "b.mp4"
    path.write_bytes(content)

    assert str(path) in refusal(path)


def test_pictures_too_large_to_be_read_are_refused_before_they_take_memory(tmp_path: Path) -> None:
    """By what the file says of their size."""
    path = film(tmp_path / "a.mp4")
    data = bytearray(path.read_bytes())
    sets = next(at for at in range(len(data)) if data.startswith(b"avc1", at)) + 28
    data[sets : sets + 4] = (65_000).to_bytes(2, "big") * 2
    path.write_bytes(data)

    try:
        frames = played(path)
    except ReplayError:
        return
    assert {(frame.width_px, frame.height_px) for frame in frames} == {(160, 120)}


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32 - 1))
def test_a_damaged_film_gives_pictures_or_a_sentence(tmp_path: Path, seed: int) -> None:
    """Whatever stands in its boxes."""
    rng, whole = np.random.default_rng(seed), tmp_path / "whole.mp4"
    if not whole.exists():
        film(whole, ticks=STEADY[:4], metadata=CAMERA)
    data = bytearray(whole.read_bytes())
    for at in rng.integers(data.index(b"moov"), len(data), 8):
        data[at] = int(rng.integers(0, 256))
    (tmp_path / "a.mp4").write_bytes(data)
    with suppress(ReplayError):
        assert all(frame.captured_ns >= 0 for frame in played(tmp_path / "a.mp4"))

"""`decode video`: a film that plays, each frame at its own time, with the readings that were asked for."""

from __future__ import annotations

import shutil
import signal
from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray
from playwright.sync_api import Browser

from decoder.commands import video
from decoder.panel.errors import OutputError
from fixtures.film import film as animation_film
from flight_file.reader import open_flight
from tests.programs import A1, A2, FIXTURES, Done, MakeFlight, begun, ran, says, until
from tests.sounds import RATE_HZ, recorded, times_s
from tests.videos import add_sound

Decoded = Any
CAMERA = """\
picture_size: [1024, 768]
focal: {pixels_per_radian: [0, 225, 0], range_mm: [4, 10], covariance: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}
distortion: [{focal_length_mm: 4.45, k1: -0.06}]
"""
UNSTEADY_S = (0.0, 0.25, 0.3, 2.0, 2.04, 60.0)


@pytest.fixture(scope="module")
def overlay(decoded_a1: Decoded, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The film of what was read of a committed flight; nobody changes it."""
    path = tmp_path_factory.mktemp("overlay") / "overlay.mp4"
    done = ran("decode", "video", A1, "-o", path, "--data", decoded_a1.folder)
    assert (done.returncode, done.stderr, done.stdout) == (0, "", f"20 of 20 frames in {path}\n")
    return path


def seen(path: Path) -> tuple[list[float], list[NDArray[np.uint8]]]:
    """When each picture of a film is shown, in seconds, and what it shows, (H, W, 3) uint8 RGB."""
    with av.open(str(path)) as container:
        shown = list(container.decode(video=0))
    pictures = [np.asarray(frame.to_ndarray(format="rgb24"), np.uint8) for frame in shown]
    return [frame.time for frame in shown], pictures


def test_a_film_is_what_players_want(overlay: Path) -> None:
    """H.264 with 4:2:0, even sides, BT.709, no B-frames, the index first, and when its first frame was taken."""
    content = overlay.read_bytes()
    with av.open(str(overlay)) as container:
        stream = container.streams.video[0]
        coder = stream.codec_context
        packets = [packet for packet in container.demux(stream) if packet.size]

        assert (coder.name, coder.pix_fmt, coder.profile) == ("h264", "yuv420p", "High")
        assert (coder.width, coder.height % 2) == (1024, 0)
        assert (coder.color_primaries, coder.color_trc, coder.colorspace, coder.color_range) == (1, 1, 1, 1)
        assert container.metadata["creation_time"] == "2018-05-04T12:00:00.000000Z"
        assert [packet.pts for packet in packets] == [packet.dts for packet in packets]
        assert packets[-1].duration == packets[-2].duration
    assert content.index(b"moov") < content.index(b"mdat")


def test_each_frame_is_shown_at_its_own_time(
    tmp_path: Path, pictures: list[bytes], unsteady: Callable[[list[bytes]], Path]
) -> None:
    """However unsteady they are, to a tick; of a part the first is at 0, and every second keeps its time."""
    flight = unsteady(pictures[: len(UNSTEADY_S)])
    taken_ns = [frame.captured_ns for frame in open_flight([flight]).frames()]
    whole = ran("decode", "video", flight, "-o", tmp_path / "whole.mp4", "--height", "240")
    part = ran("decode", "video", flight, "-o", tmp_path / "part.mp4", "--from", "0.2", "--every", "2", "--crf", "40")
    times_s, shown = seen(tmp_path / "whole.mp4")

    assert (whole.returncode, part.returncode) == (0, 0), whole.stderr + part.stderr
    assert list(np.diff(taken_ns) / 1e9) == pytest.approx(np.diff(UNSTEADY_S), abs=1e-3)
    assert times_s == pytest.approx([(each - taken_ns[0]) / 1e9 for each in taken_ns], abs=1 / 90_000)
    assert seen(tmp_path / "part.mp4")[0] == pytest.approx(
        [(taken_ns[row] - taken_ns[1]) / 1e9 for row in (1, 3, 5)], abs=1 / 90_000
    )
    assert shown[0].shape[1] == 320


@pytest.fixture
def unsteady(tmp_path: Path) -> Callable[[list[bytes]], Path]:
    """Makes a flight of pictures at unsteady times, as a film of them tells."""

    def make(jpegs: list[bytes]) -> Path:
        source = tmp_path / "unsteady.mp4"
        with av.open(str(source), "w") as container:
            stream = container.add_stream("mjpeg")
            stream.width, stream.height, stream.pix_fmt = 1024, 768, "yuvj420p"
            stream.time_base = Fraction(1, 1000)
            for jpeg, time_s in zip(jpegs, UNSTEADY_S, strict=True):
                packet = av.Packet(jpeg)
                packet.stream, packet.time_base = stream, Fraction(1, 1000)
                packet.pts = packet.dts = round(time_s * 1000)
                container.mux(packet)
        made = ran("recorder", "replay", source, "-o", tmp_path / "flight.mcap", "--panel", FIXTURES / "panel.yaml")
        assert made.returncode == 0, made.stderr
        return tmp_path / "flight.mcap"

    return make


def is_drawn_alike(again: Path, written: Path) -> None:
    """Two films show the same at the same times, but for rounding."""
    (times_s, one), (other_times_s, other) = seen(again), seen(written)

    assert times_s == other_times_s
    assert max(np.abs(each.astype(int) - its).mean() for each, its in zip(one, other, strict=True)) < 0.1


def test_what_was_written_is_drawn_as_what_is_decoded(overlay: Path, tmp_path: Path) -> None:
    """Reading the tables back gives the same film as decoding again, but for rounding."""
    done = ran("decode", "video", A1, "-o", tmp_path / "again.mp4")

    assert done.returncode == 0, done.stderr
    is_drawn_alike(tmp_path / "again.mp4", overlay)


@pytest.mark.untraced
def test_what_was_written_through_a_bad_lens_is_drawn_as_what_is_decoded(tmp_path: Path) -> None:
    """Where the lens bends what is drawn, too."""
    camera = tmp_path / "camera.yaml"
    camera.write_text(CAMERA, encoding="utf-8")
    words = ["--camera", camera]
    done = [
        ran("decode", A1, "-o", tmp_path, *words),
        ran("decode", "video", A1, "-o", tmp_path / "again.mp4", *words),
        ran("decode", "video", A1, "-o", tmp_path / "written.mp4", *words, "--data", tmp_path),
    ]

    assert [each.returncode for each in done] == [0, 0, 0], done
    is_drawn_alike(tmp_path / "again.mp4", tmp_path / "written.mp4")


def test_the_flight_data_given_are_what_is_drawn(decoded_a1: Decoded, tmp_path: Path) -> None:
    """Another status in the table is seen in the film; frames that the table lacks are left out, which is said."""
    folder = tmp_path / "data"
    shutil.copytree(decoded_a1.folder, folder)
    lines = (folder / "thesis_a1.csv").read_text(encoding="utf-8").splitlines()
    (folder / "thesis_a1.csv").write_text("\n".join(line.replace(",read,", ",hidden,") for line in lines[:11]) + "\n")
    placed = (folder / "thesis_a1_alignment.tsv").read_text(encoding="utf-8").splitlines()
    (folder / "thesis_a1_alignment.tsv").write_text("\n".join(placed[:11]) + "\n")
    done = ran("decode", "video", A1, "-o", tmp_path / "film.mp4", "--data", folder)
    _, shown = seen(tmp_path / "film.mp4")

    assert done.returncode == 0
    assert done.stderr == "10 frames are not in the flight data, and so not in the film\n"
    assert len(shown) == 10
    green, violet = (near(shown[0], colour).sum() for colour in ((38, 210, 150), (222, 150, 216)))
    assert violet > 500 > 10 * green


@pytest.fixture
def sounding(tmp_path: Path) -> Path:
    """The flight filmed with sound, kept: a tone of 300 Hz, and of 600 Hz from the third second on."""
    silent, loud, flight = tmp_path / "silent.mp4", tmp_path / "loud.mp4", tmp_path / "loud.mcap"
    animation_film(A1, silent)
    with av.open(str(silent)) as read, av.open(str(loud), "w") as container:
        stream = container.add_stream_from_template(read.streams.video[0])
        track = container.add_stream("aac", rate=RATE_HZ)
        track.layout, track.bit_rate = "mono", 64_000
        times = times_s(4.5)
        add_sound(container, track, recorded(np.sin(2 * np.pi * np.where(times < 2, 300, 600) * times)))
        for packet in read.demux(video=0):
            if packet.dts is not None:
                packet.stream = stream
                container.mux(packet)
    done = ran("recorder", "replay", loud, "-o", flight, "--panel", FIXTURES / "panel.yaml", "--keep-sound")
    assert done.returncode == 0, done.stderr
    return flight


@pytest.mark.untraced
def test_sound_is_left_out_unless_it_is_asked_for(sounding: Path, tmp_path: Path) -> None:
    """It is then as it was, beside the pictures that it belongs to, from the flight's beginning or a later one."""

    def film(*words: str) -> Path:
        target = tmp_path / f"{len(words)}.mp4"
        done = ran("decode", "video", sounding, "-o", target, "--height", "240", *words)
        assert (done.returncode, done.stderr) == (0, "")
        return target

    with av.open(str(film())) as container:
        assert not container.streams.audio
    for start, change_s in (((), 2.0), (("--from", "1.5"), 0.5)):
        with av.open(str(film("--keep-sound", *start))) as container:
            frames = [(frame.time, frame.to_ndarray()[0]) for frame in container.decode(audio=0)]
        tones = [(time, np.abs(np.fft.rfft(samples)).argmax() * RATE_HZ / len(samples)) for time, samples in frames]
        low = [time for time, tone in tones if time is not None and tone < 450]  # what lies between the two
        assert max(low) == pytest.approx(change_s, abs=0.1)
        assert len(tones) > 0.9 * (4.5 - 2 + change_s) * RATE_HZ / 1024


def near(picture: NDArray[np.uint8], colour: tuple[int, int, int]) -> NDArray[np.bool_]:
    """(H, W): where a picture has a colour, but for what encoding takes from it."""
    found: NDArray[np.bool_] = np.abs(picture.astype(int) - colour).max(axis=2) < 30
    return found


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda folder: (folder / "thesis_a1.csv").unlink(), ["thesis_a1.csv", "cannot be read"]),
        (lambda folder: (folder / "thesis_a1_alignment.tsv").unlink(), ["thesis_a1_alignment.tsv", "cannot be read"]),
        (lambda folder: spoil(folder / "thesis_a1.json", '"sha256": "', '"sha256": "0'), ["another flight"]),
        (lambda folder: spoil(folder / "thesis_a1.csv", ",read,", ",seen,"), ["is not as `decode` writes them"]),
        (lambda folder: spoil(folder / "thesis_a1_alignment.tsv", "\n0\t", "\n7\t"), ["is of other frames"]),
        (lambda folder: spoil(folder / "thesis_a1_alignment.tsv", "\t0.", "\t1e300\t0."), ["not all as long"]),
        (lambda folder: spoil(folder / "thesis_a1_alignment.tsv", " 0 0 1\n", " 0 0 -1\n"), ["is not as"]),
        (lambda folder: spoil(folder / "thesis_a1_alignment.tsv", " 0 0 1\n", " 1\n"), ["is not as"]),
        (lambda folder: spoil(folder / "thesis_a1_alignment.tsv", "\tmatrix", "\tother"), ["is not as"]),
        (lambda folder: spoil(folder / "thesis_a1.json", '"moved_pivots_px": {', '"moved": {'), ["is not as"]),
    ],
)
def test_other_flight_data_are_refused(
    decoded_a1: Decoded, tmp_path: Path, change: Callable[[Path], None], words: list[str]
) -> None:
    """What is missing, of another flight, or not as it is written ends with one sentence and no film."""
    folder = tmp_path / "data"
    shutil.copytree(decoded_a1.folder, folder)
    change(folder)
    done: Done = ran("decode", "video", A1, "-o", tmp_path / "film.mp4", "--data", folder)

    says(done, *words)
    assert not list(tmp_path.glob("*film*"))


def spoil(file: Path, old: str, new: str) -> None:
    """Replace something in a file once."""
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new, 1), encoding="utf-8")


@pytest.mark.parametrize("what", ["panel", "camera"])
def test_another_panel_or_camera_is_refused(decoded_a1: Decoded, tmp_path: Path, what: str) -> None:
    """Readings would lie where no needle is."""
    (tmp_path / "panel.yaml").write_bytes((FIXTURES / "panel.yaml").read_bytes() + b"# mine\n")
    (tmp_path / "panel.jpg").write_bytes((FIXTURES / "panel.jpg").read_bytes())
    (tmp_path / "camera.yaml").write_text(CAMERA, encoding="utf-8")
    words = [f"--{what}", tmp_path / f"{what}.yaml"]
    done = ran("decode", "video", A1, "-o", tmp_path / "film.mp4", "--data", decoded_a1.folder, *words)

    says(done, f"thesis_a1.json: is of another {what}; give that with --{what}")


def test_a_damaged_picture_is_dark_and_told(tmp_path: Path, make_flight: MakeFlight, pictures: list[bytes]) -> None:
    """The film keeps its place and says why; pictures of another size are fitted in."""
    flight = make_flight([*pictures[:2], pictures[2][:20_000], *pictures[3:6]])
    done = ran("decode", "video", flight, "-o", tmp_path / "film.mp4")
    _, shown = seen(tmp_path / "film.mp4")

    assert done.returncode == 0
    assert done.stderr == "frame 2 is dark in the film: the picture is damaged or cut short\n"
    assert len(shown) == 6
    assert shown[2][:760].max() < 60 < shown[1][:760].max()
    assert near(shown[2][768:], (250, 100, 70)).sum() > near(shown[1][768:], (250, 100, 70)).sum()


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (["-o", "film.mkv"], 2, "ends with .mp4"),
        (["-o", "film.mp4", "--from", "99"], 1, "no frame lies between"),
        (["-o", "film.mp4", "--crf", "0"], 2, "--crf"),
    ],
)
def test_what_cannot_be_filmed_is_said(tmp_path: Path, words: list[str], code: int, told: str) -> None:
    """And no file appears."""
    done = ran("decode", "video", A1, *words[:1], tmp_path / words[1], *words[2:])

    assert done.returncode == code
    assert told in done.stderr
    assert not list(tmp_path.iterdir())


def test_the_flight_itself_is_never_replaced(tmp_path: Path) -> None:
    """Not even if it is called as films are."""
    flight = tmp_path / "flight.mp4"
    flight.write_bytes(A2.read_bytes())

    says(ran("decode", "video", flight, "-o", flight), "would be overwritten")
    assert flight.read_bytes() == A2.read_bytes()


def test_without_pyav_one_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Before anything is decoded."""
    monkeypatch.setattr(video, "find_spec", lambda _: None)
    failed = CliRunner().invoke(video.command, [str(A1), "-o", str(tmp_path / "film.mp4")]).exception

    assert isinstance(failed, OutputError)
    assert "pip install 'image-flight-recorder[video]'" in str(failed)


@pytest.mark.untraced
def test_ctrl_c_leaves_what_was_there(tmp_path: Path, decoded_a1: Decoded) -> None:
    """An older film stays, and nothing half lies beside it."""
    film = tmp_path / "film.mp4"
    film.write_bytes(b"an older film")
    running = begun("decode", "video", A1, "-o", film, "--data", decoded_a1.folder)
    until(lambda: (tmp_path / ".film.mp4.part").exists() or running.poll() is not None)
    running.send_signal(signal.SIGINT)
    _, told = running.communicate(timeout=60)

    assert running.returncode == 1
    assert told.strip() == "decode: interrupted; nothing was written"
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"film.mp4": b"an older film"}


@pytest.mark.untraced
def test_chromium_plays_it(browser: Browser, overlay: Path, tmp_path: Path) -> None:
    """In a page of its folder: it has its size and duration, runs, and seeks to a frame."""
    page_file = tmp_path / "page.html"
    page_file.write_text(f'<!doctype html><video muted src="{overlay.as_uri()}"></video>', encoding="utf-8")
    page = browser.new_page()
    page.goto(page_file.as_uri())
    told = page.evaluate(
        """async () => {
            const film = document.querySelector("video");
            const heard = (what) => new Promise((done) => film.addEventListener(what, done, { once: true }));
            if (film.readyState < 1) await heard("loadedmetadata");
            await film.play();
            while (film.currentTime < 0.3) await heard("timeupdate");
            film.pause();
            const played = film.currentTime;
            film.currentTime = 2.501;
            await heard("seeked");
            return [film.videoWidth, film.videoHeight, film.duration, played, film.currentTime, film.error];
        }"""
    )
    page.close()
    times_s, shown = seen(overlay)
    steps_s = {round(after - before, 3) for before, after in pairwise(times_s)}

    assert told[:2] == [shown[0].shape[1], shown[0].shape[0]]
    assert told[2] == pytest.approx(5.0, abs=0.05)
    assert 0.3 <= told[3] < 5
    assert told[4] == pytest.approx(2.501)
    assert told[5] is None
    assert steps_s == {0.25}

"""Decoding a video's pictures: the same as any player's, in whatever order they are asked for."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from decoder.imaging import video
from decoder.imaging.picture_block import PictureBlock
from decoder.imaging.pictures import colour_picture, grey_picture
from decoder.imaging.video import GroupDecoder, GroupPicture, encoded_of
from decoder.panel.errors import PictureError
from flight_file.frame import Frame
from flight_file.reader import open_flight
from tests.programs import ran
from tests.videos import X264, decoded, drawn, film, number_of, turned

KINDS = {
    "H.264": {"b_frames": 2},
    "H.264, open groups": {"b_frames": 2, "options": {"x264-params": X264["x264-params"] + ":open-gop=1"}},
    "H.265": {"codec": "libx265", "b_frames": 2},
    "4:4:4": {"pixels": "yuv444p"},
}


def shown(folder: Path, source: Path) -> list[Frame]:
    """The frames of a film, by way of a flight file."""
    made = ran("recorder", "replay", source, "-o", folder / "a.mcap")
    assert made.returncode == 0, made.stderr
    return list(open_flight([folder / "a.mcap"]).shown())


def full_range(luma: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Television's range of levels expanded to the full range, by the formula."""
    return np.clip(np.rint((luma.astype(float) - 16) * 255 / 219), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module", params=KINDS)
def frames(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Frame], Path]:
    """Those of a film of forty pictures in four groups, and the film."""
    folder = tmp_path_factory.mktemp("film")
    path = film(folder / "a.mp4", **KINDS[request.param])
    return shown(folder, path), path


def test_greys_are_the_decoders_own_in_full_range(frames: tuple[list[Frame], Path]) -> None:
    """Bit for bit those of a player that decodes the whole film; and each picture is the one of its time."""
    decoder = GroupDecoder()
    pictures = [grey_picture(encoded_of(frame), decoder) for frame in frames[0]]

    assert np.array_equal(pictures, [full_range(each) for each in decoded(frames[1])])
    assert [number_of(picture) for picture in pictures] == list(range(40))


@settings(max_examples=30)
@given(places=st.lists(st.integers(0, 39), min_size=1, max_size=6))
def test_a_picture_is_the_same_whatever_was_decoded_before(frames: tuple[list[Frame], Path], places: list[int]) -> None:
    """Forwards, backwards, twice, from one group to another; and into memory that is used again."""
    decoder, block = GroupDecoder(), PictureBlock()
    for slot, place in enumerate(places):
        encoded = encoded_of(frames[0][place])
        alone = grey_picture(encoded)

        assert np.array_equal(grey_picture(encoded, decoder), alone)
        assert np.array_equal(block.frame(encoded, slot, None, 10).pixels, alone)


def test_colours_are_those_that_were_filmed(frames: tuple[list[Frame], Path]) -> None:
    """But for what the codec loses."""
    picture = colour_picture(encoded_of(frames[0][20]))
    difference = np.abs(picture.astype(int) - drawn(20))

    assert picture.shape == (120, 160, 3)
    assert np.median(difference) <= 3
    assert abs(int(picture[110, 64, 0]) - 230) < 40
    assert picture[110, 64, 2] < 140


def test_a_jpeg_of_a_picture_has_its_luma(frames: tuple[list[Frame], Path]) -> None:
    """So that a panel drawn on it looks to the decoder as the film does."""
    encoded = encoded_of(frames[0][5])
    assert isinstance(encoded, GroupPicture)
    again = grey_picture(GroupDecoder().jpeg(encoded))

    assert np.abs(again.astype(int) - grey_picture(encoded)).mean() < 1


@pytest.mark.parametrize("turns", [1, 2])
def test_a_rotation_is_carried_out_clockwise(tmp_path: Path, turns: int) -> None:
    """In grey, in colour and in the JPEG alike."""
    plain = film(tmp_path / "plain.mp4")
    pictures = [full_range(each) for each in decoded(plain)]
    frame = shown(tmp_path, turned(plain, turns))[3]
    encoded = encoded_of(frame)
    assert isinstance(encoded, GroupPicture)
    wanted = np.rot90(pictures[3], -turns)

    assert np.array_equal(grey_picture(encoded), wanted)
    assert colour_picture(encoded).shape[:2] == wanted.shape
    assert grey_picture(GroupDecoder().jpeg(encoded)).shape == wanted.shape


def test_full_range_stays_as_it_is_and_ten_bits_become_eight(tmp_path: Path) -> None:
    """As most action cameras film, and telephones."""
    full, ten_bits = (film(tmp_path / f"{pixels}.mp4", pixels=pixels) for pixels in ("yuvj420p", "yuv420p10le"))
    (tmp_path / "ten").mkdir()
    as_filmed = [grey_picture(encoded_of(frame)) for frame in shown(tmp_path, full)[:5]]
    eight_bits = [grey_picture(encoded_of(frame)) for frame in shown(tmp_path / "ten", ten_bits)]

    assert np.array_equal(as_filmed, decoded(full)[:5])
    assert [number_of(picture) for picture in eight_bits] == list(range(40))


def test_a_picture_that_is_built_on_a_lost_one_is_refused(frames: tuple[list[Frame], Path]) -> None:
    """It would look intact but be wrong."""
    frame = frames[0][3]
    assert frame.group is not None
    broken = GroupPicture(replace(frame.group, packets=(), trouble="a picture is lost"), 0)

    with pytest.raises(PictureError, match="a picture is lost"):
        grey_picture(broken)


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1))
def test_damage_gives_a_picture_or_a_sentence(frames: tuple[list[Frame], Path], seed: int) -> None:
    """Whatever bytes a stranger's packets have."""
    rng = np.random.default_rng(seed)
    group = frames[0][15].group
    assert group is not None
    packets = list(group.packets)
    at = int(rng.integers(len(packets)))
    data = bytearray(packets[at][1])
    for place in rng.integers(0, len(data), 5):
        data[place] ^= int(rng.integers(1, 256))
    packets[at] = (packets[at][0], bytes(data[: int(rng.integers(1, len(data) + 1))]))
    damaged = replace(group, packets=tuple(packets))
    decoder = GroupDecoder()
    for place in range(10):
        with suppress(PictureError):
            assert grey_picture(GroupPicture(damaged, place), decoder).ndim == 2


def test_pictures_larger_than_may_be_are_refused_before_memory_is_taken(
    frames: tuple[list[Frame], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """By what the parameter sets say."""
    monkeypatch.setattr(video, "MAX_PIXELS", 160 * 120 - 1)

    with pytest.raises(PictureError):
        grey_picture(encoded_of(frames[0][0]))

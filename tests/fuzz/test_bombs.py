"""Small files that made the programs hang, swell or crash: each ends in time, in little memory, with a sentence."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image

from flight_file.reader import open_flight
from flight_file.records import MAGIC, Opcode
from flight_file.thresholds import JPEG_PIXELS_PER_BYTE, PNG_PIXELS_PER_BYTE
from fuzzing.flights import (
    FRAME_CHANNEL,
    IMAGE_CHANNEL,
    NS_PER_S,
    START_NS,
    STATUS_CHANNEL,
    Shot,
    attachment,
    channel,
    chunk,
    flight,
    image,
    message,
    message_index,
    record,
    sealed_flight,
    shot,
    text,
    topics,
)
from fuzzing.judge import Judge, Target
from tests.jpegs import encoded, plain_picture

pytestmark = pytest.mark.slow  # what is forked is not traced, and shall not be slowed down

FIXTURES = Path(__file__).parents[2] / "fixtures"
INFO = Target(("recorder", "info", "in/flight.mcap"))
VERIFY = Target(("recorder", "verify", "in/flight.mcap"), fails_in_words=False)
EXTRACT = Target(("recorder", "extract", "in/flight.mcap", "-o", "out"))
RECOVER = Target(("recorder", "recover", "in/flight.mcap"), writes_beside=True)
REPLAY = Target(("recorder", "replay", "in/flight.mcap", "-o", "out/again.mcap"))
DECODE = Target(("decode", "in/flight.mcap", "-o", "out", "--jobs", "1", "--format", "csv,mcap"))
PART = Target(("decode", "in/flight.mcap", "-o", "out", "--jobs", "1", "--from", "0.5"))
FRAMES = Target(("decode", "frames", "in/flight.mcap", "-o", "out"))
BOX = (INFO, VERIFY, EXTRACT, RECOVER, REPLAY)
ALL = (*BOX, DECODE, PART, FRAMES)


PICTURE = plain_picture()
ATTACHED = {name: (FIXTURES / name).read_bytes() for name in ("panel.yaml", "panel.jpg")}
FRAMES_OF_FLIGHT = tuple(frame.encoded for frame in open_flight([FIXTURES / "thesis_a1.mcap"]).sample_frames(2))


def frame_bytes(one: Shot) -> bytes:
    """A record as JSON, without a chain."""
    return json.dumps(one.document).encode()


def pictures_of_one_time() -> bytes:
    """Records and pictures all of one moment, none of which fits another."""
    records = (frame_bytes(shot(number, b"%d" % number, START_NS)) for number in range(1500))
    images = (image(b"x%d" % number, START_NS // NS_PER_S) for number in range(10_000))
    messages = [message(FRAME_CHANNEL, data) for data in records] + [message(IMAGE_CHANNEL, data) for data in images]
    return flight(chunk(topics()), chunk(b"".join(messages), "zstd"))


def many_swelling_chunks() -> bytes:
    """Each alone is within what a chunk may be."""
    one = chunk(bytes(2**26 - 64), "zstd")
    return flight(chunk(topics()), *[one] * (400_000 // len(one)))


def chunks_that_look_like_chunks() -> bytes:
    """Damage, and behind it thousands of heads that each claim all the rest of the file."""
    size, count = 800_000, 10_000
    heads = []
    for number in range(count):
        rest = size - number * 64
        head = struct.pack("<QQQI", 0, 0, rest - 49, 1) + text("") + struct.pack("<Q", rest - 49)
        heads.append((record(Opcode.CHUNK, b"")[:1] + struct.pack("<Q", rest - 9) + head).ljust(64, b"\0"))
    return MAGIC + b"\xee" + b"".join(heads).ljust(size, b"\0")


def indexes_that_promise_pictures() -> bytes:
    """Sixty thousand pictures, by the indexes of chunks that hold none."""
    sound = sealed_flight([shot(number, PICTURE) for number in range(3)], ATTACHED)
    empty = chunk(message(STATUS_CHANNEL, b"{}")) + message_index(IMAGE_CHANNEL, [(0, 0)] * 200)
    return sound.replace(chunk(topics()), chunk(topics()) + empty * 240)


def deep_json() -> bytes:
    """Brackets in brackets in an unknown member of a record."""
    document = frame_bytes(shot(0, PICTURE))[:-1] + b',"more":' + b"[" * 200_000 + b"]" * 200_000 + b"}"
    return flight(chunk(topics()), chunk(message(FRAME_CHANNEL, document)))


SOUND = [chunk(topics()), chunk(message(FRAME_CHANNEL, frame_bytes(shot(0, PICTURE))))]


def attachment_of_terabytes() -> bytes:
    """Claimed, that is."""
    return flight(
        record(Opcode.ATTACHMENT, struct.pack("<QQ", 0, 0) + text("a") + text("") + struct.pack("<Q", 2**42)),
        Opcode.ATTACHMENT.to_bytes() + struct.pack("<Q", 2**42) + bytes(100),
        *SOUND,
    )


def thousands_of_attachments() -> bytes:
    """With the names of five thousand characters among them."""
    names = [f"a{number}" for number in range(10_000)] + ["n" * 5000 + str(number) for number in range(20)]
    return flight(*(attachment(name, b"x") for name in names), *SOUND)


def far_sequences() -> bytes:
    """Gaps of 10**18 frames."""
    shots = [shot(number, PICTURE, START_NS + place * NS_PER_S) for place, number in enumerate((0, 10**18, 2**63 - 1))]
    return sealed_flight(shots, ATTACHED)


def recovered_before_everything() -> bytes:
    """An end record that lists a hundred thousand frames."""
    shots = [shot(number * 2, PICTURE) for number in range(300)]
    return sealed_flight(shots, {}, end={"recovered_lost_before": ",".join(map(str, range(1, 200_000, 2)))})


BOMBS: Mapping[str, Callable[[], bytes]] = {
    "twenty thousand pictures without a record": lambda: flight(
        chunk(topics()),
        chunk(b"".join(message(IMAGE_CHANNEL, image(b"", 1000 + number)) for number in range(20_000)), "zstd"),
    ),
    "pictures and records of one time": pictures_of_one_time,
    "a chunk that becomes a gigabyte": lambda: flight(chunk(topics()), chunk(bytes(2**30 - 1), "zstd")),
    "another, as lz4": lambda: flight(chunk(topics()), chunk(bytes(2**28), "lz4")),
    "many chunks that swell": many_swelling_chunks,
    "chunks that look like chunks": chunks_that_look_like_chunks,
    "one picture without a record in each of many chunks": lambda: flight(
        chunk(topics()),
        *(chunk(message(IMAGE_CHANNEL, image(b"", each))) + message_index(1, [(0, 0)]) for each in range(6000)),
    ),
    "garbage between chunks, each to be searched for": lambda: flight(
        chunk(topics()), *[b"\xee" + chunk(message(IMAGE_CHANNEL, b"")) for _ in range(8000)]
    ),
    "thirty thousand channels": lambda: flight(
        chunk(b"".join(channel(number, "/t") for number in range(30_000)), "zstd"), chunk(topics())
    ),
    "indexes that promise pictures": indexes_that_promise_pictures,
    "deep JSON": deep_json,
    "groups in groups in an unknown field": lambda: flight(
        chunk(topics()), chunk(message(IMAGE_CHANNEL, b"\x7b" * 100_000 + b"\x7c" * 100_000))
    ),
    "an attachment of terabytes": attachment_of_terabytes,
    "thousands of attachments": thousands_of_attachments,
    "numbers far apart": far_sequences,
    "frames a hundred years apart": lambda: sealed_flight(
        [shot(number, PICTURE, START_NS + number * 3 * 10**18) for number in range(3)], {}
    ),
    "a chain that breaks at every frame": lambda: sealed_flight(
        [shot(number * 2000, b"x") for number in range(900)], {}, compression="zstd", per_chunk=900
    ),
    "a recovery that declares everything lost": recovered_before_everything,
}


@pytest.mark.parametrize("name", BOMBS)
def test_flight_of_a_megabyte_is_over_soon(judge: Judge, name: str) -> None:
    """Whatever it holds and whatever is done with it."""
    content = BOMBS[name]()

    assert 0 < len(content) < 1.2e6
    assert faults(judge, ALL, content) == {}


def faults(judge: Judge, targets: Iterable[Target], content: bytes) -> dict[str, Sequence[str]]:
    """What each command did with a flight that it may not do, by command."""
    outcomes = {" ".join(target.words): judge(target, {"flight.mcap": content}) for target in targets}
    return {command: outcome.faults for command, outcome in outcomes.items() if outcome.faults}


def gigapixel_frames() -> bytes:
    """Behind a legal fill byte."""
    jpeg = plain_picture()
    at = jpeg.index(b"\xff\xc0")
    huge = jpeg[:at] + b"\xff" + jpeg[at : at + 5] + (32_000).to_bytes(2) * 2 + jpeg[at + 9 :]
    return sealed_flight([shot(number, huge) for number in range(3)], ATTACHED)


def frames_in_a_thousand_scans() -> bytes:
    """Of a few bytes each, over all pixels."""
    jpeg = plain_picture(size=(2048, 1536), progressive=True)
    last = jpeg[jpeg.rindex(b"\xff\xda") : -2]
    return sealed_flight([shot(number, jpeg[:-2] + last * 1000 + jpeg[-2:]) for number in range(3)], ATTACHED)


def nothing_to_be_seen(kind: str) -> bytes:
    """Frames with as many pixels for each byte as are taken, padded with what their chunk compresses away."""
    size = (1024, 768)
    picture = encoded(Image.new("L", size, 120), kind, progressive=True, optimize=True)
    limit = {"JPEG": JPEG_PIXELS_PER_BYTE, "PNG": PNG_PIXELS_PER_BYTE}[kind]
    flat = picture.ljust(size[0] * size[1] // limit + 1, b"\0")
    attached = {**ATTACHED, "noise": np.random.default_rng(1).bytes(700_000)}
    return sealed_flight(
        [shot(number, flat) for number in range(1_450_000 // len(flat))], attached, compression="zstd", per_chunk=40
    )


@pytest.mark.parametrize("kind", ["JPEG", "PNG"])
def test_frames_with_nothing_to_be_seen_are_soon_over(judge: Judge, kind: str) -> None:
    """However little room they take."""
    content = nothing_to_be_seen(kind)
    outcomes = [judge(target, {"flight.mcap": content}) for target in (DECODE, FRAMES)]

    assert [outcome.faults for outcome in outcomes] == [(), ()]
    assert "anchor knob" in outcomes[0].said


@pytest.mark.parametrize("make", [gigapixel_frames, frames_in_a_thousand_scans])
def test_frames_that_cannot_be_read_are_one_sentence(judge: Judge, make: Callable[[], bytes]) -> None:
    """The reason of the first, and no picture is decompressed that is too large or too slow."""
    outcome = judge(DECODE, {"flight.mcap": make()})

    assert outcome.faults == ()
    assert outcome.code == 1
    assert len(outcome.said.strip().splitlines()) == 1


def changed_record(**members: object) -> bytes:
    """A flight of three frames, the middle one with another record."""
    shots = [shot(number, FRAMES_OF_FLIGHT[number % 2]) for number in range(3)]
    shots[1] = replace(shots[1], document={**shots[1].document, **members})
    return sealed_flight(shots, ATTACHED)


@pytest.mark.parametrize(
    "members",
    [
        {"captured": {"sec": 253_402_300_800, "nsec": 0}},
        {"captured": {"sec": -5, "nsec": 0}},
        {"captured": {"sec": 2**64, "nsec": 0}},
        {"captured": {"sec": 1_525_435_201, "nsec": 10**30}},
        {"sequence": 2**64},
        {"sequence": -1},
        {"width_px": 2**70},
    ],
    ids=str,
)
def test_record_out_of_range_costs_its_frame(judge: Judge, members: dict[str, object]) -> None:
    """Times and numbers that no flight has are a loss that is told, by whatever reads it."""
    told = [judge(target, {"flight.mcap": changed_record(**members)}) for target in (INFO, REPLAY, DECODE)]

    assert [(outcome.faults, outcome.code) for outcome in told] == [((), 3)] * 3


@pytest.mark.parametrize("focal_length_mm", [0, -1, 1e-300, 1e308, 2**62, 10_001])
def test_focal_length_of_no_lens_is_the_same_as_none(judge: Judge, focal_length_mm: float) -> None:
    """The frame is read at the panel's own zoom, or at none."""
    content = changed_record(exif={"focal_length_mm": focal_length_mm})
    outcomes = [judge(target, {"flight.mcap": content}) for target in (INFO, REPLAY, DECODE)]

    assert [(outcome.faults, outcome.code) for outcome in outcomes] == [((), 0)] * 3


@pytest.mark.parametrize(
    "items",
    [{"recording": name} for name in ("\0", "a" * 5000, "..", "/", "two\nlines")]
    + [{"segment": "9" * 4000}, {"started_realtime_ns": str(2**80)}, {"chain": "\0"}],
    ids=lambda items: next(iter(items)),
)
def test_session_of_any_words_is_read(judge: Judge, items: Mapping[str, str]) -> None:
    """Nothing that reads a flight falls over what the flight calls itself."""
    assert faults(judge, BOX, sealed_flight([shot(0, PICTURE)], {}, session=items)) == {}


def gauge_many_times(panel: dict[str, Any], count: int, radius: float) -> None:
    """Copies of the first gauge in the middle of the picture."""
    first = panel["gauges"][0]
    needle = {key: value for key, value in first["needles"][0].items() if key != "covered_by"}
    panel["gauges"] = [
        {**first, "name": f"g{number}", "centre": [512, 384], "radius": [5, radius]}
        | {"needles": [{**needle, "name": f"n{number}"}]}
        for number in range(count)
    ]


def anchors_of_everything(count: int) -> list[dict[str, Any]]:
    """So many boxes around nearly all of the panel picture."""
    return [{"name": f"a{number}", "box": [number, 0, 900, 700]} for number in range(count)]


PANELS: Mapping[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "many gauges": (lambda panel: gauge_many_times(panel, 1000, 80), "gauges"),
    "large gauges": (lambda panel: gauge_many_times(panel, 200, 380), "million pixels"),
    "radius": (lambda panel: panel["gauges"][0].update(radius=[5, 9000]), "outside"),
    "number": (lambda panel: panel["gauges"][0].update(centre=[1e300, 0]), "gauges[0].centre"),
    "sweep": (lambda panel: panel["gauges"][0].update(sweep=[0, 9000]), "more than a turn"),
    "marks": (lambda panel: panel["gauges"][0].update(scale=[[120 + at / 100, at] for at in range(4000)]), "scale"),
    "flat scale": (lambda panel: panel["gauges"][0].update(scale=[[120, 0], [420, 5e-324]]), "apart"),
    "focal length": (lambda panel: panel.update(focal_length_mm=1e300), "focal_length_mm"),
    "anchors": (lambda panel: panel.update(anchors=anchors_of_everything(30)), "anchors"),
    "zoom": (lambda panel: panel.update(focal_length_mm=9000), "was taken at 4.45 mm"),
    "rim": (lambda panel: panel["gauges"][0].update(rim=[[at, at] for at in range(3000)]), "rim"),
}


@pytest.mark.parametrize("name", PANELS)
def test_panel_that_would_take_too_much_is_refused(judge: Judge, name: str) -> None:
    """What no cockpit has is one sentence with the path of the wrong value."""
    change, words = PANELS[name]
    panel = yaml.safe_load(ATTACHED["panel.yaml"])
    change(panel)
    carried = {**ATTACHED, "panel.yaml": yaml.safe_dump(panel).encode()}
    content = sealed_flight([shot(number, picture) for number, picture in enumerate(FRAMES_OF_FLIGHT)], carried)
    outcome = judge(DECODE, {"flight.mcap": content})

    assert outcome.faults == ()
    assert outcome.code == 1
    assert words in outcome.said
    assert len(outcome.said.strip().splitlines()) == 1


@pytest.mark.parametrize("kind", ["BMP", "GIF", "TIFF"])
def test_panel_picture_of_another_format_is_refused(judge: Judge, kind: str) -> None:
    """JPEG and PNG have limits; others are not tried."""
    picture = encoded(Image.new("L", (1024, 768)), kind)
    content = sealed_flight([shot(0, PICTURE)], {**ATTACHED, "panel.jpg": picture})
    outcome = judge(DECODE, {"flight.mcap": content})

    assert outcome.faults == ()
    assert "neither a JPEG nor a PNG nor a WebP" in outcome.said


HEADER = "frame,time_utc,time_s,a,a_status,a_score,a_sigma\n"
ROWS = "".join(f"{row},2018-05-04T12:00:{row:02d}Z,{row},{row},read,0.9,0.1\n" for row in range(20))


@pytest.mark.parametrize(
    ("flight", "description"),
    [
        ("a" * 1_000_000, "{}"),
        (HEADER + ROWS.replace("2018", "9999"), "{}"),
        (HEADER + ROWS, "[" * 100_000),
        (HEADER + ROWS, '{"needles": {"a": {"scale_max": %s, "scale_min": 0, "unit": "x"}}}' % ("9" * 400)),
        (HEADER + ROWS, '{"needles": {"a": {"scale_max": 1e308, "scale_min": -1e308, "unit": 5, "wraps": "x"}}}'),
        ("frame,time_s,a,a_status\n0,0,1,read\n", "{}"),
    ],
    ids=["one line", "year 9999", "deep", "large number", "infinite scale", "no sigma"],
)
def test_tables_of_strangers_are_compared_or_refused(judge: Judge, flight: str, description: str) -> None:
    """In words, whatever stands in them or in the description beside them."""
    files = {"flight.csv": flight.encode(), "truth.csv": (HEADER + ROWS).encode(), "flight.json": description.encode()}
    for words in ((), ("--offset", "auto", "--limits")):
        outcome = judge(Target(("decode", "accuracy", "in/flight.csv", "in/truth.csv", *words)), files)
        assert outcome.faults == ()


def test_exif_that_names_its_bytes_many_times_takes_little(judge: Judge) -> None:
    """Five thousand tags that all have the same sixty kilobytes for their value."""
    entries, length = 4000, 60_000
    directory = struct.pack("<H", entries) + b"".join(
        struct.pack("<HHII", tag, 3, length // 8, 8) for tag in range(40_000, 40_000 + entries)
    )
    start = struct.pack("<2sHI", b"II", 42, 8) + struct.pack("<HHHII", 1, 0x8769, 4, 1, 26) + bytes(4)
    block = b"Exif\0\0" + start + directory
    jpeg = PICTURE[:2] + b"\xff\xe1" + (len(block) + 2).to_bytes(2) + block + PICTURE[2:]
    outcome = judge(
        Target(("recorder", "replay", "in/photographs", "-o", "out/again.mcap", "--rate", "1")),
        {f"photographs/{number}.jpg": jpeg for number in range(15)},
    )

    assert outcome.faults == ()
    assert outcome.code == 0


def test_board_on_a_picture_of_nothing_takes_little(judge: Judge) -> None:
    """OpenCV's search for a board takes more memory for a pixel than anything else here."""
    size = {"in/photographs/0.jpg": plain_picture(size=(8192, 8192), progressive=True).ljust(10**6)}
    target = Target(("decode", "calibrate", "board", *size, "--squares", "7x5", "-o", "out/camera.yaml"))
    outcome = judge(target, {name.removeprefix("in/"): content for name, content in size.items()})

    assert outcome.faults == ()
    assert "million pixels or fewer" in outcome.said


@pytest.mark.parametrize("size", [(8192, 1), (6000, 4000)], ids=str)
def test_board_on_stripes_takes_little(judge: Judge, size: tuple[int, int]) -> None:
    """OpenCV's search would take gigabytes for what has many edges, or is long."""
    picture = Image.new("L", size, 128)
    for left in range(0, size[0], 64):
        picture.paste(90, (left, 0, left + 1, size[1]))
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0x920A] = 4.45
    target = Target(("decode", "calibrate", "board", "in/0.jpg", "--squares", "7x5", "-o", "out/camera.yaml"))
    outcome = judge(target, {"0.jpg": encoded(picture, exif=exif)})

    assert outcome.faults == ()
    assert "the board is found in 0 of 1 photographs" in outcome.said


def test_picture_with_a_zero_in_its_name_is_refused(judge: Judge) -> None:
    """No system has such a file."""
    panel = {**yaml.safe_load(ATTACHED["panel.yaml"]), "picture": "\0"}
    files = {"flight.mcap": sealed_flight([shot(0, PICTURE)], {}), "panel.yaml": yaml.safe_dump(panel).encode()}
    outcome = judge(Target(("decode", "in/flight.mcap", "--panel", "in/panel.yaml", "-o", "out")), files)

    assert outcome.faults == ()
    assert "not printable" in outcome.said


@pytest.mark.parametrize("size", [(8191, 8192), (8, 32_766), (32_766, 8)])
def test_odd_frame_is_drawn(judge: Judge, size: tuple[int, int]) -> None:
    """The largest and the thinnest that are taken, in bearable memory."""
    odd = plain_picture(size=size)
    shots = [shot(number, picture) for number, picture in enumerate((FRAMES_OF_FLIGHT[0], odd, FRAMES_OF_FLIGHT[1]))]
    outcome = judge(FRAMES, {"flight.mcap": sealed_flight(shots, ATTACHED)})

    assert (outcome.faults, outcome.code) == ((), 0)

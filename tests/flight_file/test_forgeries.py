"""Forgeries by name, each made of a real recording by somebody with all our code but not the key, and what finds them.

Digests, chain, CRCs and indexes are worked out anew unless the forgery is about just these.
"""

from __future__ import annotations

import json
import shutil
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.records import Metadata
from mcap.writer import Writer

from flight_file.frame import CameraStatus, ClockReading
from flight_file.messages import IMAGE_TOPIC, LOG_TOPIC, TOPICS
from flight_file.reader import open_flight
from flight_file.salvage import recover_segment
from flight_file.scan import scan_file
from flight_file.segment import open_segment, opened
from flight_file.session import Session, sealed
from flight_file.signature import Signer, load_signer, make_key_files, signature_path, write_signature
from flight_file.verification import Verdict, prove, verify
from flight_file.writer import SegmentWriter
from recorder.evidence import verify as verify_command
from tests.flight_file.flights import after, flipped, make_frame, write_flight
from tests.flight_file.forging import Taken, add_message

FITS, FAULT, LOSS = 0, 1, 3
OLD = "20180504T120000Z"


@dataclass
class Evidence:
    """A signed recording of three segments of three frames, each frame in a chunk of its own; a forger's plaything."""

    paths: list[Path]
    signer: Signer
    key: Path
    jpeg: bytes

    def change(self, number: int, change: Callable[[Taken], object], **how: Any) -> None:  # noqa: ANN401
        """Take a segment apart, change it, chain it anew and put it together, as `Taken.write` is told."""
        taken = Taken.of(self.paths[number])
        change(taken)
        taken.chain_anew()
        taken.write(**how)

    def part(self, number: int) -> Path:
        """Give a segment the name of one in work, without its signature."""
        path = self.paths[number]
        signature_path(path).unlink()
        self.paths[number] = path.rename(path.with_name(path.name + ".part"))
        return self.paths[number]

    def cut(self, number: int, checkpoints: int) -> Path:
        """Cut a segment behind so many checkpoints."""
        part = self.part(number)
        with opened(part) as source:
            end = scan_file(part, source).checkpoints[checkpoints - 1].end
        part.write_bytes(part.read_bytes()[:end])
        return part

    def unsign(self) -> None:
        """Make it a recording of a box without a key."""
        for number, path in enumerate(self.paths):
            signature_path(path).unlink()
            self.change(number, lambda taken: taken.drop("checkpoint"))


@pytest.fixture
def evidence(tmp_path: Path, signer: Signer) -> Evidence:
    """What the box recorded."""
    folder = tmp_path / "flights"
    folder.mkdir()
    frames = [make_frame(sequence) for sequence in range(9)]
    attachments = {"panel.yaml": b"name: F-16\n"}
    paths = write_flight(folder, frames, recording=OLD, attachments=attachments, frames_per_segment=3, signer=signer)
    return Evidence(paths, signer, tmp_path / "box.key.pub", make_frame(99).encoded)


def forged_picture(evidence: Evidence, *, finished: bool, keep: tuple[str, ...] = ()) -> None:
    """Another picture in the middle segment, unsigned."""

    def change(taken: Taken) -> None:
        taken.exchange_picture(1, evidence.jpeg)
        taken.drop(*({"checkpoint", "end"} - set(keep)) - (set() if not finished else {"end"}))

    signature_path(evidence.paths[1]).unlink()
    evidence.change(1, change, finished=finished)
    if not finished:
        part = evidence.paths[1].with_name(evidence.paths[1].name + ".part")
        evidence.paths[1] = evidence.paths[1].rename(part)


def sign_with(key: Path, *paths: Path) -> None:
    """Sign segments with a new key."""
    make_key_files(key)
    for path in paths:
        write_signature(path, open_flight([path]).sha256_of_files()[path], load_signer(key))


def one_frame_left(evidence: Evidence, number: int) -> None:
    """Two of three frames dropped, unsigned."""
    signature_path(evidence.paths[number]).unlink()
    evidence.change(number, lambda taken: (taken.drop("checkpoint"), taken.remove(3 * number + 1, 3 * number + 2)))


def forged_last(evidence: Evidence, *, finished: bool, key: Path | None = None) -> None:
    """The last segment made anew, going on from the one before; with the forger's signature if there is a key."""
    signature_path(evidence.paths[2]).unlink()
    evidence.change(
        2, lambda taken: (taken.drop("checkpoint"), taken.exchange_picture(0, evidence.jpeg)), finished=finished
    )
    if key is not None:
        sign_with(key, evidence.paths[2])


def forged_tail(evidence: Evidence) -> None:
    """Behind the last checkpoint of a segment that was cut off, a frame is put that goes on with the chain."""
    whole = Taken.of(evidence.paths[2])
    whole.exchange_picture(2, evidence.jpeg)
    whole.chain_anew()
    part = evidence.cut(2, 3)
    whole.path = part.with_name("aside")
    whole.write()
    with opened(whole.path) as source:
        places = scan_file(whole.path, source).chunks
    content = whole.path.read_bytes()
    part.write_bytes(part.read_bytes() + content[places[3].offset : places[3].offset + places[3].length])


def renamed(evidence: Evidence, number: int, name: str) -> None:
    """A segment and its signature under another name."""
    path = evidence.paths[number]
    target = path.with_name(name)
    signature_path(path).rename(signature_path(target))
    evidence.paths[number] = path.rename(target)


def all_renamed(evidence: Evidence) -> None:
    """The whole old recording, signatures and all, as today's."""
    for number in range(3):
        renamed(evidence, number, f"20261122T090000Z_{number:04d}.mcap")


def swapped(evidence: Evidence, *, inside: bool) -> None:
    """Two segments change places, by their names or by what they say inside."""
    one, two = evidence.paths[:2]
    if inside:
        for number, path in ((1, one), (0, two)):
            signature_path(path).unlink()
            evidence.change(1 - number, lambda taken, number=number: taken.seal("session", segment=str(number)))
    aside = one.with_name("aside")
    for source, target in ((one, aside), (two, one), (aside, two)):
        if not inside:
            signature_path(source).rename(signature_path(target))
        source.rename(target)


def other_signature(evidence: Evidence) -> None:
    """The genuine signature of another segment."""
    shutil.copyfile(signature_path(evidence.paths[0]), signature_path(evidence.paths[1]))


def other_key_named(evidence: Evidence) -> None:
    """A signature that says that another key made it."""
    path = signature_path(evidence.paths[0])
    text = path.read_bytes()
    path.write_bytes(text.replace(text.split()[6], b"A" * 43 + b"="))


def chained_anew(evidence: Evidence) -> None:
    """Another record in the last segment, its whole chain worked out anew, beside the signature that it had."""
    evidence.change(2, lambda taken: (taken.drop("checkpoint"), taken.edit_record(7, zoom_position=9.0)))


def on_unsigned(change: Callable[[Taken], object]) -> Callable[[Evidence], None]:
    """A change of the last segment of a recording that was never signed."""

    def forge(evidence: Evidence) -> None:
        evidence.unsign()
        evidence.change(2, change)

    return forge


def with_writer(more: Callable[[Writer, Taken], object]) -> Callable[[Evidence], None]:
    """Something more that is written into the last segment of a recording that was never signed."""

    def forge(evidence: Evidence) -> None:
        evidence.unsign()
        taken = Taken.of(evidence.paths[2])
        taken.write(more=lambda writer: more(writer, taken))

    return forge


def frame_behind_the_end(taken: Taken) -> None:
    """A chunk that the end record knows nothing of."""
    taken.steps.append(list(taken.frames())[-1][0])


def second_session(taken: Taken) -> None:
    """A reader that takes the last record of a name believes the second."""
    items = {**taken.metadata("session").metadata, "host": "another box"}
    del items["sha256"]
    taken.steps.insert(2, Metadata(name="session", metadata=sealed(items)))


def second_channel(writer: Writer, _taken: Taken) -> None:
    """Another channel with the log's topic, and a line in it."""
    writer.register_channel(LOG_TOPIC, "protobuf", 5)
    writer.add_message(len(TOPICS), 2**61, b"", 2**61)
    writer.flush()  # type: ignore[no-untyped-call]


def other_schema(writer: Writer, taken: Taken) -> None:
    """The pictures' channel defined once more, with another schema: a viewer would show another field."""
    writer._Writer__channels.clear()  # type: ignore[attr-defined]
    writer.register_channel(IMAGE_TOPIC, "protobuf", 2)
    status = next(message for step in taken.steps if isinstance(step, list) for message in step)
    add_message(writer, status)
    writer.flush()  # type: ignore[no-untyped-call]


def picture_beside_the_picture(taken: Taken) -> None:
    """A second picture in a field of the message that only a forged schema knows."""
    _, _, picture = next(iter(taken.frames()))
    picture.data += b"\xa2\x06\x05other"


def hidden_by_the_index(evidence: Evidence) -> None:
    """The index at the end leaves a chunk out: other readers do not show its frame."""
    evidence.unsign()
    taken = Taken.of(evidence.paths[2])
    taken.write(more=lambda writer: writer._Writer__chunk_indices.pop(2))  # type: ignore[attr-defined]


def hidden_by_the_message_index(evidence: Evidence) -> None:
    """The index behind a chunk leaves its messages out, all CRCs in order."""
    evidence.unsign()
    path = evidence.paths[2]
    data = bytearray(path.read_bytes())
    with opened(path) as source:
        place = scan_file(path, source).chunks[2]
    index = place.offset + place.length
    (length,) = struct.unpack_from("<I", data, index + 11)
    data[index + 15 : index + 15 + length] = bytes(length)
    end = data.rindex(b"\x0f\x04\x00\x00\x00\x00\x00\x00\x00")
    data[end + 9 : end + 13] = zlib.crc32(data[:end]).to_bytes(4, "little")
    path.write_bytes(data)


def extra_attachment(writer: Writer, _taken: Taken) -> None:
    """A calibration that was never there; the desk would read with it."""
    writer.add_attachment(0, 0, "camera.yaml", "application/yaml", b"focal_length: 1\n")


def second_attachment(writer: Writer, _taken: Taken) -> None:
    """Another panel of the same name: which one is shown depends on the reader."""
    writer.add_attachment(0, 0, "panel.yaml", "application/yaml", b"name: F-17\n")


FORGERIES: dict[str, tuple[Callable[[Evidence], object], int, str]] = {
    "nothing at all": (lambda _evidence: None, FITS, ""),
    "a picture, then finished": (lambda evidence: forged_picture(evidence, finished=True), FAULT, "not signed"),
    "a picture, then cut off": (lambda evidence: forged_picture(evidence, finished=False), FAULT, "not signed"),
    "a picture, then cut off, checkpoints left": (
        lambda evidence: forged_picture(evidence, finished=False, keep=("checkpoint",)),
        FAULT,
        "wrong signature",
    ),
    "frames dropped in the middle": (lambda evidence: one_frame_left(evidence, 1), FAULT, "not signed"),
    "frames dropped at the end": (lambda evidence: one_frame_left(evidence, 2), FAULT, "not signed"),
    "the middle cut at a checkpoint": (lambda evidence: evidence.cut(1, 2), FAULT, "changed segment"),
    "the end cut at a checkpoint": (lambda evidence: evidence.cut(2, 3), LOSS, "cut off"),
    "the end cut, a frame put behind it": (forged_tail, LOSS, "not proven"),
    "the signature taken away": (lambda evidence: signature_path(evidence.paths[2]).unlink(), FAULT, "not signed"),
    "a last segment of one's own": (lambda evidence: forged_last(evidence, finished=True), FAULT, "not signed"),
    "a last segment of one's own, cut off": (
        lambda evidence: forged_last(evidence, finished=False),
        FAULT,
        "not signed",
    ),
    "a last segment with a key of one's own": (
        lambda evidence: forged_last(evidence, finished=True, key=evidence.key.with_name("forger.key")),
        FAULT,
        "signed with another key",
    ),
    "an old recording under new names": (all_renamed, FAULT, "segment of another recording"),
    "a segment under another number": (
        lambda evidence: renamed(evidence, 1, f"{OLD}_0007.mcap"),
        FAULT,
        "changed segment",
    ),
    "a copy under another number": (
        lambda evidence: evidence.paths.append(
            Path(shutil.copyfile(evidence.paths[1], evidence.paths[1].with_name(f"{OLD}_0003.mcap")))
        ),
        FAULT,
        "changed segment",
    ),
    "a segment as what a recovery made": (
        lambda evidence: renamed(evidence, 1, f"{OLD}_0002.recovered.mcap"),
        FAULT,
        "changed segment",
    ),
    "two segments swapped": (lambda evidence: swapped(evidence, inside=False), FAULT, "changed segment"),
    "two segments swapped and renumbered": (lambda evidence: swapped(evidence, inside=True), FAULT, "wrong signature"),
    "another segment's signature": (other_signature, FAULT, "wrong signature"),
    "a signature that names another key": (other_key_named, FAULT, "wrong signature"),
    "a record, the whole chain anew": (chained_anew, FAULT, "wrong signature"),
    "all signed again with a key of one's own": (
        lambda evidence: sign_with(evidence.key.with_name("forger.key"), *evidence.paths),
        FAULT,
        "signed with another key",
    ),
}

UNSIGNED_FORGERIES: dict[str, tuple[Callable[[Evidence], object], int, str]] = {
    "nothing at all": (Evidence.unsign, FITS, ""),
    "a frame behind the end record": (on_unsigned(frame_behind_the_end), FAULT, "damaged"),
    "a second session record": (on_unsigned(second_session), FAULT, "damaged"),
    "an attachment that was never there": (with_writer(extra_attachment), FAULT, "damaged"),
    "a second attachment of the name": (with_writer(second_attachment), FAULT, "damaged"),
    "a second channel of the topic": (with_writer(second_channel), FAULT, "changed segment"),
    "a channel defined twice": (with_writer(other_schema), FAULT, "changed segment"),
    "a picture beside the picture": (on_unsigned(picture_beside_the_picture), FAULT, "changed picture"),
    "a chunk hidden by the index": (hidden_by_the_index, FAULT, "changed segment"),
    "messages hidden by their index": (hidden_by_the_message_index, FAULT, "changed segment"),
}


def seen(paths: list[Path], *options: str | Path) -> tuple[int, set[str]]:
    """Exit code of `recorder verify`, and the kinds of its findings."""
    done = CliRunner().invoke(verify_command, ["--json", *map(str, options), *map(str, paths)])
    assert done.exception is None or isinstance(done.exception, SystemExit), done.output
    found = {
        finding["kind"]
        for check in json.loads(done.stdout)
        for each in check["segments"]
        for finding in each["findings"]
    }
    return done.exit_code, found


@pytest.mark.parametrize("name", FORGERIES)
def test_forgery_of_a_signed_recording_is_found(evidence: Evidence, name: str) -> None:
    """With the box's public key, and without any: what is signed vouches for the rest."""
    forge, code, kind = FORGERIES[name]
    forge(evidence)
    with_key, without_key = seen(evidence.paths, "--public-key", evidence.key), seen(evidence.paths)

    assert (with_key[0], without_key[0]) == (code, code)
    assert not kind or kind in with_key[1]


@pytest.mark.parametrize("name", UNSIGNED_FORGERIES)
def test_forgery_of_an_unsigned_recording_is_found(evidence: Evidence, name: str) -> None:
    """Only the chain can show it, and other readers would show something that the chain does not cover."""
    forge, code, kind = UNSIGNED_FORGERIES[name]
    forge(evidence)

    exit_code, kinds = seen(evidence.paths)
    assert exit_code == code
    assert not kind or kind in kinds


def test_whole_frames_behind_the_last_checkpoint_are_counted_and_named(evidence: Evidence) -> None:
    """How many are proven, and from which on nothing is."""
    forged_tail(evidence)
    (check,) = verify(evidence.paths, public_key=evidence.signer.public_key)

    assert (check.segments[2].frames, check.segments[2].proven_frames) == (3, 2)
    assert [finding.reason for finding in check.findings][-1] == (
        "its last 1 frame(s), from frame 8 on, stand behind its last checkpoint: nothing proves them"
    )


def test_unsigned_segment_in_work_says_that_it_proves_nothing(evidence: Evidence) -> None:
    """Where nobody vouches for anything."""
    evidence.unsign()
    taken = Taken.of(evidence.paths[2])
    taken.drop("end")
    taken.write(finished=False)

    assert seen(evidence.paths) == (LOSS, {"cut off", "not proven"})


def test_planted_file_is_not_signed_by_the_box(evidence: Evidence) -> None:
    """A segment of somebody else's, put where the box looks for what it left in work."""
    forged_picture(evidence, finished=False)
    recovery = recover_segment(evidence.paths[1], at=ClockReading(1, 1), signer=evidence.signer)

    assert not recovery.signed
    assert seen([evidence.paths[0], recovery.path, evidence.paths[2]])[0] == FAULT


def test_damaged_signature_is_found(evidence: Evidence) -> None:
    """Cut, or any byte changed, also by a bit that base64 has to spare: there is one way to write a signature."""
    path = evidence.paths[1]
    segment, _ = open_segment(path)
    text = signature_path(path).read_bytes()
    changed = [b"", text[:-9], text.replace(b"sha256 ", b"sha256 0", 1)]
    changed += [flipped(text, 8 * at + at % 8) for at in range(len(text))]
    changed += [flipped(text, bit) for bit in range(8 * (len(text) - 4), 8 * len(text))]
    for each in changed:
        signature_path(path).write_bytes(each)

        assert prove(segment, evidence.signer.public_key).finding is not None
    signature_path(path).write_bytes(text)
    assert prove(segment, evidence.signer.public_key).finding is None
    assert prove(segment, None).signed_by == evidence.signer.public_key


FRAMES = 12
MESSAGE_HEAD_BYTES = 31


@pytest.fixture
def small(tmp_path: Path) -> tuple[Path, bytes]:
    """A file of small frames in three chunks, and its bytes."""
    path, session = tmp_path / "small_0000.mcap", Session("small", started=after(0))
    writer = SegmentWriter(path, session=session, status=CameraStatus("connected"), attachments={})
    for number in range(FRAMES):
        writer.write_frame(make_frame(number, 30), after(number / 100))
        if number % 4 == 3:
            writer.sync(after(0))
    writer.finish("stopped", dropped=0, at=after(0))
    return path, path.read_bytes()


@settings(max_examples=250, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    index=st.integers(0, FRAMES - 1),
    of_picture=st.booleans(),
    place=st.floats(0, 1, exclude_max=True),
    fixes_crc=st.booleans(),
)
def test_flipped_bit_is_found_at_its_frame_and_nowhere_else(
    small: tuple[Path, bytes], index: int, place: float, *, of_picture: bool, fixes_crc: bool
) -> None:
    """Anywhere in a frame's record or picture, by a bad disk or by somebody who puts the CRC in order."""
    path, data = small
    path.write_bytes(data)
    taken = Taken.of(path)
    _, record, picture = taken.frame(index)
    if fixes_crc:  # no digest covers the heads that MCAP puts before a message; not all of them tell then
        message = picture if of_picture else record
        message.data = flipped(message.data, int(place * 8 * len(message.data)))
        taken.write()
    else:
        start, end = data.index(record.data) - MESSAGE_HEAD_BYTES, data.index(picture.data) + len(picture.data)
        path.write_bytes(flipped(data, 8 * start + int(place * 8 * (end - start))))
    (check,) = verify([path])

    assert check.verdict is Verdict.FAULT
    assert check.first_fault is not None
    assert check.first_fault.sequence == index
    assert {finding.sequence for finding in check.findings} <= {index, None}

"""Whoever changes a flight is found out: what was changed, and the first frame that shows it."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from flight_file import codec
from flight_file.chain import link, opened_frame, sealed_frame
from flight_file.durable_file import DurableFile
from flight_file.errors import KeyFileError, MixedFlightsError
from flight_file.findings import Finding, FindingKind
from flight_file.frame import ClockReading, Frame
from flight_file.keys import is_genuine, load_public_key, load_signer, make_key_files
from flight_file.packing import packed_head, registered_topics
from flight_file.reader import open_flight
from flight_file.reports import CameraStatus
from flight_file.salvage import recover_segment
from flight_file.segments import FlightWriter, Plan
from flight_file.session import Session, sealed
from flight_file.signature import read_signature, signature_path, write_signature
from flight_file.topics import FRAME_TOPIC, IMAGE_TOPIC
from flight_file.verification import RecordingCheck, Verdict, verify

AT = ClockReading(1_800_000_000_000_000_000, 7)
WriteFlight = Callable[..., list[Path]]


@dataclass
class Forgery:
    """A flight file taken apart: what a forger with all our code can change before putting it together again."""

    metadata: dict[str, dict[str, str]]
    attachments: dict[str, bytes]
    messages: list[tuple[str, bytes, int, int]]  # topic, data, log time, sequence

    def seal(self, record: str, **items: str) -> None:
        """Change items of a metadata record, and the digest that it carries of itself."""
        kept = {key: value for key, value in self.metadata[record].items() if key != "sha256"}
        self.metadata[record] = sealed(kept | items)

    def places(self, sequence: int) -> list[int]:
        """Where the record and the image of a frame stand."""
        numbered = [index for index, message in enumerate(self.messages) if message[0] in (FRAME_TOPIC, IMAGE_TOPIC)]
        return [index for index in numbered if self.messages[index][3] == sequence]

    def change(self, index: int, data: bytes) -> None:
        """Another content for a message."""
        topic, _, log_ns, sequence = self.messages[index]
        self.messages[index] = (topic, data, log_ns, sequence)

    def edit_record(self, sequence: int, **members: Any) -> None:  # noqa: ANN401 - JSON
        """Another record for a frame, with the value in the chain that it had."""
        index = self.places(sequence)[0]
        document = json.loads(self.messages[index][1])
        chain = document.pop("chain")
        self.change(index, json.dumps({**document, **members, "chain": chain}, separators=(",", ":")).encode())

    def remove(self, sequence: int) -> None:
        """Take a frame out, and count it out of the end record."""
        for index in reversed(self.places(sequence)):
            del self.messages[index]
        self.seal("end", frames=str(int(self.metadata["end"]["frames"]) - 1))

    def chain_anew(self) -> None:
        """What only somebody who recomputes everything can do: a chain that fits."""
        session, attachments = self.metadata["session"], self.metadata["attachments"]
        value = link(session["chain"], (session["sha256"] + attachments["sha256"]).encode())
        for index, (topic, data, _, _) in enumerate(self.messages):
            if topic == FRAME_TOPIC:
                record, value = sealed_frame(opened_frame(data)[0] + b"}", value)
                self.change(index, record)
        self.seal("end", chain=value)


def taken_apart(path: Path) -> Forgery:
    """Everything in a flight file, by an independent reader."""
    with path.open("rb") as file:
        reader = make_reader(file)
        messages = [
            (channel.topic, message.data, message.log_time, message.sequence)
            for _, channel, message in reader.iter_messages(log_time_order=False)
        ]
        metadata = {record.name: dict(record.metadata) for record in reader.iter_metadata()}
        attachments = {attachment.name: attachment.data for attachment in reader.iter_attachments()}
    return Forgery(metadata, attachments, messages)


def put_together(forgery: Forgery, path: Path) -> None:
    """A finished flight file with every CRC in order."""
    path.unlink()
    file = DurableFile(path)
    writer = packed_head(
        file,
        session=forgery.metadata["session"],
        attachment_digests=forgery.metadata["attachments"],
        attachments=forgery.attachments,
        log_ns=0,
    )
    channels = registered_topics(writer)
    for topic, data, log_ns, sequence in forgery.messages:
        writer.add_message(channels[topic], log_ns, data, log_ns, sequence)
        if topic != FRAME_TOPIC:
            writer.flush()  # type: ignore[no-untyped-call]
    writer.add_metadata("end", forgery.metadata["end"])
    writer.finish()  # type: ignore[no-untyped-call]
    file.close()


def forge(path: Path, change: Callable[[Forgery], object]) -> None:
    """Change a flight file in place."""
    forgery = taken_apart(path)
    change(forgery)
    put_together(forgery, path)


def checked(*paths: Path, public_key: bytes | None = None) -> RecordingCheck:
    """The verification of one recording."""
    (check,) = verify(paths, public_key=public_key)
    return check


def fault(*paths: Path, public_key: bytes | None = None) -> Finding:
    """The first fault of a recording that does not fit."""
    check = checked(*paths, public_key=public_key)
    assert check.verdict is Verdict.FAULT
    assert check.first_fault is not None
    return check.first_fault


@pytest.fixture
def segments(tmp_path: Path, frames: list[Frame], write_flight: WriteFlight) -> list[Path]:
    """Three segments of two frames each."""
    folder = tmp_path / "segments"
    folder.mkdir()
    return write_flight(folder, frames, frames_per_segment=2)


def test_untouched_flight_fits(segments: list[Path], flight: Path) -> None:
    """All segments, one segment, and a flight taken apart and put together without a change."""
    forge(flight, lambda _forgery: None)

    assert checked(*segments).verdict is Verdict.FITS
    assert checked(*segments).findings == ()
    assert checked(flight).verdict is Verdict.FITS


def test_changed_byte_of_a_picture_is_found(flight: Path, frames: list[Frame]) -> None:
    """One byte of a JPEG, every CRC in order: the frame is named with its number and time."""

    def change(forgery: Forgery) -> None:
        index = forgery.places(3)[1]
        data = bytearray(forgery.messages[index][1])
        data[data.index(frames[3].jpeg) + 100] ^= 1
        forgery.change(index, bytes(data))

    forge(flight, change)
    found = fault(flight)

    assert (found.kind, found.path) == (FindingKind.CHANGED_PICTURE, flight)
    assert (found.sequence, found.captured_ns) == (3, frames[3].captured_ns)


def test_other_picture_with_a_fitting_digest_is_found(flight: Path, frames: list[Frame], make_frame: Any) -> None:  # noqa: ANN401
    """Another picture, its digest in the record, every CRC in order: the record does not fit the chain."""
    other = replace(frames[3], jpeg=make_frame(99).jpeg, sha256=make_frame(99).sha256)

    def change(forgery: Forgery) -> None:
        forgery.edit_record(3, sha256=other.sha256)
        forgery.change(forgery.places(3)[1], codec.encode_image(other))

    forge(flight, change)
    found = fault(flight)

    assert [frame.jpeg for frame in open_flight([flight]).frames()][3] == other.jpeg
    assert (found.kind, found.sequence) == (FindingKind.CHANGED_RECORD, 3)


@pytest.mark.parametrize(
    "members", [{"exif": {"focal_length_mm": 9.9}}, {"zoom_position": 50.0}, {"times": {}}, {"size_bytes": 1}]
)
def test_everything_a_record_says_is_chained(flight: Path, members: dict[str, Any]) -> None:
    """EXIF, zoom, times: whatever is changed in a record breaks the chain at it."""
    forge(flight, lambda forgery: forgery.edit_record(2, **members))

    assert fault(flight).sequence == 2


@pytest.mark.parametrize("sequence", [0, 1, 4])
def test_removed_frame_is_found(flight: Path, sequence: int) -> None:
    """A frame is taken out and everything but the chain put in order: the frame behind it is named."""
    forge(flight, lambda forgery: forgery.remove(sequence))
    found = fault(flight)

    assert found.sequence == sequence + 1
    if sequence:
        assert (found.kind, found.reason) == (FindingKind.REMOVED, f"frame {sequence} was removed before it")


def test_removed_last_frame_is_found(flight: Path) -> None:
    """The end record knows how many frames there were, and what the chain ended with."""
    shutil.copyfile(flight, copy := flight.with_name("copy.mcap"))
    forge(flight, lambda forgery: forgery.remove(5))
    forge(copy, lambda forgery: (forgery.remove(5), forgery.seal("end", frames="6")))

    assert fault(flight).kind is FindingKind.CHANGED_SEGMENT
    assert (fault(copy).kind, fault(copy).sequence) == (FindingKind.REMOVED, 5)


def test_reordered_frames_are_found(flight: Path) -> None:
    """Two frames change places: it is told from a removed frame."""

    def swap(forgery: Forgery) -> None:
        one, two = forgery.places(2), forgery.places(3)
        for left, right in zip(one, two, strict=True):
            messages = forgery.messages
            messages[left], messages[right] = messages[right], messages[left]

    forge(flight, swap)
    found = fault(flight)

    assert (found.kind, found.sequence) == (FindingKind.REORDERED, 3)
    assert "before frame 2" in found.reason


def test_frame_put_in_twice_is_found(flight: Path) -> None:
    """A copy of an earlier frame does not belong where it stands."""

    def insert(forgery: Forgery) -> None:
        copies = [forgery.messages[index] for index in forgery.places(1)]
        place = forgery.places(4)[0]
        forgery.messages[place:place] = copies

    forge(flight, insert)

    assert (fault(flight).kind, fault(flight).sequence) == (FindingKind.REORDERED, 1)


def test_dropped_frame_is_told_from_a_removed_one(
    tmp_path: Path, frames: list[Frame], write_flight: WriteFlight
) -> None:
    """A frame that the recorder never stored is a gap in the numbers, but none in the chain."""
    check = checked(*write_flight(tmp_path, [*frames[:2], *frames[4:]]))

    assert check.verdict is Verdict.FITS
    assert [(finding.kind, finding.sequence) for finding in check.findings] == [(FindingKind.DROPPED, 4)]
    assert check.findings[0].reason.startswith("frames 2 to 3 were never stored")


def test_changed_attachment_is_found(tmp_path: Path, frames: list[Frame], write_flight: WriteFlight) -> None:
    """Another panel in a flight, its digest and CRC in order, breaks the chain: the panel decides what is read."""
    (path,) = write_flight(tmp_path, frames, attachments={"panel.yaml": b"name: F-16\n"})

    def change(forgery: Forgery) -> None:
        forgery.attachments["panel.yaml"] = b"name: F-17\n"
        forgery.seal("attachments", **{"panel.yaml": hashlib.sha256(b"name: F-17\n").hexdigest()})

    forge(path, change)

    assert open_flight([path]).attachments["panel.yaml"] == b"name: F-17\n"
    assert (fault(path).kind, fault(path).sequence) == (FindingKind.CHANGED_RECORD, 0)


def test_chain_taken_out_of_records_is_found(flight: Path) -> None:
    """A file that has a chain cannot pass as an old one that has none."""

    def strip(forgery: Forgery) -> None:
        for sequence in range(6):
            index = forgery.places(sequence)[0]
            forgery.change(index, opened_frame(forgery.messages[index][1])[0] + b"}")

    forge(flight, strip)

    assert (fault(flight).kind, fault(flight).sequence) == (FindingKind.CHANGED_RECORD, 0)


def test_removed_end_record_is_found(flight: Path) -> None:
    """A finished file has an end record."""
    forge(flight, lambda forgery: forgery.metadata["end"].clear())

    assert fault(flight).kind is FindingKind.CHANGED_SEGMENT


@pytest.mark.parametrize("dropped", [[0], [1], [2], [0, 1]])
def test_missing_segment_is_a_loss_and_no_fault(segments: list[Path], dropped: list[int]) -> None:
    """A segment that was not given is named; those that are there fit."""
    check = checked(*(path for number, path in enumerate(segments) if number not in dropped))

    assert check.verdict is Verdict.LOSS
    assert {finding.kind for finding in check.findings} == {FindingKind.MISSING_SEGMENT}


def test_changed_segment_is_told_from_a_missing_one(segments: list[Path]) -> None:
    """A segment from which the last frame was taken, and its chain made to fit: the next does not go on from it."""
    forge(segments[1], lambda forgery: (forgery.remove(3), forgery.chain_anew()))
    found = fault(*segments)

    assert (found.kind, found.path) == (FindingKind.CHANGED_SEGMENT, segments[2])
    assert "does not begin where the segment before it ends" in found.reason


def test_hidden_gap_between_segments_is_found(segments: list[Path]) -> None:
    """The middle segment is dropped and the last one renumbered: its chain does not go on from the first."""
    segments[1].unlink()
    forge(segments[2], lambda forgery: forgery.seal("session", segment="1"))
    segments[2].rename(segments[1])
    found = checked(*segments[:2]).findings

    assert found[0].kind is FindingKind.CHANGED_SEGMENT
    assert checked(*segments[:2]).verdict is Verdict.FAULT


def test_swapped_segments_are_found(segments: list[Path], tmp_path: Path) -> None:
    """Two segments that changed their names are named."""
    segments[1].rename(tmp_path / "aside")
    segments[2].rename(segments[1])
    (tmp_path / "aside").rename(segments[2])
    check = checked(*segments)

    assert check.verdict is Verdict.FAULT
    assert {finding.reason for finding in check.findings} == {
        "it is segment 1 under the name of segment 2",
        "it is segment 2 under the name of segment 1",
    }


def test_segment_of_another_recording_is_found(
    tmp_path: Path, frames: list[Frame], segments: list[Path], write_flight: WriteFlight
) -> None:
    """Under the name of a segment of ours lies one of another flight."""
    others = write_flight(tmp_path, frames, recording="other", frames_per_segment=2)
    others[1].replace(segments[1])
    found = [finding for finding in checked(*segments).findings if finding.is_fault]

    assert [(finding.kind, finding.path) for finding in found] == [(FindingKind.OTHER_RECORDING, segments[1])]
    assert found[0].reason == "it is a segment of the recording other, not of flight"


def test_recordings_are_verified_apart(
    tmp_path: Path, frames: list[Frame], segments: list[Path], write_flight: WriteFlight
) -> None:
    """A whole directory of recordings can be given at once."""
    others = write_flight(tmp_path, frames, recording="other")

    assert [(check.recording, check.verdict) for check in verify([*segments, *others])] == [
        ("flight", Verdict.FITS),
        ("other", Verdict.FITS),
    ]


def test_segment_given_twice_is_one_sentence(segments: list[Path], tmp_path: Path) -> None:
    """A copy under another name is a mistake of who asks."""
    shutil.copyfile(segments[0], tmp_path / "copy.mcap")
    segments[0].rename(tmp_path / "flight.mcap")

    with pytest.raises(MixedFlightsError, match=r"both segment 0; give one of them\.$"):
        verify([tmp_path / "copy.mcap", tmp_path / "flight.mcap"])


def test_other_beginning_is_found(segments: list[Path]) -> None:
    """The chain begins with the recording's name, start and machine: these cannot be changed alone."""
    forge(segments[0], lambda forgery: forgery.seal("session", host="another box"))

    assert fault(segments[0]).kind is FindingKind.CHANGED_SEGMENT or fault(segments[0]).sequence == 0


def test_flight_without_a_chain_says_so(tmp_path: Path, frames: list[Frame], flight: Path) -> None:
    """An old file is read and checked as far as it goes."""
    forgery = taken_apart(flight)
    for index, (topic, data, _, _) in enumerate(forgery.messages):
        if topic == FRAME_TOPIC:
            forgery.change(index, opened_frame(data)[0] + b"}")
    for record in ("session", "end"):
        forgery.metadata[record].pop("chain")
        forgery.seal(record)
    put_together(forgery, flight)
    check = checked(flight)

    assert list(open_flight([flight]).frames()) == frames
    assert check.verdict is Verdict.LOSS
    assert [finding.kind for finding in check.findings] == [FindingKind.NO_CHAIN]
    assert tmp_path.exists()


def test_segment_without_a_chain_after_one_with_is_found(segments: list[Path]) -> None:
    """One segment of a recording cannot pass as an old one."""

    def strip(forgery: Forgery) -> None:
        for sequence in (2, 3):
            index = forgery.places(sequence)[0]
            forgery.change(index, opened_frame(forgery.messages[index][1])[0] + b"}")
        for record in ("session", "end"):
            forgery.metadata[record].pop("chain")
            forgery.seal(record)

    forge(segments[1], strip)

    assert fault(*segments).path == segments[1]


def test_cut_file_fits_as_far_as_it_goes(flight: Path) -> None:
    """What a power cut left fits up to the cut, before and after it was recovered."""
    part = flight.with_name(flight.name + ".part")
    part.write_bytes(flight.read_bytes()[: flight.stat().st_size // 2 + 1500])
    flight.unlink()
    before = checked(part)
    after = checked(recover_segment(part, at=AT).path)

    assert before.verdict is after.verdict is Verdict.LOSS
    assert {finding.kind for finding in (*before.findings, *after.findings)} == {FindingKind.CUT}
    assert before.segments[0].frames == after.segments[0].frames > 0


def test_hole_that_a_recovery_declares_is_a_loss(flight: Path, frames: list[Frame]) -> None:
    """What a recovery found damaged is a loss where it says so; a frame removed elsewhere is still found."""
    data = bytearray(flight.read_bytes())
    data[data.index(frames[2].jpeg)] ^= 1
    flight.write_bytes(data)
    recovered = recover_segment(flight, at=AT).path
    damaged, check = fault(flight), checked(recovered)
    forge(recovered, lambda forgery: forgery.remove(4))

    assert (damaged.kind, damaged.sequence) == (FindingKind.DAMAGED, 2)
    assert check.verdict is Verdict.LOSS
    assert (FindingKind.RECOVERED, 3) in [(finding.kind, finding.sequence) for finding in check.findings]
    assert (fault(recovered).kind, fault(recovered).sequence) == (FindingKind.REMOVED, 5)


def test_flight_that_goes_on_after_a_cut_segment_fits(tmp_path: Path, frames: list[Frame]) -> None:
    """A recorder that lost its disk goes on with the next segment and the chain: what was lost between is a loss."""
    at = ClockReading(10**18, 0)
    plan = Plan(tmp_path, Session("R", started=at), {})
    writer = FlightWriter(plan, status=CameraStatus("connected"), at=at)
    writer.write_frame(frames[0], ClockReading(10**18 + 2 * 10**9, 2 * 10**9))
    writer.write_frame(frames[1], at)
    writer.abandon()
    on = replace(plan, session=replace(plan.session, segment=1, chain=writer.chain))
    second = FlightWriter(on, status=CameraStatus("connected"), at=at)
    second.write_frame(frames[2], at)
    second.finish("stopped", at)
    first = recover_segment(tmp_path / "R_0000.mcap.part", at=AT).path
    check = checked(first, tmp_path / "R_0001.mcap")

    assert check.verdict is Verdict.LOSS
    assert [finding.kind for finding in check.findings] == [FindingKind.CUT, FindingKind.RECOVERED]


@pytest.mark.untraced
def test_any_changed_byte_is_noticed(flight: Path) -> None:
    """Wherever in a finished file a byte changes, even in its index: it does not pass as untouched."""
    data = flight.read_bytes()
    for offset in range(8, len(data), 11):
        flight.write_bytes(data[:offset] + bytes([data[offset] ^ 0x41]) + data[offset + 1 :])

        assert checked(flight).verdict is not Verdict.FITS


@pytest.fixture
def key(tmp_path: Path) -> Path:
    """A private key, its public half beside it."""
    path = tmp_path / "recorder.key"
    make_key_files(path)
    return path


@pytest.fixture
def signed(tmp_path: Path, frames: list[Frame], key: Path) -> list[Path]:
    """Two signed segments."""
    at = ClockReading(10**18, 0)
    plan = Plan(tmp_path, Session("R", started=at), {}, segment_ns=10**9, signer=load_signer(key))
    writer = FlightWriter(plan, status=CameraStatus("connected"), at=at)
    for number, frame in enumerate(frames[:2]):
        writer.write_frame(frame, ClockReading(10**18 + number * 10**9, number * 10**9))
    return writer.finish("stopped", at)


def public(key: Path) -> bytes:
    """The public half of a key."""
    return load_public_key(key.with_name(key.name + ".pub"))


def test_signed_flight_fits_its_key(signed: list[Path], key: Path) -> None:
    """With the key, and without: then it is said who signed."""
    assert checked(*signed, public_key=public(key)).verdict is Verdict.FITS
    assert [segment.signed_by for segment in checked(*signed).segments] == [public(key)] * 2


def test_perfect_forgery_needs_the_key(signed: list[Path], key: Path) -> None:
    """Who recomputes the whole chain leaves no trace but one: the signature."""
    forge(signed[1], lambda forgery: (forgery.edit_record(1, zoom_position=9.0), forgery.chain_anew()))
    found = fault(*signed, public_key=public(key))
    signature_path(signed[1]).unlink()

    assert (found.kind, found.path) == (FindingKind.WRONG_SIGNATURE, signed[1])
    assert checked(*signed).verdict is Verdict.FITS
    assert fault(*signed, public_key=public(key)).kind is FindingKind.NOT_SIGNED


def test_signing_again_with_another_key_is_found(signed: list[Path], key: Path, tmp_path: Path) -> None:
    """The forger's own signature fits, but it is not the box's."""
    make_key_files(tmp_path / "forger.key")
    for path in signed:
        write_signature(path, open_flight([path]).sha256_of_files()[path], load_signer(tmp_path / "forger.key"))

    assert checked(*signed).verdict is Verdict.FITS
    assert fault(*signed, public_key=public(key)).kind is FindingKind.OTHER_KEY


def test_damaged_signature_is_found(signed: list[Path]) -> None:
    """A signature's file is whole and names the key that made it, or it is none."""
    path = signature_path(signed[0])
    text = path.read_bytes()
    for changed in (b"", text[:-9], text.replace(b"sha256 ", b"sha256 0", 1), text.replace(b"=\nsig", b"\nsig")):
        path.write_bytes(changed)
        assert fault(*signed).kind is FindingKind.WRONG_SIGNATURE
    key = text.split()[6]
    path.write_bytes(text.replace(key, b"A" * 43 + b"="))

    assert fault(*signed).reason == "its signature was not made with the key that it names"


def test_recovered_segment_can_be_signed(signed: list[Path], key: Path) -> None:
    """Whoever recovers signs what was recovered."""
    part = signed[1].with_name(signed[1].name + ".part")
    part.write_bytes(signed[1].read_bytes()[:-200])
    signed[1].unlink()
    recovery = recover_segment(part, at=AT, signer=load_signer(key))

    assert checked(signed[0], recovery.path, public_key=public(key)).verdict is Verdict.LOSS
    signature = read_signature(recovery.path)
    assert signature is not None
    assert is_genuine(signature)


def test_key_is_private_and_never_replaced(key: Path) -> None:
    """Only its owner may read it, and a second key of the name is refused."""
    before = key.read_bytes()

    assert key.stat().st_mode & 0o777 == 0o600
    with pytest.raises(KeyFileError, match="never replaced"):
        make_key_files(key)
    assert key.read_bytes() == before


def test_what_is_no_key_is_one_sentence(key: Path, tmp_path: Path) -> None:
    """The wrong file, no file, the wrong half."""
    (tmp_path / "text").write_text("hello")
    for load, path in (
        (load_signer, tmp_path / "text"),
        (load_signer, tmp_path / "none"),
        (load_signer, key.with_name(key.name + ".pub")),
        (load_public_key, key),
        (load_public_key, tmp_path / "text"),
    ):
        with pytest.raises(KeyFileError, match=r"\.$") as caught:
            load(path)
        assert "\n" not in str(caught.value)

"""Changes of a flight are detected: what was changed, and the first frame that shows it."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from mcap.records import Attachment

from flight_file.errors import Finding, FindingKind, FlightNotReadableError, KeyFileError, MixedFlightsError
from flight_file.files import DurableFile
from flight_file.flight_writer import FlightWriter, Plan
from flight_file.frame import CameraStatus, ClockReading, Frame
from flight_file.reader import open_flight
from flight_file.salvage import recover_segment
from flight_file.session import Session
from flight_file.signature import Signer, load_public_key, load_signer, make_key_files, signature_path
from flight_file.verification import RecordingCheck, Verdict, verify
from tests.flight_file.flights import after, flipped, make_frame, write_flight
from tests.flight_file.forging import Taken, flip, forge

AT = ClockReading(1_800_000_000_000_000_000, 7)


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
def segments(tmp_path: Path, frames: list[Frame]) -> list[Path]:
    """Three segments of two frames each."""
    folder = tmp_path / "segments"
    folder.mkdir()
    return write_flight(folder, frames, frames_per_segment=2)


def test_untouched_flights_fit(segments: list[Path], tmp_path: Path, frames: list[Frame]) -> None:
    """Given together, each for itself; also one that was taken apart and put together without a change."""
    (other,) = write_flight(tmp_path, frames, recording="other")
    forge(other, lambda _taken: None)

    assert [(check.recording, check.verdict, check.findings) for check in verify([*segments, other])] == [
        ("flight", Verdict.FITS, ()),
        ("other", Verdict.FITS, ()),
    ]


def other_byte(taken: Taken, frames: list[Frame]) -> None:
    """One byte of a JPEG, every CRC in order."""
    _, _, picture = taken.frame(3)
    picture.data = flipped(picture.data, 8 * picture.data.index(frames[3].encoded))


def swapped(taken: Taken, _frames: list[Frame]) -> None:
    """Two frames change places."""
    (one, *_), (two, *_) = taken.frame(2), taken.frame(3)
    one[:], two[:] = two[:], one[:]


def put_in_twice(taken: Taken, _frames: list[Frame]) -> None:
    """A copy of an earlier frame where it does not belong."""
    (copied, *_), (behind, *_) = taken.frame(1), taken.frame(4)
    taken.steps.insert(taken.steps.index(behind), copied)


def other_panel(taken: Taken, _frames: list[Frame]) -> None:
    """Another panel decides what is read; its digest and CRC are in order."""
    panel = next(step for step in taken.steps if isinstance(step, Attachment) and step.name == "panel.yaml")
    panel.data = b"name: F-17\n"
    taken.seal("attachments", **{"panel.yaml": hashlib.sha256(panel.data).hexdigest()})


def count_kept(taken: Taken, _frames: list[Frame]) -> None:
    """The last frame is removed, the end record knows of it."""
    taken.remove(5)
    taken.seal("end", frames="6")


def record(**members: Any) -> Callable[[Taken, object], None]:  # noqa: ANN401 - JSON
    """Something else in a frame's record."""
    return lambda taken, _frames: taken.edit_record(2, **members)


CHANGES: dict[str, tuple[Callable[[Taken, list[Frame]], object], FindingKind, int | None, str]] = {
    "a byte of a picture": (other_byte, FindingKind.CHANGED_PICTURE, 3, ""),
    "a picture with its digest": (
        lambda taken, frames: taken.exchange_picture(3, frames[0].encoded),
        FindingKind.CHANGED_RECORD,
        3,
        "",
    ),
    "EXIF": (record(exif={"focal_length_mm": 9.9}), FindingKind.CHANGED_RECORD, 2, ""),
    "zoom": (record(zoom_position=50.0), FindingKind.CHANGED_RECORD, 2, ""),
    "times": (record(times={}), FindingKind.CHANGED_RECORD, 2, ""),
    "size": (record(size_bytes=1), FindingKind.CHANGED_RECORD, 2, ""),
    "the first frame": (lambda taken, _: taken.remove(0), FindingKind.CHANGED_RECORD, 1, ""),
    "the second": (lambda taken, _: taken.remove(1), FindingKind.REMOVED, 2, "frame 1 was removed before it"),
    "the last but one": (lambda taken, _: taken.remove(4), FindingKind.REMOVED, 5, "frame 4 was removed before it"),
    "the last": (lambda taken, _: taken.remove(5), FindingKind.CHANGED_SEGMENT, None, ""),
    "the last, but not its count": (count_kept, FindingKind.REMOVED, 5, ""),
    "two swapped": (swapped, FindingKind.REORDERED, 3, "it stands before frame 2"),
    "one put in twice": (put_in_twice, FindingKind.REORDERED, 1, ""),
    "the panel": (other_panel, FindingKind.CHANGED_RECORD, 0, ""),
    "the chain taken out of records": (lambda taken, _: taken.strip_chain(), FindingKind.CHANGED_RECORD, 0, ""),
    "the end record": (lambda taken, _: taken.metadata("end").metadata.clear(), FindingKind.CHANGED_SEGMENT, None, ""),
}


@pytest.mark.parametrize("name", CHANGES)
def test_change_is_found_at_its_frame(flight: Path, frames: list[Frame], name: str) -> None:
    """Every CRC is in order: the first frame that does not fit is named, with its time where it can be read."""
    change, kind, sequence, reason = CHANGES[name]
    forge(flight, lambda taken: change(taken, frames))
    found = fault(flight)

    assert (found.kind, found.path, found.sequence) == (kind, flight, sequence)
    assert found.reason.startswith(reason)
    assert sequence is None or found.captured_ns in (None, frames[sequence].captured_ns)


def test_dropped_frame_is_told_from_a_removed_one(tmp_path: Path, frames: list[Frame]) -> None:
    """A frame that the recorder never stored is a gap in the numbers, but none in the chain."""
    check = checked(*write_flight(tmp_path, [*frames[:2], *frames[4:]]))

    assert check.verdict is Verdict.FITS
    assert [(finding.kind, finding.sequence) for finding in check.findings] == [(FindingKind.DROPPED, 4)]
    assert check.findings[0].reason.startswith("frames 2 to 3 were never stored")


@pytest.mark.parametrize("given", [[1, 2], [0, 2], [0, 1], [2]])
def test_missing_segment_is_a_loss_and_no_fault(segments: list[Path], given: list[int]) -> None:
    """A segment that was not given is named; those that are there fit."""
    check = checked(*(segments[number] for number in given))

    assert check.verdict is Verdict.LOSS
    assert {finding.kind for finding in check.findings} == {FindingKind.MISSING_SEGMENT}


def last_frame_taken(segments: list[Path]) -> None:
    """From the middle, its chain made to fit: the next does not go on from it."""
    forge(segments[1], lambda taken: (taken.remove(3), taken.chain_anew()))


def middle_dropped(segments: list[Path]) -> None:
    """And the last one renumbered: its chain does not go on from the first."""
    forge(segments[2], lambda taken: taken.seal("session", segment="1"))
    segments.pop().replace(segments[1])


def names_swapped(segments: list[Path]) -> None:
    """Two segments change their names."""
    aside = segments[1].rename(segments[1].with_name("aside"))
    segments[2].rename(segments[1])
    aside.rename(segments[2])


def middle_as_an_old_one(segments: list[Path]) -> None:
    """One segment of a recording passes as written before there were chains."""
    forge(segments[1], without_chain)


def another_beginning(segments: list[Path]) -> None:
    """The chain begins with the recording's name, start and machine: these cannot be changed alone."""
    forge(segments[0], lambda taken: taken.seal("session", host="another box"))


def segment_of_another_recording(segments: list[Path]) -> None:
    """Under the name of a segment of ours lies one of another flight."""
    forge(segments[1], lambda taken: taken.seal("session", recording="other"))


SEGMENT_CHANGES: dict[Callable[[list[Path]], None], tuple[FindingKind, int, str]] = {
    last_frame_taken: (FindingKind.CHANGED_SEGMENT, 2, "it does not begin where the segment before it ends"),
    middle_dropped: (FindingKind.CHANGED_SEGMENT, 1, "it does not begin where the segment before it ends"),
    names_swapped: (FindingKind.CHANGED_SEGMENT, 1, "it is segment 2 under the name of segment 1"),
    middle_as_an_old_one: (FindingKind.CHANGED_SEGMENT, 1, ""),
    another_beginning: (FindingKind.CHANGED_RECORD, 0, ""),
    segment_of_another_recording: (FindingKind.OTHER_RECORDING, 1, "it is a segment of the recording other, not of"),
}


@pytest.mark.parametrize("change", SEGMENT_CHANGES, ids=lambda change: change.__name__)
def test_changed_segment_is_found(segments: list[Path], change: Callable[[list[Path]], None]) -> None:
    """It is named, and told from one that is missing."""
    kind, number, reason = SEGMENT_CHANGES[change]
    change(segments)
    check = checked(*segments)

    assert check.verdict is Verdict.FAULT
    assert [
        finding
        for finding in check.findings
        if (finding.kind, finding.path) == (kind, segments[number]) and finding.reason.startswith(reason)
    ]


def test_segment_given_twice_is_one_sentence(segments: list[Path], tmp_path: Path) -> None:
    """A copy under another name is a mistake of who asks."""
    shutil.copyfile(segments[0], tmp_path / "copy.mcap")
    segments[0].rename(tmp_path / "flight.mcap")

    with pytest.raises(MixedFlightsError, match=r"both segment 0; give one of them\.$"):
        verify([tmp_path / "copy.mcap", tmp_path / "flight.mcap"])


def without_chain(taken: Taken) -> None:
    """As a recorder wrote it before there were chains."""
    taken.strip_chain()
    for name in ("session", "end"):
        taken.metadata(name).metadata.pop("chain")
        taken.seal(name)


def test_flight_without_a_chain_says_so(frames: list[Frame], flight: Path) -> None:
    """An old file is read and checked as far as it goes."""
    forge(flight, without_chain)
    check = checked(flight)

    assert list(open_flight([flight]).frames()) == frames
    assert check.verdict is Verdict.LOSS
    assert [finding.kind for finding in check.findings] == [FindingKind.NO_CHAIN]


def test_cut_file_fits_as_far_as_it_goes(flight: Path) -> None:
    """What a power cut left fits up to the cut, before and after it was recovered; unsigned it proves nothing."""
    part = flight.with_name(flight.name + ".part")
    part.write_bytes(flight.read_bytes()[: flight.stat().st_size // 2 + 1500])
    flight.unlink()
    before = checked(part)
    after = checked(recover_segment(part, at=AT).path)

    assert before.verdict is after.verdict is Verdict.LOSS
    assert {finding.kind for finding in before.findings} == {FindingKind.CUT, FindingKind.UNPROVEN}
    assert {finding.kind for finding in after.findings} == {FindingKind.CUT}
    assert before.segments[0].frames == after.segments[0].frames > 0


def test_hole_that_a_recovery_declares_is_a_loss(flight: Path, frames: list[Frame]) -> None:
    """What a recovery found damaged is a loss where it says so; a frame removed elsewhere is still found."""
    flip(flight, frames[2].encoded)
    recovered = recover_segment(flight, at=AT).path
    damaged, check = fault(flight), checked(recovered)
    forge(recovered, lambda taken: taken.remove(4))

    assert (damaged.kind, damaged.sequence) == (FindingKind.DAMAGED, 2)
    assert check.verdict is Verdict.LOSS
    assert (FindingKind.RECOVERED, 3) in [(finding.kind, finding.sequence) for finding in check.findings]
    assert (fault(recovered).kind, fault(recovered).sequence) == (FindingKind.REMOVED, 5)


def test_flight_that_goes_on_after_a_cut_segment_fits(tmp_path: Path, frames: list[Frame]) -> None:
    """A recorder that lost its disk goes on with the next segment and the chain: what was lost between is a loss."""
    plan = Plan(tmp_path, Session("R", started=after(0)), {})
    writer = FlightWriter(plan, status=CameraStatus("connected"), at=after(0))
    writer.write_frame(frames[0], after(2))
    writer.write_frame(frames[1], after(0))
    writer.abandon()
    on = replace(plan, session=replace(plan.session, segment=1, chain=writer.chain))
    second = FlightWriter(on, status=CameraStatus("connected"), at=after(0))
    second.write_frame(frames[2], after(0))
    second.finish("stopped", after(0))
    first = recover_segment(tmp_path / "R_0000.mcap.part", at=AT).path
    check = checked(first, tmp_path / "R_0001.mcap")

    assert check.verdict is Verdict.LOSS
    assert [finding.kind for finding in check.findings] == [FindingKind.CUT, FindingKind.RECOVERED]


@pytest.mark.untraced
def test_any_changed_byte_is_noticed(tmp_path: Path) -> None:
    """Wherever in a finished file a byte changes, even in its index: it does not pass as untouched."""
    (path,) = write_flight(tmp_path, [make_frame(number, 60) for number in range(2)], attachments={"a": b"attached"})
    data = path.read_bytes()
    for offset in range(8, len(data), 23):
        path.write_bytes(flipped(data, 8 * offset + offset % 8))

        assert checked(path).verdict is not Verdict.FITS


@pytest.fixture
def signed(tmp_path: Path, frames: list[Frame], signer: Signer) -> list[Path]:
    """Two signed segments, of a frame each."""
    return write_flight(tmp_path, frames[:2], frames_per_segment=1, signer=signer)


def test_key_is_private_and_what_is_none_is_one_sentence(tmp_path: Path) -> None:
    """Only its owner may read it, and a second key of that name is refused; so are wrong files and the wrong half."""
    key = tmp_path / "key"
    make_key_files(key)
    (tmp_path / "text").write_text("hello")
    before = key.read_bytes()

    assert key.stat().st_mode & 0o777 == 0o600
    with pytest.raises(KeyFileError, match="never replaced"):
        make_key_files(key)
    assert key.read_bytes() == before
    for load, name in (
        *((load_signer, name) for name in ("text", "none", "key.pub")),
        *((load_public_key, name) for name in ("text", "key")),
    ):
        with pytest.raises(KeyFileError, match=r"^[^\n]*\.$"):
            load(tmp_path / name)


def test_kill_between_any_two_steps_leaves_no_fault(
    tmp_path: Path, frames: list[Frame], signer: Signer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before each write and renaming: what lies there is cut off, never accused, nor is what is made of it."""
    flight, left = tmp_path / "flight", list[Path]()
    flight.mkdir()
    for owner, name in [(DurableFile, "write"), (Path, "rename"), (Path, "replace")]:
        monkeypatch.setattr(owner, name, photographed(getattr(owner, name), flight, left))
    write_flight(flight, frames[:2], attachments={"a": b"a"}, frames_per_segment=1, signer=signer)
    monkeypatch.undo()
    assert len(left) > 40
    for directory in left:
        before = verify(segments_in(directory), public_key=signer.public_key)
        for part in directory.glob("*.part"):
            recover_segment(part, at=AT, signer=signer)
        after_recovery = verify(segments_in(directory), public_key=signer.public_key)

        assert not list(directory.glob("*.part"))
        assert Verdict.FAULT not in {check.verdict for check in (*before, *after_recovery)}


def photographed(step: Callable[..., Any], folder: Path, left: list[Path]) -> Callable[..., Any]:
    """A step before which the folder is copied, as a kill would leave it."""

    def snap(*arguments: Any) -> Any:  # noqa: ANN401
        left.append(folder.with_name(f"left{len(left):03}"))
        shutil.copytree(folder, left[-1])
        return step(*arguments)

    return snap


def segments_in(directory: Path) -> list[Path]:
    """Finished ones and the one in work."""
    return sorted(path for path in directory.iterdir() if path.suffix in (".mcap", ".part"))


def test_signature_that_is_no_file_is_one_sentence(signed: list[Path]) -> None:
    """A pipe would be waited for for ever."""
    signature_path(signed[0]).unlink()
    os.mkfifo(signature_path(signed[0]))

    with pytest.raises(FlightNotReadableError, match="it is no regular file"):
        verify(signed)


def test_signature_of_a_recovery_that_was_cut_off_accuses_nobody(signed: list[Path], signer: Signer) -> None:
    """It lies where that of the file in work would, and is of other bytes; so is whatever somebody puts there."""
    part = signed[1].rename(signed[1].with_name(signed[1].name + ".part"))
    for text in (signature_path(signed[0]).read_bytes(), b"no signature\n"):
        signature_path(signed[1]).write_bytes(text)
        check = checked(signed[0], part, public_key=signer.public_key)

        assert check.verdict is Verdict.LOSS
        assert check.segments[1].proven_frames == 1
    recovery = recover_segment(part, at=AT, signer=signer)

    assert recovery.signed

"""A flight file taken apart: what a forger with all our code but not the key can change before putting it together."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from mcap.records import Attachment, Chunk, Message, Metadata
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, Writer

from flight_file.files import DurableFile
from flight_file.messages import decode_frame, encode_image
from flight_file.session import link, opened_frame, sealed, sealed_frame
from flight_file.writer import registered_topics
from tests.flight_file.flights import flipped

Step = Attachment | Metadata | list[Message]
IMAGE_CHANNEL, FRAME_CHANNEL = 1, 2


@dataclass
class Taken:
    """A segment taken apart: metadata records, attachments and chunks, in the order of the file."""

    path: Path
    steps: list[Step] = field(default_factory=list)

    @classmethod
    def of(cls, path: Path) -> Taken:
        """Take a file apart with the MCAP project's own reader."""
        taken = cls(path)
        with path.open("rb") as file:
            for record in StreamReader(file, emit_chunks=True).records:
                if isinstance(record, Chunk):
                    taken.steps.append([item for item in breakup_chunk(record) if isinstance(item, Message)])
                elif isinstance(record, (Attachment, Metadata)):
                    taken.steps.append(record)
        return taken

    def metadata(self, name: str) -> Metadata:
        """The record of that name."""
        return next(step for step in self.steps if isinstance(step, Metadata) and step.name == name)

    def seal(self, name: str, **items: str) -> None:
        """Change items of a metadata record, and the digest that it carries of itself."""
        record = self.metadata(name)
        kept = {key: value for key, value in record.metadata.items() if key != "sha256"}
        record.metadata = sealed(kept | items)

    def drop(self, *names: str) -> None:
        """Take all metadata records of these names out."""
        self.steps = [step for step in self.steps if not (isinstance(step, Metadata) and step.name in names)]

    def frames(self) -> Iterator[tuple[list[Message], Message, Message]]:
        """Each frame's chunk, record and picture."""
        for step in self.steps:
            if isinstance(step, list):
                records = [message for message in step if message.channel_id == FRAME_CHANNEL]
                pictures = [message for message in step if message.channel_id == IMAGE_CHANNEL]
                yield from ((step, *pair) for pair in zip(records, pictures, strict=True))

    def frame(self, sequence: int) -> tuple[list[Message], Message, Message]:
        """A frame's chunk, record and picture."""
        return next(found for found in self.frames() if found[1].sequence == sequence)

    def edit_record(self, sequence: int, **members: Any) -> None:  # noqa: ANN401 - JSON
        """Another record for a frame, with the value in the chain that it had."""
        _, record, _ = self.frame(sequence)
        document = json.loads(record.data)
        chain = document.pop("chain")
        record.data = json.dumps({**document, **members, "chain": chain}, separators=(",", ":")).encode()

    def strip_chain(self) -> None:
        """Take the values of the chain out of the frames' records."""
        for _, record, _ in self.frames():
            record.data = opened_frame(record.data)[0] + b"}"

    def remove(self, *sequences: int) -> None:
        """Take frames out, and count them out of the end record."""
        for sequence in sequences:
            chunk, record, picture = self.frame(sequence)
            chunk[:] = [message for message in chunk if message is not record and message is not picture]
        self.seal("end", frames=str(len(list(self.frames()))))

    def exchange_picture(self, index: int, jpeg: bytes) -> None:
        """Another picture in a frame, with the digest and size of it."""
        _, record, picture = list(self.frames())[index]
        document = json.loads(opened_frame(record.data)[0] + b"}")
        document |= {"sha256": hashlib.sha256(jpeg).hexdigest(), "size_bytes": len(jpeg)}
        record.data = json.dumps(document, separators=(",", ":")).encode()
        frame = replace(decode_frame(memoryview(record.data)), encoded=jpeg)
        picture.data = encode_image(frame)

    def chain_anew(self) -> None:
        """A chain that fits, from the value that the session goes on from."""
        session, attachments = self.metadata("session").metadata, self.metadata("attachments").metadata
        value = link(session["chain"], (session["sha256"] + attachments["sha256"]).encode())
        for _, record, _ in self.frames():
            content = opened_frame(record.data)[0].removesuffix(b"}")
            record.data, value = sealed_frame(content + b"}", value)
        if any(isinstance(step, Metadata) and step.name == "end" for step in self.steps):
            self.seal("end", chain=value)

    def write(self, *, finished: bool = True, more: Callable[[Writer], object] = lambda _writer: None) -> None:
        """Put it together under its name; its signature stays as it is.

        Parameters
        ----------
        more
            What else is done to the writer, before the end record.
        """
        self.path.unlink(missing_ok=True)
        file = DurableFile(self.path)
        writer = Writer(file, chunk_size=2**62, compression=CompressionType.NONE, enable_data_crcs=True)  # type: ignore[arg-type]
        writer.start("flight", "forged")
        registered_topics(writer)
        for step in self.steps:
            if isinstance(step, Metadata) and step.name == "end":
                more(writer)
            if isinstance(step, Metadata):
                writer.add_metadata(step.name, step.metadata)
            elif isinstance(step, Attachment):
                writer.add_attachment(step.create_time, step.log_time, step.name, step.media_type, step.data)
            else:
                for message in step:
                    add_message(writer, message)
                writer.flush()  # type: ignore[no-untyped-call]
        if finished:
            writer.finish()  # type: ignore[no-untyped-call]
        file.close()


def add_message(writer: Writer, message: Message) -> None:
    """Write a message as it was read."""
    writer.add_message(message.channel_id, message.log_time, message.data, message.publish_time, message.sequence)


def flip(path: Path, content: bytes) -> None:
    """Change a bit where a file holds this, as a bad disk does."""
    data = path.read_bytes()
    path.write_bytes(flipped(data, data.index(content) * 8))


def forge(path: Path, change: Callable[[Taken], object]) -> None:
    """Change a flight file in place."""
    taken = Taken.of(path)
    change(taken)
    taken.write()

"""Sound beside the pictures: the messages of `/sound/peaks` and `/sound/packet`, encoded and playable."""

from __future__ import annotations

import binascii
from typing import Annotated

import msgspec

from flight_file.frame import Sound, SoundPacket, SoundPeaks
from flight_file.messages import (
    PACKET_TOPIC,
    PEAKS_TOPIC,
    MalformedMessageError,
    Moment,
    Whole,
    json_bytes,
    to_json,
)

_AUDIO_SPECIFIC_BYTES = 2
_HEAD_BYTES = 7
_Frequencies = Annotated[tuple[Annotated[float, msgspec.Meta(ge=0, le=1e6)], ...], msgspec.Meta(max_length=1000)]
_Levels = Annotated[tuple[Annotated[float, msgspec.Meta(ge=-1e4, le=1e4)], ...], msgspec.Meta(max_length=1000)]


class _PeaksRecord(msgspec.Struct, frozen=True):
    """The JSON record of a window's peaks."""

    time: Moment
    window_s: Annotated[float, msgspec.Meta(gt=0, le=60)]
    frequencies_hz: _Frequencies
    levels_db: _Levels
    above_db: _Levels


class _PacketRecord(msgspec.Struct, frozen=True):
    """The JSON record of a packet of sound."""

    time: Moment
    codec: str
    sample_rate_hz: Whole
    channels: Whole
    data: str
    header: str = ""


_PEAKS_RECORD = msgspec.json.Decoder(_PeaksRecord)


_PACKET_RECORD = msgspec.json.Decoder(_PacketRecord)


def sound_topic(sound: Sound) -> str:
    """Return its topic."""
    return PEAKS_TOPIC if isinstance(sound, SoundPeaks) else PACKET_TOPIC


def encode_sound(sound: Sound) -> bytes:
    """Encode sound as JSON, without the frame that it was stored with."""
    if isinstance(sound, SoundPeaks):
        return json_bytes(
            {
                "time": to_json(sound.time_ns),
                "window_s": sound.window_s,
                "frequencies_hz": sound.frequencies_hz,
                "levels_db": sound.levels_db,
                "above_db": sound.above_db,
            }
        )
    return json_bytes(
        {
            "time": to_json(sound.time_ns),
            "codec": sound.codec,
            "sample_rate_hz": sound.sample_rate_hz,
            "channels": sound.channels,
            "header": _base64(sound.header) or None,
            "data": _base64(sound.encoded),
        }
    )


def decode_sound(data: memoryview, topic: str) -> Sound:
    """Decode what `encode_sound` encodes; raises MalformedMessageError."""
    try:
        return _peaks(data) if topic == PEAKS_TOPIC else _packet(data)
    except (ValueError, RecursionError) as error:
        raise MalformedMessageError(f"a message of {topic} is not what it promises") from error


def _peaks(data: memoryview) -> SoundPeaks:
    record = _PEAKS_RECORD.decode(data)
    if record.time.sec < 0 or not len(record.frequencies_hz) == len(record.levels_db) == len(record.above_db):
        raise ValueError("it has a time before 1970, or more of one than of another")
    return SoundPeaks(record.time.time_ns, record.window_s, record.frequencies_hz, record.levels_db, record.above_db)


def _packet(data: memoryview) -> SoundPacket:
    record = _PACKET_RECORD.decode(data)
    if record.time.sec < 0:
        raise ValueError("it has a time before 1970")
    header, encoded = (binascii.a2b_base64(text, strict_mode=True) for text in (record.header, record.data))
    return SoundPacket(record.time.time_ns, record.codec, record.sample_rate_hz, record.channels, header, encoded)


def _base64(content: bytes) -> str:
    return binascii.b2a_base64(content, newline=False).decode()


def playable(packet: SoundPacket) -> bytes:
    """Prepend the header that players need in a stream of packets: ADTS for AAC, nothing for others.

    Source: ISO/IEC 14496-3, 1.6.2.1 and 1.A.3.2.
    """
    if packet.codec != "aac" or len(packet.header) < _AUDIO_SPECIFIC_BYTES:
        return packet.encoded
    kind, rate, channels = (
        packet.header[0] >> 3,
        (packet.header[0] & 7) << 1 | packet.header[1] >> 7,
        packet.header[1] >> 3 & 15,
    )
    size = len(packet.encoded) + _HEAD_BYTES
    bits = 0xFFF1 << 40 | (kind - 1 & 3) << 38 | rate << 34 | channels << 30 | size << 13 | 0x7FF << 2
    return bits.to_bytes(_HEAD_BYTES, "big") + packet.encoded

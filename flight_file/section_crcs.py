"""The two CRCs that MCAP keeps over what no chunk's CRC covers: the data section's, and the index's at the end."""

from __future__ import annotations

import struct

from isal.isal_zlib import crc32

from flight_file.chunks import ByteSource
from flight_file.records import FOOTER_BYTES, MAGIC, RECORD_HEADER, Opcode

_FOOTER = struct.Struct("<BQQQI")  # opcode, length, start of the index, start of its offsets, CRC
_DATA_END = struct.Struct("<BQI")
_BLOCK_BYTES = 1 << 20


def unfitting_section(source: ByteSource) -> str | None:
    """What of a finished file does not fit its CRC, in words; None if all fits. A CRC of 0 means that there is none.

    Raises
    ------
    OSError
        If the disk fails.
    """
    footer = source.size - FOOTER_BYTES - len(MAGIC)
    opcode, length, start, _, index_crc = _FOOTER.unpack(source.read_at(footer, _FOOTER.size))
    if opcode != Opcode.FOOTER or length != FOOTER_BYTES - RECORD_HEADER.size:
        return "its last record is no footer"
    end_of_data = (start or footer) - _DATA_END.size
    if not len(MAGIC) <= end_of_data <= footer - _DATA_END.size:
        return "its footer points outside of the file"
    opcode, length, data_crc = _DATA_END.unpack(source.read_at(end_of_data, _DATA_END.size))
    if opcode != Opcode.DATA_END or length != _DATA_END.size - RECORD_HEADER.size:
        return "its footer does not point to the index"
    if data_crc and _crc(source, 0, end_of_data) != data_crc:
        return "bytes outside of the chunks do not fit their CRC"
    if index_crc and _crc(source, end_of_data + _DATA_END.size, footer + _FOOTER.size - 4) != index_crc:
        return "the index at its end does not fit its CRC"
    return None


def _crc(source: ByteSource, start: int, end: int) -> int:
    crc = 0
    for offset in range(start, end, _BLOCK_BYTES):
        crc = crc32(source.read_at(offset, min(_BLOCK_BYTES, end - offset)), crc)
    return crc

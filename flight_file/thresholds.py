"""All limits of this package.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| MAX_READ_BYTES | 60 | MiB | largest file read whole, largest picture stored | its chunk has 4 MiB for all else |
| BLOCK_BYTES | 1 | MiB | read at once of a larger one | bounds the memory |
| MAX_SMALL_BYTES | 4 | KiB | a key, a signature, a summary record; a known head | each has a few hundred bytes |
| MAX_NAME_BYTES | 120 | - | a file name from outside | file systems allow 255 |
| MAX_SHOWN_CHARACTERS | 120 | - | shown of a problem | a sentence |
| MAX_YAML_BYTES | 1 | MiB | a YAML document | ours have 2 to 5 KB |
| MAX_YAML_DEPTH | 32 | - | its nesting, levels | no panel or camera is nearly as deep |
| MAX_YAML_VALUES | 100 000 | - | its values, aliases written out | the same |
| MAX_YAML_DIGITS | 64 | - | its longest number, characters | a double needs 24 |
| MAX_PIXELS | 67.1 million | px | a picture, 4 bytes each in a PNG | 0.6 GB in colour; a QX10 has 18 |
| MAX_SIDE_PX | 32 766 | px | its sides | OpenCV needs fewer than 32 767 |
| JPEG_PIXELS_PER_BYTE | 96 | px | most pixels of a JPEG per byte | an all-grey one has 85, a cockpit 40 |
| PNG_PIXELS_PER_BYTE | 256 | px | most pixels of a PNG per byte | a drawing has some hundred |
| PIXELS_ALWAYS_TRIED | 65 536 | px | fewer are not compared with the bytes | a small file is mostly headers |
| MAX_SCANS | 20 | - | of a progressive JPEG | usual are ten, each over the whole picture |
| FOCAL_LENGTHS_MM | 0.1, 10 000 | mm | shortest and longest lens | an endoscope's, an observatory's |
| MAX_RECORD_BYTES | 80 | MiB | an MCAP record; all attachments and metadata of a file | a chunk, what a box attaches |
| MAX_CHUNK_BYTES | 64 | MiB | a chunk, uncompressed | other writers end theirs at 4 MiB |
| MAX_RECORDS | 150 000 | - | in a chunk; also outside, and one a KiB | more than other writers' 4 MiB can hold |
| GROWTH | 1.5 | - | all chunks unpacked, relative to the file | pictures do not shrink |
| FREE_GROWTH_BYTES | 0.5 | MiB | in addition | a small file is mostly headers |
| MAX_UNPAIRED | 20 | - | half frames reported | the others are counted |
| CHUNK_BYTES | 64 | KiB | our writer ends a chunk here | a large picture or a few small ones |
| SYNC_NS | 1 | s | when our writer syncs | a power cut costs two seconds |
| SYNC_BYTES | 8 | MiB | or when so much waits | is kept for writing it again |
| EMPTY_SEGMENT_NS | 1 | h | a segment without a picture ends | a day's wait is 24 files, not 1 440 |
"""

from __future__ import annotations

MAX_READ_BYTES = 60 * 2**20
BLOCK_BYTES = 2**20
MAX_SMALL_BYTES = 4096
MAX_NAME_BYTES = 120
MAX_SHOWN_CHARACTERS = 120
MAX_YAML_BYTES = 2**20
MAX_YAML_DEPTH = 32
MAX_YAML_VALUES = 100_000
MAX_YAML_DIGITS = 64
MAX_PIXELS = 2**26
MAX_SIDE_PX = 32_766
JPEG_PIXELS_PER_BYTE = 96
PNG_PIXELS_PER_BYTE = 256
PIXELS_ALWAYS_TRIED = 2**16
MAX_SCANS = 20
FOCAL_LENGTHS_MM = (0.1, 10_000.0)
MAX_RECORD_BYTES = 80 * 2**20
MAX_CHUNK_BYTES = 2**26
MAX_RECORDS = 150_000
GROWTH = 1.5
FREE_GROWTH_BYTES = 2**19
MAX_UNPAIRED = 20
CHUNK_BYTES = 64 * 2**10
SYNC_NS = 10**9
SYNC_BYTES = 8 * 2**20
EMPTY_SEGMENT_NS = 3600 * 10**9

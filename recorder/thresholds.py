"""All limits and waiting times of this package that recorder.yaml does not set.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| QUEUE_BYTES | 20 | MiB | JPEGs waiting for the disk | four of 18 megapixels: a small board |
| QUEUE_FRAMES | 64 | - | pictures waiting, or used for the rate | with more the disk is too slow |
| WAITING_LINES | 200 | - | camera notices, log lines waiting | the rest is counted |
| ATTACHMENTS_BYTES | 64 | MiB | all attachments together | every segment carries them |
| MARK_BYTES | 64 | KiB | a mark | hundreds of notes |
| SHOWN_ERRORS | 3 | - | wrong values named at once | a sentence holds no more |
| SHOWN_CHARACTERS | 160 | - | of a message, a value or a key | the same |
| CLOCKS_TOGETHER_NS | 1 | ms | two clocks read at one moment | if longer, another thread ran in between |
| CLOCK_JUMP_NS | 20 | ms | the clock was set, not read late | a busy machine reads slowly |
| CLOCK_SLEWING | 0.001 | - | of the time passed: not slewed either | twice the kernel's limit of 0.05 % |
| LOOK_S | 0.25 | s | how often a wait checks for its end | stopping may take five seconds |
| TICK_S | 1 | s | how often periodic work is checked | as often as the writer syncs |
| SAY_S | 2 | s | how often a wait gives a sign of life | a tenth of `SILENCE_S` |
| SILENCE_S | 20 | s | without a sign of life: it hangs; most that a picture counts | longer than one slow sync |
| FIRST_WORD_S | 5 | s | wait for the camera's name | then the first segment goes without |
| PATIENCE_S | 3 | s | for a camera to react to a stop | leaves time for the last sync |
| END_S | 4.5 | s | for the recording to end | with LOOK_S less than five seconds |
| HEALTH_S | 10 | s | from one health report to the next | as docs/box.md says |
| READS_AT_ONCE | 5000 | - | segments, marks whose length is read | half a second of the writer's thread |
| LOOKS | 6 | - | of retention, after which a recording not in work has ended | one may fall between two segments |
| NAMED_AT_ONCE | 20 | - | unreadable files named in a log line | the others are counted |
| SALVAGE_AGAIN_S | 600 | s | a file is tried again after a full disk | retention frees space meanwhile |
| LONGER_S | 3600 | s | a segment is longer than `segment_s` | it was shortened, or the disk is slow |
| CAMERA_AGAIN_S | 1, 30 | s | first, longest wait to connect again | a camera is ready 30 s after power-on |
| UNUSABLE_AGAIN_S | 30, 120 | s | if a person must act | nobody is there to help |
| DISK_AGAIN_S | 1, 15 | s | for a disk that fails | used again soon after it is back |
"""

from __future__ import annotations

QUEUE_BYTES = 20 * 2**20
QUEUE_FRAMES = 64
WAITING_LINES = 200
ATTACHMENTS_BYTES = 64 * 2**20
MARK_BYTES = 64 * 2**10
SHOWN_ERRORS = 3
SHOWN_CHARACTERS = 160
CLOCKS_TOGETHER_NS = 1_000_000
CLOCK_JUMP_NS = 20_000_000
CLOCK_SLEWING = 0.001
LOOK_S = 0.25
TICK_S = 1.0
SAY_S = 2.0
SILENCE_S = 20.0
FIRST_WORD_S = 5.0
PATIENCE_S = 3.0
END_S = 4.5
HEALTH_S = 10.0
READS_AT_ONCE = 5_000
LOOKS = 6
NAMED_AT_ONCE = 20
SALVAGE_AGAIN_S = 600.0
LONGER_S = 3600.0
CAMERA_AGAIN_S = (1.0, 30.0)
UNUSABLE_AGAIN_S = (30.0, 120.0)
DISK_AGAIN_S = (1.0, 15.0)

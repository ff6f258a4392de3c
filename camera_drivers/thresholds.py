"""All limits and waiting times of the drivers; the simulated camera has its own.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| LOOK_S | 0.1 | s | how often a wait checks for a stop | a stop is noticed at once |
| AGAIN_S | 0.25 | s | how often a state, or news, is requested again | the camera takes longer to change |
| SAY_S | 1 | s | how often a wait is reported | the watchdog waits 20 s |
| CLOSE_S | 1 | s | for an aborted call or thread to end | then it is abandoned |
| REST_S | 1 | s | before a failed call is repeated | whatever the interval |
| NEWS_REST_S | 5 | s | after a failed request for news | nothing depends on news |
| MAX_FAILURES | 4 | - | useless answers in a row | then a new connection is made |
| MAX_SHOTS | 3 | - | tries at a shot while it is not ready | then it is reported |
| MAX_DOWNLOADS | 2 | - | of one picture | the same damage twice comes from the camera |
| MAX_ANSWER_BYTES | 1 | MiB | an answer, a liveview picture, a payload of telemetry | real ones have at most 14 kB |
| MAX_WAITING_PICTURES | 64 | - | pictures of a stream waiting | then the camera has to wait |
| REMEMBERED_PICTURES | 16 | - | addresses of pictures | so that none is reported twice |
| SEARCH_AGAIN_S | 2 | s | before a search is sent again | SSDP is lossy |
| MAX_DATAGRAM_BYTES | 2048 | - | an answer to a search | an Ethernet frame has 1500 |
| MAX_DATAGRAMS | 256 | - | read before the time is checked | however fast they arrive |
| MAX_DESCRIPTIONS | 32 | - | fetched at once | one thread each |
| CROWDED_S | 0.5 | s | for each of them, if others wait | a camera takes a tenth of it |
| MAX_KNOWN_URLS | 1024 | - | that were tried | a flood must not fill the memory |
| ZOOM_NEAR | 0.02 | - | of the focal length: near enough | a step is larger |
| ZOOM_MOVED_PERCENT | 2 | % | the lens was moved | the camera rounds its position |
| ZOOM_MAX_PICTURES | 12 | - | to reach a focal length | then the nearest is kept |
| ZOOM_MAX_STEPS | 60 | - | from one end to the other | steps are of two percent or more |
| ZOOM_STILL_LOOKS | 8 | - | checks that find the lens at rest | 0.8 s |
| ZOOM_MAX_TURNS | 2 | - | reversals across the goal | then the nearest is kept |
| MAX_PARTS | 256 | - | positions in a payload of telemetry, boxes in a row | 18, and about ten |
"""

from __future__ import annotations

LOOK_S = 0.1
AGAIN_S = 0.25
SAY_S = 1.0
CLOSE_S = 1.0
REST_S = 1.0
NEWS_REST_S = 5.0
MAX_FAILURES = 4
MAX_SHOTS = 3
MAX_DOWNLOADS = 2
MAX_ANSWER_BYTES = 2**20
MAX_WAITING_PICTURES = 64
REMEMBERED_PICTURES = 16
SEARCH_AGAIN_S = 2.0
MAX_DATAGRAM_BYTES = 2048
MAX_DATAGRAMS = 256
MAX_DESCRIPTIONS = 32
CROWDED_S = 0.5
MAX_KNOWN_URLS = 1024
ZOOM_NEAR = 0.02
ZOOM_MOVED_PERCENT = 2.0
ZOOM_MAX_PICTURES = 12
ZOOM_MAX_STEPS = 60
ZOOM_STILL_LOOKS = 8
ZOOM_MAX_TURNS = 2
MAX_PARTS = 256

"""Every number of the drivers that something is compared with or waits for; the simulated camera has its own habits.

| name | value | unit | meaning | source |
| --- | --- | --- | --- | --- |
| LOOK_S | 0.1 | s | how often a wait looks for a stop | a stop is noticed at once |
| AGAIN_S | 0.25 | s | how often a state, or news, is asked for again | the camera takes longer to change |
| SAY_S | 1 | s | how often a wait is reported | the watchdog waits 20 s |
| CLOSE_S | 1 | s | for an aborted call or thread to end | then it is left behind |
| REST_S | 1 | s | before a failed call is repeated | whatever the interval |
| NEWS_REST_S | 5 | s | after one that failed | nothing needs news |
| MAX_FAILURES | 4 | - | useless answers in a row | then the camera is connected again |
| MAX_SHOTS | 3 | - | tries at a shot while it is not ready | then it is reported |
| MAX_DOWNLOADS | 2 | - | of one picture | the same damage twice is the camera's |
| MAX_ANSWER_BYTES | 1 | MiB | an answer, a liveview picture, a payload of telemetry | real ones have at most 14 kB |
| MAX_WAITING_PICTURES | 64 | - | liveview pictures that wait | what came in one piece |
| REMEMBERED_PICTURES | 16 | - | addresses of pictures | none is found twice |
| SEARCH_AGAIN_S | 2 | s | before a search is sent again | SSDP is lossy |
| MAX_DATAGRAM_BYTES | 2048 | - | an answer to a search | an Ethernet frame has 1500 |
| MAX_DATAGRAMS | 256 | - | read before the time is looked at | however fast they come |
| MAX_DESCRIPTIONS | 32 | - | fetched at once | a thread each |
| CROWDED_S | 0.5 | s | for one of them, if others wait | a camera takes a tenth of it |
| MAX_KNOWN_URLS | 1024 | - | that were asked once | a flood must not fill the memory |
| ZOOM_NEAR | 0.02 | - | of the focal length: reached | a step is more than that |
| ZOOM_MOVED_PERCENT | 2 | % | the lens was moved | the camera rounds its position |
| ZOOM_MAX_PICTURES | 12 | - | to reach a focal length | then the nearest is kept |
| ZOOM_MAX_STEPS | 60 | - | from one end to the other | steps are of two percent or more |
| ZOOM_STILL_LOOKS | 8 | - | looks that see the lens at rest | 0.8 s |
| ZOOM_MAX_TURNS | 2 | - | to and fro across the goal | then the nearest is kept |
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

"""An RTSP server on loopback, as an IP camera is one: as much of RFC 2326, 3550, 6184 and 7798 as a client asks for.

One stream of access units in Annex B, sent as RTP over the connection itself (interleaved), with sender reports that
say which RTP time was which wall clock. Each can be told to misbehave. What is sent when is up to the `Show`.
"""

from __future__ import annotations

import base64
import hashlib
import socket
import socketserver
import struct
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Self

RTP_HZ = 90_000
NTP_OF_1970_S = 2_208_988_800
MAX_PAYLOAD_BYTES = 1200
FIRST_TICK = 4_000_000_000  # so that it soon wraps
SSRC = 0x5EED
_HEAD = ("v=0", "o=- 0 0 IN IP4 127.0.0.1", "s=cockpit", "c=IN IP4 127.0.0.1", "t=0 0")
REALM, NONCE = "camera", "0123456789abcdef"


@dataclass
class Show:
    """What the camera sends.

    Attributes
    ----------
    units
        Access units in Annex B, in decoding order; again from the first for each connection.
    step_s
        Between two of them, by the camera's clock and by the box's.
    clock_ns
        The camera's wall clock when it is asked for; None for a camera that sends no sender reports.
    after
        What happens after the last: `wait`, or `close` the connection.
    user, way
        `name:password` that is asked for, and whether in the way `Basic` or `Digest`.
    sets_in_sdp
        Whether the parameter sets stand in the description alone, and not in the stream.
    sets_of
        The access unit whose parameter sets are described; the first if empty.
    report_every
        A sender report stands before one in so many units.
    """

    units: Sequence[bytes]
    codec: str = "h264"
    step_s: float = 0.04
    clock_ns: Callable[[], int] | None = time.time_ns
    after: str = "wait"
    user: str = ""
    way: str = "Digest"
    sets_in_sdp: bool = False
    sets_of: bytes = b""
    report_every: int = 5
    requests: list[str] = field(default_factory=list)
    sent: list[tuple[int, int]] = field(default_factory=list)  # wall clock and monotonic ns of each unit


def nal_units(unit: bytes) -> list[bytes]:
    """Take an access unit in Annex B apart."""
    return [nal for part in unit.split(b"\0\0\1") if (nal := part.rstrip(b"\0"))]


class Server(socketserver.ThreadingTCPServer):
    """Serves a show on a free port of loopback."""

    allow_reuse_address = True
    daemon_threads = True

    def __init__(self, show: Show) -> None:
        super().__init__(("127.0.0.1", 0), Connection)
        self.show = show
        self.over = threading.Event()

    @property
    def url(self) -> str:
        """Where it is."""
        return f"rtsp://127.0.0.1:{self.server_address[1]}/live"

    def __enter__(self) -> Self:
        threading.Thread(target=self.serve_forever, args=(0.02,), daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self.over.set()
        self.shutdown()
        self.server_close()


class Connection(socketserver.StreamRequestHandler):
    """One client."""

    server: Server

    def handle(self) -> None:
        """Answer its requests until it goes away."""
        self._playing: threading.Thread | None = None
        self._writing = threading.Lock()
        try:
            while not self.server.over.is_set() and (request := self._request()) is not None:
                method, headers = request
                self.server.show.requests.append(method)
                if not self._is_allowed(method, headers):
                    self._refuse(headers)
                else:
                    getattr(self, f"_{method.lower()}")(headers)
        except (OSError, ValueError):
            return

    def _request(self) -> tuple[str, dict[str, str]] | None:
        first = self.rfile.read(1)
        while first == b"$":  # the client's own reports
            _, size = struct.unpack(">BH", self.rfile.read(3))
            self.rfile.read(size)
            first = self.rfile.read(1)
        if not first:
            return None
        line = (first + self.rfile.readline()).decode()
        headers = {}
        while text := self.rfile.readline().decode().strip():
            name, _, value = text.partition(":")
            headers[name.lower()] = value.strip()
        return line.split()[0], {**headers, "uri": line.split()[1]}

    def _answer(self, headers: dict[str, str], *lines: str, status: str = "200 OK", body: str = "") -> None:
        head = [f"RTSP/1.0 {status}", f"CSeq: {headers['cseq']}", *lines]
        if body:
            head.append(f"Content-Length: {len(body)}")
        with self._writing:
            self.wfile.write("\r\n".join([*head, "", body]).encode())

    def _is_allowed(self, method: str, headers: dict[str, str]) -> bool:
        show = self.server.show
        if not show.user or method == "OPTIONS":
            return True
        name, _, password = show.user.partition(":")
        given = headers.get("authorization", "")
        if show.way == "Basic":
            return given == "Basic " + base64.b64encode(show.user.encode()).decode()

        def digest(text: str) -> str:
            return hashlib.md5(text.encode(), usedforsecurity=False).hexdigest()

        one, two = digest(f"{name}:{REALM}:{password}"), digest(f"{method}:{headers['uri']}")
        return f'response="{digest(f"{one}:{NONCE}:{two}")}"' in given

    def _refuse(self, headers: dict[str, str]) -> None:
        nonce = f', nonce="{NONCE}"' if self.server.show.way == "Digest" else ""
        wanted = f'WWW-Authenticate: {self.server.show.way} realm="{REALM}"{nonce}'
        self._answer(headers, wanted, status="401 Unauthorized")

    def _options(self, headers: dict[str, str]) -> None:
        self._answer(headers, "Public: OPTIONS, DESCRIBE, SETUP, PLAY, TEARDOWN, GET_PARAMETER")

    def _get_parameter(self, headers: dict[str, str]) -> None:
        self._answer(headers)

    def _describe(self, headers: dict[str, str]) -> None:
        body = description(self.server.show)
        self._answer(headers, "Content-Type: application/sdp", f"Content-Base: {headers['uri']}/", body=body)

    def _setup(self, headers: dict[str, str]) -> None:
        if "interleaved" not in headers["transport"]:
            self._answer(headers, status="461 Unsupported transport")
            return
        self._answer(headers, "Session: 42;timeout=60", "Transport: RTP/AVP/TCP;unicast;interleaved=0-1")

    def _play(self, headers: dict[str, str]) -> None:
        self._answer(headers, "Session: 42", "Range: npt=0.000-")
        self._playing = threading.Thread(target=self._perform, daemon=True)
        self._playing.start()

    def _teardown(self, headers: dict[str, str]) -> None:
        self._answer(headers)
        raise ValueError("it is over")

    def _perform(self) -> None:
        show, over = self.server.show, self.server.over
        number, tick = 0, FIRST_TICK
        for index, unit in enumerate(show.units):
            if over.wait(show.step_s):
                return
            tick = (tick + round(show.step_s * RTP_HZ)) % 2**32
            wall_ns = show.clock_ns() if show.clock_ns else 0
            if show.clock_ns and index % show.report_every == 0:
                self._send(1, sender_report(wall_ns, tick))
            show.sent.append((wall_ns, time.monotonic_ns()))
            kept = [nal for nal in nal_units(unit) if not (show.sets_in_sdp and is_set(nal, show.codec))]
            payloads = [each for nal in kept for each in fragments(nal, show.codec)]
            for place, payload in enumerate(payloads):
                marker = 0x80 if place == len(payloads) - 1 else 0
                header = struct.pack(">BBHII", 0x80, marker | 96, number % 2**16, tick, SSRC)
                self._send(0, header + payload)
                number += 1
        if show.after == "close":
            with suppress(OSError):  # the client may have gone first
                self.connection.shutdown(socket.SHUT_RDWR)

    def _send(self, channel: int, packet: bytes) -> None:
        with self._writing, suppress(OSError, ValueError):
            self.wfile.write(struct.pack(">BBH", ord("$"), channel, len(packet)) + packet)


def is_set(nal: bytes, codec: str) -> bool:
    """Whether it is a parameter set."""
    return (nal[0] & 31 in (7, 8)) if codec == "h264" else (nal[0] >> 1 & 63 in (32, 33, 34))


def description(show: Show) -> str:
    """The stream's SDP."""
    if show.codec == "jpeg":
        return "\r\n".join([*_HEAD, "m=video 0 RTP/AVP 26", "a=control:trackID=0", ""])
    sets = [nal for nal in nal_units(show.sets_of or show.units[0]) if is_set(nal, show.codec)]
    texts = [base64.b64encode(nal).decode() for nal in sets]
    if show.codec == "h264":
        name = "H264"
        format_ = f"packetization-mode=1;profile-level-id={sets[0][1:4].hex()};sprop-parameter-sets={','.join(texts)}"
    else:
        name = "H265"
        format_ = ";".join(f"sprop-{kind}={text}" for kind, text in zip(("vps", "sps", "pps"), texts, strict=True))
    lines = [
        *_HEAD,
        "m=video 0 RTP/AVP 96",
        f"a=rtpmap:96 {name}/{RTP_HZ}",
        f"a=fmtp:96 {format_}",
        "a=control:trackID=0",
    ]
    return "\r\n".join([*lines, ""])


def fragments(nal: bytes, codec: str) -> Iterator[bytes]:
    """RTP payloads of a NAL unit: as it is, or in fragments (FU-A of RFC 6184, FU of RFC 7798)."""
    if len(nal) <= MAX_PAYLOAD_BYTES:
        yield nal
        return
    if codec == "h264":
        head, kind, body = bytes([nal[0] & 0xE0 | 28]), nal[0] & 31, nal[1:]
    else:
        head, kind, body = bytes([nal[0] & 0x81 | 49 << 1, nal[1]]), nal[0] >> 1 & 63, nal[2:]
    parts = [body[at : at + MAX_PAYLOAD_BYTES] for at in range(0, len(body), MAX_PAYLOAD_BYTES)]
    for place, part in enumerate(parts):
        flags = (0x80 if place == 0 else 0) | (0x40 if place == len(parts) - 1 else 0)
        yield head + bytes([flags | kind]) + part


def sender_report(wall_ns: int, tick: int) -> bytes:
    """An RTCP sender report: at this wall clock the RTP time was this."""
    seconds, rest_ns = divmod(wall_ns, 10**9)
    fraction = int(Fraction(rest_ns, 10**9) * 2**32)
    return struct.pack(">BBHIIIIII", 0x80, 200, 6, SSRC, seconds + NTP_OF_1970_S, fraction, tick, 0, 0)

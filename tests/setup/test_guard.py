"""Only the browser that was given the address gets in; other requests are refused in a sentence, never a 500."""

from __future__ import annotations

import json
import re
import socket
from collections.abc import Callable, Mapping
from typing import Any
from urllib.parse import urlsplit

import pytest
from hypothesis import HealthCheck, given, settings

from decoder.setup.app import page_files
from decoder.setup.session import SetupSession
from flight_file.thresholds import MAX_YAML_BYTES
from tests.hostile import Change, changes, spoilt
from tests.programs import FIXTURES, yaml_of

Answer = tuple[int, Any, Mapping[str, str]]
Send = Callable[..., Answer]


def refused(answer: Answer, *status: int, words: str = "") -> None:
    """An answer is a refusal of one printable sentence, with this status if one is named."""
    assert answer[0] in (status or range(400, 500)), answer
    assert words in answer[1]["error"]
    assert answer[1]["error"].isprintable()
    assert len(answer[1]["error"]) < LONGEST_SENTENCE


def test_page_is_given_to_who_has_the_token(send: Send) -> None:
    """The printed address gives the page."""
    status, content, headers = send("GET", "/")

    assert (status, headers["content-type"]) == (200, "text/html; charset=utf-8")
    assert b"Panel set-up" in content


@pytest.mark.parametrize(
    ("method", "asked", "status", "words"),
    [
        *(("GET", {"token": token}, 403, "token") for token in ("", "/", "/wrong", "/wrong/api/session")),
        *(
            ("GET", {"Host": host}, 421, "not the set-up page's own")  # a name that was bent here: DNS rebinding
            for host in ("example.org", "127.0.0.1", "127.0.0.1:1", "evil.127.0.0.1.nip.io")
        ),
        *(("PUT", {"Origin": origin}, 403, "another") for origin in ("http://example.org", "null")),
        ("PUT", {"Sec_Fetch_Site": "cross-site"}, 403, "another"),
    ],
)
def test_who_was_not_given_the_address_is_refused(
    send: Send, method: str, asked: dict[str, str], status: int, words: str
) -> None:
    """Without the token, by another name of this machine, or from another page even with the token."""
    path, body = ("/", None) if method == "GET" else ("/api/panel", "{}")
    refused(send(method, path, body, **asked), status, words=words)


@pytest.mark.parametrize(
    "path",
    [
        *("/page/../app.py", "/page/..%2fapp.py", "/page/%2e%2e/%2e%2e/pyproject.toml", "/page//etc/passwd"),
        *("/page/..\\app.py", "/../../etc/passwd", "/page/style.css%00.js", "/page/__init__.py"),
        *(f"/api/pictures/{key}/whole" for key in ("../panel", "frame-99", "frame--1", "frame-1e3", "panel.yaml")),
    ],
)
def test_nothing_but_the_pages_files_is_served(send: Send, path: str) -> None:
    """No way leads out of the page's own folder, and a picture's key is looked up, never made a path of."""
    status, content, _ = send("GET", path)

    assert status in {403, 404}
    assert b"import" not in (content if isinstance(content, bytes) else b"")


@pytest.mark.parametrize("says_so", [True, False])
def test_large_body_is_refused(send: Send, says_so: bool) -> None:  # noqa: FBT001
    """A body beyond the limit is refused before it is read, and one that does not say how long it is while it is."""
    pieces = (b" " * 2**16 for _ in range(MAX_YAML_BYTES // 2**16 + 2))  # sent in chunks
    headers = {"Content_Length": str(MAX_YAML_BYTES + 1)} if says_so else {}
    refused(send("PUT", "/api/panel", b"" if says_so else pieces, **headers), 413, words="larger than")


@pytest.mark.parametrize(
    "body",
    [
        *(b"", b"no json", b"[]", b"{}", b"\xff\xfe", b'{"picture": "panel"', b"[" * 100_000),
        b'{"picture": "../x", "document": {}, "revision": 0}',
        b'{"picture": "frame-0", "document": {}, "revision": 0, "more": 1}',
        b'{"picture": "frame-0", "document": {"name": "\\ud800"}}',
    ],
)
def test_invalid_body_is_refused(send: Send, body: bytes) -> None:
    """A body that is not what the page sends is answered in one sentence."""
    for path in ("check", "unwrap", "planes", "rim", "found"):
        refused(send("POST", f"/api/{path}", body), 400, words="not understood")
    refused(send("PUT", "/api/panel", body), 400, words="not understood")


@pytest.mark.parametrize(
    "document",
    [
        {"gauges": 5},
        {"gauges": [5], "anchors": "x"},
        {"gauges": [{"needles": [{"template": 3}]}]},
        {"picture": ["x"]},
        {"name": "x", "picture": "../../x.jpg", "anchors": [], "gauges": []},
    ],
)
def test_drafts_of_any_shape_are_told_what_is_wrong(send: Send, document: dict[str, object]) -> None:
    """Whatever a draft holds, it is judged, not a failure of the program."""
    body = json.dumps({"document": document, "picture": "frame-0"})
    status, answer, _ = send("POST", "/api/check", body)

    assert status == 200
    assert answer["problems"]


@pytest.mark.parametrize(
    ("method", "path", "more", "why"),
    [
        ("PUT", "/api/panel", {"document": {"gauges": []}, "over": True, "revision": 0}, "invalid"),
        ("PUT", "/api/panel", {"document": {}, "revision": 10**6}, "elsewhere"),
        ("POST", "/api/rim", {"points": [[0, 0], [9, 9], [20, 20]]}, "cannot"),
        ("POST", "/api/paste", {"document": {"gauges": [{}]}, "to": "frame-1"}, "cannot"),
    ],
)
def test_what_cannot_be_done_is_an_answer(send: Send, method: str, path: str, more: dict[str, Any], why: str) -> None:
    """A question that was understood is answered, also with no: the browser's log is for what went wrong."""
    status, answer, _ = send(method, path, json.dumps({"picture": "frame-0", **more}))

    assert (status, answer["declined"]) == (200, why)
    assert answer["error"]


@pytest.mark.parametrize(
    "told",
    [
        {"reference_points": 5, "level": "x", "focal_length_mm": "wide"},
        {"reference_points": [{"at": [0, 0], "inches": [None, 1]}] * 4},
        {"reference_points": [{"at": [1, 1], "inches": [1, 1]}] * 4},
        {"focal_length_mm": 1e9},
    ],
)
@pytest.mark.parametrize("rim", [None, "x", [[0, 0]] * 5, [[1, 2, 3]] * 9, [[100, 100]] * 5])
def test_dials_of_half_drawn_drafts_are_drawn(send: Send, told: dict[str, object], rim: object) -> None:
    """Whatever a draft tells of how its dials are seen, there is a picture of them."""
    dial = {"centre": [100, 100], "radius": 40, "rim": rim}
    status, answer, _ = send("POST", "/api/planes", json.dumps({"picture": "frame-0", "dials": [dial], **told}))

    assert status == 200
    assert len(answer["planes"][0]) == 9


def test_answers_allow_nothing_from_elsewhere(send: Send) -> None:
    """Every answer forbids the browser to load, embed, remember or tell anything."""
    for path in ("/", "/page/main.js", "/api/session", "/nothing"):
        headers = {name.lower(): value for name, value in send("GET", path)[2].items()}
        assert "default-src 'none'" in headers["content-security-policy"]
        assert "http" not in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert headers["cache-control"] == "no-store"


def test_page_names_no_other_place() -> None:
    """Nothing in the page's files is an address of anywhere else."""
    assert {address for content in page_files().values() for address in re.findall(rb"https?:[^\"' )]*", content)} == {
        b"http://www.w3.org/2000/svg"
    }


PANEL: dict[str, Any] = yaml_of(FIXTURES / "panel.yaml")
LONGEST_SENTENCE = 600
EXAMPLES = 30
SEEN = {"picture": "frame-0", "focal_length_mm": 4.45, "reference_points": [], "level": PANEL["level"]}
DIAL = {"centre": [512.0, 384.0], "radius": [20.0, 52.0], "sweep": [120.0, 420.0], "rim": None}
RIM = [[100 + 40 * x, 100 + 40 * y] for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1), (0.6, 0.8))]
DRAFT = {"document": PANEL, "picture": "frame-0"}
# What the page sends, one of each kind.
QUESTIONS: dict[str, tuple[str, Any]] = {
    "panel": ("PUT", {**DRAFT, "revision": 0, "over": True, "replace": True}),
    "check": ("POST", DRAFT),
    "unwrap": ("POST", {**SEEN, **DIAL, "tab": "t"}),
    "planes": ("POST", {**SEEN, "dials": [{"centre": [100, 100], "radius": 40, "rim": RIM}]}),
    "rim": ("POST", {**SEEN, "points": RIM, "ring": {"centre": [100, 100], "radius": 40.0, "rim": RIM}}),
    "mark": ("POST", {**SEEN, "centre": [100.0, 100.0], "rim": RIM, "click": [140.0, 100.0]}),
    "needles": ("POST", {**SEEN, **DIAL, "document": PANEL, "near": 200.0, "needle_height_inches": 0.1,
                         "tab": "t"}),
    "trial": ("POST", {**DRAFT, "gauge": 0, "tab": "t"}),
    "paste": ("POST", {**DRAFT, "to": "frame-1"}),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("kind", QUESTIONS)
@settings(max_examples=EXAMPLES, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(replaced=changes("panel", "frame-0", "frame-99999", "frame-1e3", "camera.yaml", "PANEL.YAML", 10**4000))
def test_spoilt_question_is_answered(send: Send, kind: str, replaced: list[Change]) -> None:
    """What the page sends with one or two values replaced has an answer, a no, or a refusal."""
    method, body = QUESTIONS[kind]
    status, answer, _ = send(method, f"/api/{kind}", json.dumps(spoilt(body, replaced)).encode())

    assert status in {200, 204, 400, 413}, answer
    if answer and "error" in answer:
        assert answer["error"].isprintable()
        assert len(answer["error"]) < LONGEST_SENTENCE
    assert replaced or "declined" not in answer, answer


@pytest.mark.parametrize("depth", [40, 500, 900, 20_000])
@pytest.mark.parametrize("kind", QUESTIONS)
def test_deep_document_is_refused(send: Send, kind: str, depth: int) -> None:
    """A document that nests without end is refused before any part of the program goes down into it."""
    method, body = QUESTIONS[kind]
    key = "document" if "document" in body else "rim" if "rim" in body else "level"
    text = json.dumps({**body, key: "DEEP"}).replace('"DEEP"', '{"a":' * depth + "[]" + "}" * depth)
    refused(send(method, f"/api/{kind}", text.encode()))


@pytest.mark.parametrize("method", ["GET", "POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "BREW"])
@pytest.mark.parametrize(
    "path",
    [
        *("", "api/session", "api/panel", "api/trial", "api/none", "api/pictures/x/part", "%00"),
        "api/pictures/frame-0/part?left=1",  # a part of a picture needs five numbers
        "api/pictures/frame-0/part?left=x&top=0&width=1&height=1&wanted=1",
        f"api/pictures/frame-0/part?left={'9' * 5000}&top=0&width=1&height=1&wanted=1",
    ],
    ids=lambda path: path[:40],
)
def test_wrong_method_or_path_is_refused(send: Send, method: str, path: str) -> None:
    """What the page never asks for is a sentence too."""
    if (method, path) in {("GET", ""), ("GET", "api/session")}:
        return
    refused(send(method, f"/{path}", b"{}" if method in {"POST", "PUT"} else None))


@pytest.mark.parametrize(
    "head",
    [
        "OPTIONS * HTTP/1.1\r\nHost: {host}",
        "GET / HTTP/1.1\r\nHost: {host}",
        "GET /%ff%fe/ HTTP/1.1\r\nHost: {host}",
        "GET {token}api/ping HTTP/1.1\r\nHost: \xff\xfe",
        "GET {token}api/ping HTTP/1.1\r\nHost: {host}, evil.example",
        "GET {token}api/ping HTTP/1.0",
        "PUT {token}api/panel HTTP/1.1\r\nHost: {host}\r\nContent-Length: 104857600",
        "PUT {token}api/panel HTTP/1.1\r\nHost: {host}\r\nContent-Length: -1",
        "GET {token}../api/ping HTTP/1.1\r\nHost: {host}",
        "GET http://{host}{token}none HTTP/1.1\r\nHost: {host}",
    ],
)
def test_odd_head_is_refused(server: Any, head: str) -> None:  # noqa: ANN401
    """So is a request whose head no browser sends."""
    url = urlsplit(server.url)
    with socket.create_connection(("127.0.0.1", url.port or 0), timeout=60) as connection:
        text = head.format(host=url.netloc, token=url.path) + "\r\nConnection: close\r\n\r\n"
        connection.sendall(text.encode("latin-1"))
        answer = b"".join(iter(lambda: connection.recv(65536), b""))

    assert answer.split(b" ", 2)[1].startswith(b"4"), answer


def test_fault_of_the_program_is_a_sentence_and_is_logged(
    send: Send, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """An unexpected error is still JSON with a sentence, and the log has the traceback."""

    def fail(*_: object) -> None:
        raise RuntimeError("nobody expected this")

    monkeypatch.setattr(SetupSession, "problems", fail)
    status, answer, _ = send("POST", "/api/check", json.dumps(DRAFT).encode())

    assert (status, "terminal" in answer["error"]) == (500, True)
    assert "nobody expected this" in caplog.text
    assert "Traceback" in caplog.text

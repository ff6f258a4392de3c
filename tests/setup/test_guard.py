"""Only the browser that was given the address gets in; everything else is refused in one sentence."""

from __future__ import annotations

import http.client
import json
import re
from collections.abc import Callable, Mapping
from typing import Any
from urllib.parse import urlsplit

import pytest

from decoder.setup.app import page_files
from decoder.setup.guard import MAX_BODY_BYTES

Answer = tuple[int, Any, Mapping[str, str]]
Send = Callable[..., Answer]


@pytest.fixture
def send(start: Callable[..., Any]) -> Send:
    """Sends requests to a running page as they stand, and gives status, JSON or bytes, and headers."""
    url = urlsplit(start().url)

    def request(method: str, path: str, body: object = None, *, token: str | None = None, **headers: str) -> Answer:
        connection = http.client.HTTPConnection("127.0.0.1", url.port or 0, timeout=10)
        prefix = url.path.rstrip("/") if token is None else token
        names = {name.replace("_", "-"): value for name, value in headers.items()}
        connection.request(method, prefix + path, body, names)
        answer = connection.getresponse()
        content = answer.read()
        connection.close()
        told = answer.getheader("content-type", "")
        return answer.status, json.loads(content) if told == "application/json" else content, dict(answer.headers)

    return request


def refused(answer: Answer, status: int, words: str) -> None:
    """An answer is a refusal of one sentence."""
    assert answer[0] == status
    assert words in answer[1]["error"]
    assert "\n" not in answer[1]["error"]


def test_page_is_given_to_who_has_the_token(send: Send) -> None:
    """The printed address gives the page."""
    status, content, headers = send("GET", "/")

    assert (status, headers["content-type"]) == (200, "text/html; charset=utf-8")
    assert b"Panel set-up" in content


@pytest.mark.parametrize("token", ["", "/", "/wrong", "/wrong/api/session"])
def test_wrong_token_is_refused(send: Send, token: str) -> None:
    """Without the token in the address nothing is answered."""
    refused(send("GET", "/", token=token), 403, "token")


@pytest.mark.parametrize("host", ["example.org", "127.0.0.1", "127.0.0.1:1", "evil.127.0.0.1.nip.io"])
def test_foreign_host_is_refused(send: Send, host: str) -> None:
    """A name that was bent to this address (DNS rebinding) does not get in."""
    refused(send("GET", "/", Host=host), 421, "not the set-up page's own")


@pytest.mark.parametrize(
    "headers", [{"Origin": "http://example.org"}, {"Origin": "null"}, {"Sec_Fetch_Site": "cross-site"}]
)
def test_other_pages_are_refused(send: Send, headers: dict[str, str]) -> None:
    """A request that another page made does not get in, even with the token."""
    refused(send("PUT", "/api/panel", "{}", **headers), 403, "another")


@pytest.mark.parametrize(
    "path",
    [
        "/page/../app.py",
        "/page/..%2fapp.py",
        "/page/%2e%2e/%2e%2e/pyproject.toml",
        "/page//etc/passwd",
        "/page/..\\app.py",
        "/../../etc/passwd",
        "/page/style.css%00.js",
        "/page/__init__.py",
    ],
)
def test_nothing_but_the_pages_files_is_served(send: Send, path: str) -> None:
    """No way leads out of the page's own folder."""
    status, content, _ = send("GET", path)

    assert status in {403, 404}
    assert b"import" not in (content if isinstance(content, bytes) else b"")


@pytest.mark.parametrize("key", ["../panel", "frame-99", "frame--1", "frame-1e3", "panel"])
def test_pictures_that_are_not_there(send: Send, key: str) -> None:
    """A picture's key is looked up, never made a path of."""
    assert send("GET", f"/api/pictures/{key}/whole")[0] == 404


def test_body_that_says_it_is_large_is_refused(send: Send) -> None:
    """A body beyond the limit is refused before it is read."""
    refused(send("PUT", "/api/panel", b"", Content_Length=str(MAX_BODY_BYTES + 1)), 413, "larger than")


def test_body_that_goes_on_is_refused(send: Send) -> None:
    """So is one that does not say how long it is."""
    pieces = (b" " * 2**16 for _ in range(MAX_BODY_BYTES // 2**16 + 2))  # sent in chunks
    refused(send("PUT", "/api/panel", pieces), 413, "larger than")


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"no json",
        b"[]",
        b"{}",
        b"\xff\xfe",
        b'{"picture": "panel"',
        b'{"picture": "../x", "document": {}, "revision": 0}',
        b'{"picture": "frame-0", "document": {}, "revision": 0, "more": 1}',
        b"[" * 100_000,
    ],
)
@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("PUT", "/api/panel"),
        ("POST", "/api/check"),
        ("POST", "/api/unwrap"),
        ("POST", "/api/planes"),
        ("POST", "/api/rim"),
    ],
)
def test_invalid_body_is_refused(send: Send, method: str, path: str, body: bytes) -> None:
    """A body that is not what the page sends is answered in one sentence."""
    refused(send(method, path, body), 400, "not understood")


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
        ("PUT", "/api/panel", {"document": {"gauges": []}, "revision": 0}, "invalid"),
        ("PUT", "/api/panel", {"document": {}, "revision": 7}, "elsewhere"),
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

"""Questions and answers of the camera's calls, answer by answer."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from camera_drivers.errors import CameraRefusedError, CameraSilentError
from camera_drivers.qx10.exchange import Answer
from camera_drivers.qx10.remote_api import RemoteApi, _result


class Recorded:
    """A link that answers what it is told to, and keeps what it was asked."""

    def __init__(self, answer: Any) -> None:  # noqa: ANN401 - JSON
        self.answer = answer
        self.asked: list[tuple[str, Any]] = []
        self.limits = type("Limits", (), {"call_s": 1.0})

    def post(self, _call: str, url: str, body: bytes, **_limits: object) -> Answer:
        """As the camera answers."""
        self.asked.append((url, json.loads(body)))
        return Answer(200, json.dumps(self.answer | {"id": self.asked[-1][1]["id"]}).encode())


def test_question_has_method_parameters_number_and_version() -> None:
    """Numbers count from 1; the version is that of the method."""
    link = Recorded({"result": [0]})
    api = RemoteApi(link, {"camera": "http://c/camera", "system": "http://c/system"})  # type: ignore[arg-type]  # a stand-in
    api.call("setShootMode", "still")
    api.call("getEvent", False, version="1.1")
    api.call("setCurrentTime", {}, service="system")

    assert link.asked == [
        ("http://c/camera", {"method": "setShootMode", "params": ["still"], "id": 1, "version": "1.0"}),
        ("http://c/camera", {"method": "getEvent", "params": [False], "id": 2, "version": "1.1"}),
        ("http://c/system", {"method": "setCurrentTime", "params": [{}], "id": 3, "version": "1.0"}),
    ]


def test_service_that_the_camera_lacks_is_a_refusal() -> None:
    """As a call that it does not know."""
    api = RemoteApi(Recorded({"result": []}), {})  # type: ignore[arg-type]  # a stand-in
    with pytest.raises(CameraRefusedError) as caught:
        api.call("setCurrentTime", service="system")
    assert caught.value.code == 12


@pytest.mark.parametrize(
    ("status", "body", "code"),
    [
        (200, b'{"id":7,"error":[40403,"anything"]}', 40403),
        (200, b'{"error":[12,"actTakePicture"],"id":7}', 12),
        (200, b'{"id":7,"error":"what"}', 1),
        (403, b'{"id":7,"error":[403,"getAvailableCameraFunction"]}', 403),
        (404, b'{"error":[404,"Not Found"]}', 404),
        (500, b"<html>", 500),
        (503, b"", 503),
        (302, b"", 302),
    ],
)
def test_error_is_its_code(status: int, body: bytes, code: int) -> None:
    """With HTTP status 200 or another, with a number or without, the text means nothing."""
    with pytest.raises(CameraRefusedError) as caught:
        _result("m", 7, Answer(status, body))
    assert caught.value.code == code


@pytest.mark.parametrize(
    "body",
    [
        *(b"", b"[]", b"null", b"<html>", b"[" * 100_000),
        *(b'{"id":8,"result":[0]}', b'{"result":[0]}', b'{"id":7}', b'{"id":7,"result":0}'),
    ],
)
def test_answer_that_does_not_fit_is_silence(body: bytes) -> None:
    """No JSON, no object, another number or none, no result."""
    with pytest.raises(CameraSilentError) as caught:
        _result("m", 7, Answer(200, body))
    assert caught.value.delivered


def test_result_may_be_called_results() -> None:
    """One call answers like that."""
    assert _result("getMethodTypes", 7, Answer(200, b'{"id":7,"results":[["a"]]}')) == [["a"]]


@given(body=st.binary(max_size=60), status=st.integers(100, 599))
def test_any_answer_may_come(body: bytes, status: int) -> None:
    """Nothing is raised but our own errors."""
    with pytest.raises((CameraRefusedError, CameraSilentError)):
        _result("m", 7, Answer(status, body))

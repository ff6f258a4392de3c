"""Questions and answers of the camera's calls, and the answers of `getEvent`, whatever is in them."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from camera_drivers.errors import CameraRefusedError, CameraSilentError
from camera_drivers.qx10.events import CameraState, Events
from camera_drivers.qx10.link import Answer
from camera_drivers.qx10.remote_api import RemoteApi

ANSWER = [
    {"type": "availableApiList", "names": ["getEvent"]},
    {"type": "cameraStatus", "cameraStatus": "IDLE"},
    {"type": "zoomInformation", "zoomPosition": 7, "zoomNumberBox": 1},
    {"type": "liveviewStatus", "liveviewStatus": False},
    None,
    [{"type": "takePicture", "takePictureUrl": ["http://10.0.0.1:60152/a.JPG"]}],
    [],
    [{"type": "storageInformation", "storageID": "Memory Card 1", "numberOfRecordableImages": 1730}],
]
UNKNOWN = [
    {"type": "zoomInformation", "zoomPosition": -1},
    {"type": "storageInformation", "numberOfRecordableImages": -1},
]
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
)
KINDS = {
    "cameraStatus": "cameraStatus",
    "zoomInformation": "zoomPosition",
    "liveviewStatus": "liveviewStatus",
    "storageInformation": "numberOfRecordableImages",
    "takePicture": "takePictureUrl",
}
ITEMS = st.one_of(JSON, *(st.fixed_dictionaries({"type": st.just(kind), key: JSON}) for kind, key in KINDS.items()))


class Recorded:
    """A link that answers what it is told to, and keeps what it was asked."""

    limits = SimpleNamespace(call_s=1.0)

    def __init__(self, answer: Answer) -> None:
        self.answer = answer
        self.asked: list[tuple[str, Any]] = []

    def post(self, _call: str, url: str, body: bytes, **_limits: object) -> Answer:
        """As the camera answers."""
        self.asked.append((url, json.loads(body)))
        return self.answer


def api(link: Recorded) -> RemoteApi:
    """The calls of a camera behind a link."""
    return RemoteApi(link, {"camera": "http://c/camera", "system": "http://c/system"})


def test_question_has_method_parameters_number_and_version() -> None:
    """Numbers count from 1; a service that the camera lacks is as a call that it does not know."""
    link = Recorded(Answer(200, b'{"result": [0], "id": 1}'))
    camera = api(link)
    camera.call("setShootMode", "still")
    link.answer = Answer(200, b'{"result": [0], "id": 2}')
    camera.call("getEvent", False, version="1.1")
    link.answer = Answer(200, b'{"result": [0], "id": 3}')
    camera.call("setCurrentTime", {}, service="system")

    assert link.asked == [
        ("http://c/camera", {"method": "setShootMode", "params": ["still"], "id": 1, "version": "1.0"}),
        ("http://c/camera", {"method": "getEvent", "params": [False], "id": 2, "version": "1.1"}),
        ("http://c/system", {"method": "setCurrentTime", "params": [{}], "id": 3, "version": "1.0"}),
    ]
    with pytest.raises(CameraRefusedError) as caught:
        camera.call("getEvent", service="guide")
    assert caught.value.code == 12


@pytest.mark.parametrize(
    ("status", "body", "code"),
    [
        (200, b'{"id":1,"error":[40403,"anything"]}', 40403),
        (200, b'{"error":[12,"actTakePicture"],"id":1}', 12),
        (200, b'{"id":1,"error":"what"}', 1),
        (403, b'{"id":1,"error":[403,"getAvailableCameraFunction"]}', 403),
        (404, b'{"error":[404,"Not Found"]}', 404),
        (500, b"<html>", 500),
        (503, b"", 503),
        (302, b"", 302),
        (200, b'{"id":1,"error":[' + b"9" * 4000 + b"]}", 1),
    ],
)
def test_error_is_its_code(status: int, body: bytes, code: int) -> None:
    """With HTTP status 200 or another, with a number or without, the text means nothing."""
    with pytest.raises(CameraRefusedError) as caught:
        api(Recorded(Answer(status, body))).call("m")
    assert caught.value.code == code


@pytest.mark.parametrize(
    "body",
    [
        *(b"", b"[]", b"null", b"<html>", b"[" * 100_000),
        *(b'{"id":8,"result":[0]}', b'{"result":[0]}', b'{"id":1}', b'{"id":1,"result":0}'),
    ],
)
def test_answer_that_does_not_fit_is_silence(body: bytes) -> None:
    """No JSON, no object, another number or none, no result."""
    with pytest.raises(CameraSilentError):
        api(Recorded(Answer(200, body))).call("m")


class Told:
    """A camera's calls that give what they are told to."""

    def __init__(self, answer: list[Any]) -> None:
        self.answer = answer

    def call(self, *_params: object, **_named: object) -> list[Any]:
        """The answer."""
        return self.answer


def test_state_is_looked_up_by_type() -> None:
    """Wherever an object stands, also within a row; null means nothing new, and -1 that it is not known."""
    for answer in (ANSWER, ANSWER[::-1]):
        events = Events()
        state = events.ask(Told(answer))

        assert state == CameraState("IDLE", 7.0, liveview=False, room=1730)
        assert events.pictures == ("http://10.0.0.1:60152/a.JPG",)
        assert events.ask(Told([None] * 35)) == state
        assert Events().ask(Told(UNKNOWN)) == CameraState()


@pytest.mark.parametrize("text", ["x\nMAINPID=1", "\udcff", "L" * 600_000], ids=["lines", "no UTF-8", "long"])
def test_status_of_any_text_is_short_and_printable(text: str) -> None:
    """It stands in sentences of the log and of the flight."""
    status = Events().ask(Told([{"type": "cameraStatus", "cameraStatus": text}])).status

    assert status is not None
    assert status.isprintable()
    assert len(status) < 200


@given(answer=st.lists(ITEMS, max_size=8))
def test_any_event_may_come(answer: list[Any]) -> None:
    """Nothing is raised, and the state has the types that it shall have."""
    state = Events().ask(Told(answer))

    assert state.status is None or isinstance(state.status, str)
    assert state.zoom_position is None or 0 <= state.zoom_position <= 100
    assert state.room is None or state.room >= 0

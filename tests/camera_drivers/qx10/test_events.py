"""The answers of `getEvent`, whatever is in them."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from camera_drivers.qx10.events import CameraState, Events

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


class Told:
    """A camera's calls that give what they are told to."""

    def __init__(self, answer: list[Any]) -> None:
        self.answer = answer

    def call(self, *_params: object, **_named: object) -> list[Any]:
        """The answer."""
        return self.answer


def test_state_is_looked_up_by_type() -> None:
    """Wherever an object stands, also within a row."""
    for answer in (ANSWER, ANSWER[::-1]):
        events = Events()
        state = events.ask(Told(answer))  # type: ignore[arg-type]  # a stand-in

        assert state == CameraState("IDLE", 7.0, liveview=False, room=1730)
        assert events.pictures == ("http://10.0.0.1:60152/a.JPG",)


def test_null_means_nothing_new() -> None:
    """What was known stays known."""
    events = Events()
    events.ask(Told(ANSWER))  # type: ignore[arg-type]  # a stand-in
    before = events.state

    assert events.ask(Told([None] * 35)) == before  # type: ignore[arg-type]  # a stand-in


def test_unknown_numbers_are_left_out() -> None:
    """The camera writes -1 where it does not know."""
    answer = [
        {"type": "zoomInformation", "zoomPosition": -1},
        {"type": "storageInformation", "numberOfRecordableImages": -1},
    ]

    assert Events().ask(Told(answer)) == CameraState()  # type: ignore[arg-type]  # a stand-in


@given(answer=st.lists(ITEMS, max_size=8))
def test_any_answer_may_come(answer: list[Any]) -> None:
    """Nothing is raised, and the state has the types that it shall have."""
    state = Events().ask(Told(answer))  # type: ignore[arg-type]  # a stand-in

    assert state.status is None or isinstance(state.status, str)
    assert state.zoom_position is None or 0 <= state.zoom_position <= 100
    assert state.room is None or state.room >= 0

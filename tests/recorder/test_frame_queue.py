"""The queue between camera and writer."""

from __future__ import annotations

import threading

from flight_file.frame import ClockReading, Frame, HostTimes
from flight_file.reports import CameraStatus
from recorder.frame_queue import QUEUE_NOTICES, Arrival, Ended, FrameQueue, Notice

AT = ClockReading(0, 0)


def notice(state: str) -> Notice:
    """News."""
    return Notice(CameraStatus(state), AT)


def arrival(sequence: int, jpeg: bytes = b"") -> Arrival:
    """A frame."""
    return Arrival(Frame(sequence, 0, jpeg, "", HostTimes(AT, AT, AT)), AT)


def test_full_queue_keeps_the_newest() -> None:
    """The oldest makes room, the producer hears of it, and the order is kept."""
    queue = FrameQueue(capacity=2)

    assert [queue.push(arrival(number)) for number in range(4)] == [0, 0, 1, 1]
    assert [queue.take(0), queue.take(0), queue.take(0)] == [arrival(2), arrival(3), None]


def test_notices_keep_their_place_among_the_frames() -> None:
    """A frame that makes room takes no notice with it."""
    queue = FrameQueue(capacity=1)
    for number in range(3):
        queue.notify(notice(str(number)))
        queue.push(arrival(number))

    assert len(queue) == 1
    assert [queue.take(0) for _ in range(4)] == [notice("0"), notice("1"), notice("2"), arrival(2)]


def test_notices_do_not_fill_the_memory() -> None:
    """The oldest ones go, and are counted."""
    queue = FrameQueue()
    for number in range(QUEUE_NOTICES + 3):
        queue.notify(notice(str(number)))

    assert queue.take(0) == notice("3")
    assert (queue.take_lost_notices(), queue.take_lost_notices()) == (3, 0)


def test_end_is_never_refused() -> None:
    """The end comes after the frames, even when the queue is full."""
    queue = FrameQueue(capacity=1)
    queue.push(arrival(0))
    queue.end(Ended("over", AT))

    assert [queue.take(0), queue.take(0)] == [arrival(0), Ended("over", AT)]


def test_patient_producer_waits_for_room() -> None:
    """`put` comes back when the consumer has made room."""
    queue = FrameQueue(capacity=1)
    queue.push(arrival(0))
    results: list[bool] = []
    producer = threading.Thread(target=lambda: results.append(queue.put(arrival(1), threading.Event())))
    producer.start()
    first = queue.take(5)
    producer.join(5)

    assert first == arrival(0)
    assert results == [True]
    assert queue.take(5) == arrival(1)


def test_patient_producer_gives_up_when_told_to_stop() -> None:
    """`put` says that the frame was not taken."""
    queue, stop = FrameQueue(capacity=1), threading.Event()
    queue.push(arrival(0))
    stop.set()

    assert queue.put(arrival(1), stop) is False


def test_large_pictures_fill_it_by_their_bytes() -> None:
    """Memory is what counts; but one picture always fits, however large it is."""
    queue = FrameQueue(capacity=10, capacity_bytes=100)

    assert queue.push(arrival(0, bytes(500))) == 0
    assert queue.push(arrival(1, b"x")) == 1
    assert [queue.push(arrival(number, bytes(50))) for number in range(2, 5)] == [0, 1, 1]

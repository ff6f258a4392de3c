"""The queue between camera and writer."""

from __future__ import annotations

import threading

from flight_file.frame import ClockReading, Frame, HostTimes
from recorder.frame_queue import Arrival, Ended, FrameQueue

AT = ClockReading(0, 0)


def arrival(sequence: int, jpeg: bytes = b"") -> Arrival:
    """A frame."""
    return Arrival(Frame(sequence, 0, jpeg, "", HostTimes(AT, AT, AT)), AT)


def test_full_queue_refuses_the_newest() -> None:
    """What is in it stays, what comes later is refused, and the order is kept."""
    queue = FrameQueue(capacity=2)

    assert [queue.offer(arrival(number)) for number in range(3)] == [True, True, False]
    assert [queue.take(0), queue.take(0), queue.take(0)] == [arrival(0), arrival(1), None]


def test_end_is_never_refused() -> None:
    """The end comes after the frames, even when the queue is full."""
    queue = FrameQueue(capacity=1)
    queue.offer(arrival(0))
    queue.end(Ended("over", AT))

    assert len(queue) == 2
    assert [queue.take(0), queue.take(0)] == [arrival(0), Ended("over", AT)]


def test_patient_producer_waits_for_room() -> None:
    """`put` comes back when the consumer has made room."""
    queue = FrameQueue(capacity=1)
    queue.offer(arrival(0))
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
    queue.offer(arrival(0))
    stop.set()

    assert queue.put(arrival(1), stop) is False


def test_large_pictures_fill_it_by_their_bytes() -> None:
    """Memory is what counts; but one picture always fits, however large it is."""
    queue = FrameQueue(capacity=10, capacity_bytes=100)

    assert queue.offer(arrival(0, bytes(500)))
    assert not queue.offer(arrival(1, b"x"))
    queue.take(0)
    assert [queue.offer(arrival(number, bytes(50))) for number in range(3)] == [True, True, False]

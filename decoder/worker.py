"""One process that reads batches of frames: it is told how once, then answers each batch with what it read.

Over its connection come the descriptors of two memories with pictures, a recipe, and where each batch's pictures lie:
in the one and the other memory by turns, so that the next batch is there when one is read.
"""

from __future__ import annotations

import pickle
from itertools import cycle
from multiprocessing.connection import Connection
from multiprocessing.reduction import recv_handle

import cv2
from threadpoolctl import threadpool_limits

from decoder.answers import told
from decoder.frame_batch import read_batch
from decoder.panel_reader import PanelReader
from decoder.shared_pictures import PicturesTaken

# The one that a worker is at, and the next: it need not wait for whoever hands out.
BATCHES_HELD = 2


def recipe(reader: PanelReader) -> bytes:
    """All that it takes to make the same reader again, in another process."""
    return pickle.dumps((reader.source, reader.method, reader.tuning), protocol=pickle.HIGHEST_PROTOCOL)


def serve(connection: Connection) -> None:
    """Reads what it is given; ends when nobody is at the other end any more."""
    cv2.setNumThreads(1)
    try:
        with threadpool_limits(1):
            memories = [PicturesTaken(recv_handle(connection)) for _ in range(BATCHES_HELD)]
            reader = PanelReader(*pickle.loads(connection.recv_bytes()))  # noqa: S301 - from the process that started us
            for pictures in cycle(memories):
                batch = pictures.take(connection.recv())
                connection.send([told(outcome) for outcome in read_batch(reader, batch)])
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return

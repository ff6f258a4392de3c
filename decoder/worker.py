"""One process that reads batches of frames: it is told how once, then answers each batch with what it read.

Over its connection come the descriptor of the memory with the pictures, a recipe, and where each batch's pictures lie.
"""

from __future__ import annotations

import pickle
from multiprocessing.connection import Connection
from multiprocessing.reduction import recv_handle

import cv2
from threadpoolctl import threadpool_limits

from decoder.answers import told
from decoder.frame_batch import read_batch
from decoder.panel_reader import PanelReader
from decoder.shared_pictures import PicturesTaken


def recipe(reader: PanelReader) -> bytes:
    """All that it takes to make the same reader again, in another process."""
    return pickle.dumps((reader.source, reader.method, reader.tuning), protocol=pickle.HIGHEST_PROTOCOL)


def serve(connection: Connection) -> None:
    """Reads what it is given; ends when nobody is at the other end any more."""
    cv2.setNumThreads(1)
    try:
        with threadpool_limits(1):
            pictures = PicturesTaken(recv_handle(connection))
            reader = PanelReader(*pickle.loads(connection.recv_bytes()))  # noqa: S301 - from the process that started us
            while True:
                batch = pictures.take(connection.recv())
                connection.send([told(outcome) for outcome in read_batch(reader, batch)])
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return
